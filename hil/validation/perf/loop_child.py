"""The closed loop of one checkout, in a process of its own; started by `hil.validation.perf.loop`, run by its path.

Which checkout it is, PYTHONPATH says; so it uses only what every checkout has. It prints the folder that it found,
then for each line on stdin the processor time, us, of 10 ms of simulated time.
"""

import sys
from pathlib import Path

import hil
from hil.rt.clock import cpu_time_ns
from hil.validation.perf.loop import our_loop

TICK_NS = 10_000_000


def per_tick_us(ticks: int) -> float:
    """Processor time of one of so many ticks, us."""
    frames = our_loop(ticks * TICK_NS)
    next(frames)  # by now everything is built
    begin_ns = cpu_time_ns()
    for _ in frames:
        pass
    return (cpu_time_ns() - begin_ns) * 1e-3 / ticks


def main() -> None:
    """Answer until stdin ends."""
    per_tick_us(20)  # compile, load, fill caches
    print(Path(str(hil.__file__)).resolve().parents[1], flush=True)
    for line in sys.stdin:
        print(per_tick_us(int(line)), flush=True)


if __name__ == "__main__":
    main()
