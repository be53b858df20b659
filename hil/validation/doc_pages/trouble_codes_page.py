"""The page docs/trouble-codes.md: the controller's trouble codes, generated from their list and the parameter set."""

import tomllib
from collections.abc import Iterator
from importlib import resources

from dbc.messages import Fault
from ecu.law.trouble_codes import CODES, TroubleCode
from hil.validation.doc_pages.wrap import markdown

_INTRO = """# Trouble codes

What the brake controller can find wrong. Generated from `ecu/law/trouble_codes.py` and the parameter set by
`python -m hil.validation.doc_pages.trouble_codes_page`; a test holds it current.

- **Reaction** is the best mode while the code is active; the worst one of the active codes counts. A downgrade is never
  delayed. An upgrade goes one mode at a time, {upgrade_interval_s} apart, after {frames_to_upgrade} valid frames in
  a row from every source.
- **Memory**: each code once, with the times of its first and last occurrence since the controller's start, how often it
  became active (up to 255), whether it is active, and a freeze frame of its first occurrence: mode, speed, demanded
  deceleration, both pedal channels, pressures, motor currents. `EcuNode.trouble_codes` gives it. In INIT nothing is
  kept for {start_tolerated_s}: nodes may start one after the other.
- **Evidence** that does not agree with the rest adds up, and its absence takes off {forget} of its time: a fault that
  comes and goes is found, too.
- **On the bus**: `BRAKE_TROUBLE_CODE` (320, every 100 ms) tells one code after the other, number 0 where there is none;
  `BRAKE_STATUS.ACTIVE_FAULTS` shows the active ones by source.

## Frames: what is accepted, and what is not seen

A frame is used when its check value, its length, its counter and its time are right.

- Up to two frames in a row may be lost, and frames may be late and come several at once, without any code.
- A counter that leaps without time for the frames between, or goes back, is not this sender's. Such frames are refused
  until the counter is the one that is due by the cycle time (within a cycle, from the last frame or from the
  last long run of frames), or until no frame has come for 15 cycles
  (a sender that restarted), or until the new counter has lived alone for 1000 cycles.
- The same counter with other bytes, and more frames than cycles, tell of a second sender in its first tick.
- From the first foreign pedal frame on the demand does not fall: the largest of the last ticks is held. When a second
  sender or a replay is found ({foreign_frames_to_downgrade} frames, 30 ms), nobody knows whose frames are the
  driver's, and none is used: SAFE_STOP, the demand is held for {demand_hold_s}, then the brake follows its own pedal
  map. It reads the pedal by itself, so the driver brakes and releases. Another source's frames are not used either.

Not seen, by the nature of a counter 0..14 without a key:

- a replay whose age is a multiple of 15 frames, or one frame more or less (three of 15 ages; up to five more, for
  2.5 s, after the sender has started or has been late);
- one that starts after 15 cycles of silence: the silence itself has its code and its reaction, but the stream is then
  taken for a sender that restarted; a stream delayed by a pause, which goes on with the next counter, likewise;
- a sender that silences the real one and counts on in step. This is no fault but an attack; end-to-end protection is
  no security, and the two pedal channels share one frame.
"""
_HEADS = (("0x1", "Frames of each source"), ("0x2", "Each wheel"), ("0x3", "Pedal, brake, motors, link"))


def _values() -> dict[str, str]:
    """Parameters of supervision and plausibility as text."""
    source = resources.files("ecu.parameters") / "paper_ecu.toml"
    tables = tomllib.loads(source.read_text(encoding="utf-8"))
    values = {}
    for name, entry in (tables["supervision"] | tables["plausibility"]).items():
        value, unit = entry["value"], entry["unit"]
        if unit == "s":
            values[name] = f"{value:g} s" if value >= 1.0 else f"{1e3 * value:g} ms"
        else:
            values[name] = f"{value:g}"
    return values


def _row(code: TroubleCode, values: dict[str, str]) -> str:
    shows = ", ".join(f"`{fault.name}`" for fault in Fault if fault & code.fault)
    cells = (
        f"0x{code.number:04X}", f"`{code.name}`", code.text, code.reaction.name, code.debounce.format(**values),
        code.healing.format(**values), shows,
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _tables(values: dict[str, str]) -> Iterator[str]:
    for start, title in _HEADS:
        yield from ("", f"## {title}", "")
        yield "| number | name | what | reaction | debounce | healing | shows as |"
        yield "|---|---|---|---|---|---|---|"
        yield from (_row(code, values) for code in CODES if f"0x{code.number:04X}".startswith(start))


def page() -> str:
    """The page in Markdown."""
    values = _values()
    return markdown([_INTRO.format(**values).rstrip(), *_tables(values)])


if __name__ == "__main__":
    from pathlib import Path

    Path("docs/trouble-codes.md").write_text(page(), encoding="utf-8")
