"""Numbers measured so far, kept on file: what was driven once is not driven again."""

import hashlib
import json
from pathlib import Path

from hil.errors import BrakebenchError
from hil.validation.reproduce.cases import Numbers
from plant.compiled import PACKAGES, digest

Job = tuple[str, int, int]  # case, number of the condition, seed


class Store:
    """One line of JSON for each job, behind a line that names the sources they were measured with.

    Parameters
    ----------
    path : file to go on with (made where there is none); None keeps nothing beyond this run.
    extension : file of the car that is driven beside the nominal one, see `hil.validation.reproduce.study.measure`.

    Raises
    ------
    BrakebenchError
        Where the file cannot be used: no such store, or numbers of other sources.
    """

    def __init__(self, path: Path | None = None, extension: Path | None = None) -> None:
        self.numbers: dict[Job, Numbers] = {}
        self._path = path
        if path is None:
            return
        stamp = {"sources": sources()}
        if extension is not None:
            stamp["extension"] = hashlib.sha256(extension.read_bytes()).hexdigest()[:16]
        try:
            if not path.exists():
                path.write_text(json.dumps(stamp) + "\n", encoding="utf-8")
            text = path.read_text(encoding="utf-8")
        except OSError as error:
            raise BrakebenchError(f"{path}: cannot be used ({error.strerror}); give another file") from error
        whole = text[: text.rfind("\n") + 1]  # a run that was killed may have left half a line
        try:
            head, *lines = [json.loads(line) for line in whole.splitlines()]
            self.numbers = {(case, k, seed): numbers for case, k, seed, numbers in lines}
        except (ValueError, TypeError) as error:
            raise BrakebenchError(f"{path}: is no file of measured numbers ({error}); give another") from error
        if head != stamp:
            raise BrakebenchError(
                f"{path}: was measured with other sources ({head} here {stamp}); delete it or give another file"
            )
        if len(whole) < len(text):
            path.write_text(whole, encoding="utf-8")

    def add(self, job: Job, numbers: Numbers) -> None:
        """Take the numbers of one job."""
        self.numbers[job] = numbers
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps([*job, numbers]) + "\n")


def sources() -> str:
    """Digest of all that decides the numbers: contract, controller, plant, and the cases here."""
    measured = ("ecu", "ecu.law", "ecu.law.joint", "ecu.parameters", *PACKAGES, "hil.rt", "hil.validation.reproduce")
    return digest(("dbc", *measured), (".py", ".toml", ".dbc"))[:16]
