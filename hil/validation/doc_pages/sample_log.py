"""The log of the tutorials: a stop of our bench with a weak brake at one wheel, as ``hil/log/samples`` has it.

``python -m hil.validation.doc_pages.sample_log`` drives it again in virtual time and writes the same bytes.
"""

import gzip
import tempfile
from pathlib import Path

from hil.bench.run import run_scenario
from hil.log.samples import SAMPLES

SCENARIO = """title = "A stop from 72 km/h with a weak brake"

[start]
speed_mps = 20.0
disc_temperature_k = 423.15

[driver]
pedal = [[0.5, 0.0], [0.8, 0.6]]

[effects.pad_mu_gain]
gain = { fl = -0.25 }

[end]
duration_s = 12.0
after_standstill_s = 0.5
"""
SEED = 11
NAME = "weak_brake"


def write(path: Path) -> None:
    """Drive and write the vehicle bus as packed candump: what a car shows, and nothing of the truth."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "weak.toml"
        scenario.write_text(SCENARIO, encoding="utf-8")
        run_scenario(
            str(scenario), "auto", out=f"{folder}/run", seed=SEED, realtime=False, command_line="", virtual=True,
            say=lambda _: None,
        )  # fmt: skip
        vehicle = [line for line in (Path(folder) / "run" / "recording.log").read_text().splitlines(keepends=True)
                   if line.split()[1] == "vehicle"]  # fmt: skip
    path.write_bytes(gzip.compress("".join(vehicle).encode("ascii"), 9, mtime=0))


if __name__ == "__main__":
    write(SAMPLES / f"{NAME}.log.gz")
