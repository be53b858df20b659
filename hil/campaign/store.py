"""Results of a campaign on disk: one Parquet file a part, written whole and never again."""

import fcntl
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from hil.bench.result import MEASURED
from hil.campaign.plan import CampaignError, Plan
from hil.campaign.tasks import RECORDING_SUFFIX, Done
from hil.errors import BrakebenchError, Verdict
from hil.log.atomic_write import atomic_write
from hil.log.frames import LogError

_ABOUT, _RESULTS, _RECORDINGS = "campaign.json", "results", "recordings"


class StoreError(BrakebenchError):
    """Results that cannot be written; those before stand, and the same command goes on."""

    exit_code = Verdict.INCOMPLETE.exit_code


class Store:
    """Folder of one campaign.

    Parameters
    ----------
    folder : made where there is none.
    plan : whose results it holds.

    Raises
    ------
    CampaignError : it holds another campaign, or cannot be written.
    """

    def __init__(self, folder: Path, plan: Plan) -> None:
        self.folder, self._plan = folder, plan
        self._results, self._recordings = folder / _RESULTS, folder / _RECORDINGS
        self._schema = _schema(plan)
        try:
            for one in (folder, self._results, self._recordings):
                one.mkdir(parents=True, exist_ok=True)
            about = folder / _ABOUT
            if about.exists():
                self._compare(about)
            else:
                content = {"title": plan.title, "fingerprint": plan.fingerprint, "runs": plan.size}
                with atomic_write(about) as part:
                    part.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise CampaignError(f"{folder}: cannot be written ({error.strerror}); name a folder with --out") from error

    def _compare(self, about: Path) -> None:
        try:
            theirs = json.loads(about.read_text(encoding="utf-8"))["fingerprint"]
        except (ValueError, KeyError, TypeError) as error:
            raise CampaignError(f"{about}: not what a campaign writes; name another folder with --out") from error
        if theirs != self._plan.fingerprint:
            raise CampaignError(
                f"{self.folder}: holds results of another campaign than {self._plan.source.name} now describes (its "
                "numbers, or a scenario's file, have changed); name another folder with --out"
            )

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep a second command out meanwhile; the kernel forgets us however we end.

        Raises
        ------
        CampaignError : somebody is at it.
        """
        with (self.folder / _ABOUT).open("rb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise CampaignError(f"{self.folder}: another brakebench works on it; wait for it") from error
            yield

    def missing(self) -> Iterable[int]:
        """Parts without a file."""
        there = {path.name for path in self._results.iterdir()}
        return (part for part in range(self._plan.parts) if _name(part) not in there)

    def add(self, part: int, done: Sequence[Done]) -> None:
        """Write what came of a part: its recordings first, then its rows.

        Raises
        ------
        StoreError : the disk does not take it.
        """
        try:
            self._add(part, done)
        except LogError as error:
            raise StoreError(f"{error}; what was written before stands, and the same command goes on") from error

    def _add(self, part: int, done: Sequence[Done]) -> None:
        for one in done:
            if one.recording is not None:
                name = f"{one.row['run']:09d}{RECORDING_SUFFIX}"
                with atomic_write(self._recordings / name, overwrite=True) as path:
                    path.write_bytes(one.recording)
        columns: dict[str, list[Any]] = {name: [] for name in self._schema.names}
        for row in (one.row for one in done):
            run = self._plan.run(row["run"])
            full = {"scenario": run.scenario, "seed": run.seed} | self._plan.inputs(row["run"]) | row
            for name, column in columns.items():
                column.append(full.get(name))
        with atomic_write(self._results / _name(part)) as path:
            pq.write_table(pa.table(columns, self._schema), path, compression="zstd")

    def table(self) -> pa.Table:
        """All rows that are there, in the order of the runs."""
        paths = sorted(self._results.glob("part-*.parquet"))
        if not paths:
            return self._schema.empty_table()
        return pa.concat_tables([pq.read_table(path, schema=self._schema) for path in paths])


def _name(part: int) -> str:
    return f"part-{part:06d}.parquet"


def _schema(plan: Plan) -> pa.Schema:
    """Inputs, verdict, expectations, figures of merit."""
    fields: list[tuple[str, pa.DataType]] = [("run", pa.int64()), ("scenario", pa.string()), ("seed", pa.int64())]
    fields += [(one.name, pa.float64() if one.is_number else pa.string()) for one in plan.varied]
    fields += [("verdict", pa.string()), ("reason", pa.string())]
    fields += [(f"met.{name}", pa.bool_()) for name in plan.expectations]
    fields += [(name, pa.float64()) for name in MEASURED]
    return pa.schema(fields)
