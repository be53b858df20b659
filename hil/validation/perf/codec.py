"""The compiled codec beside cantools, over all messages of brake.dbc."""

from collections.abc import Callable
from typing import Any

from dbc.contract import Message, contract
from dbc.frame import BusName
from hil.bench.virtual import simulate
from hil.rt.clock import cpu_time_ns
from hil.scenario.scenario import load_scenario
from hil.validation.perf.cantools_codec import database, dbc_values, protected
from hil.validation.perf.row import Progress, Row, paired, unseen

REPEATS = 30
PAIRS = 15


def payloads() -> dict[int, list[bytes]]:
    """Frames of a stop by identifier: the values that really travel."""
    scenario = load_scenario("stop72_blend70")
    frames = simulate(scenario).decoded.recording.frames
    own = frames.channel == frames.channels.index(BusName.VEHICLE.value)
    found: dict[int, list[bytes]] = {}
    for can_id in contract(BusName.VEHICLE).by_id:
        rows = (own & (frames.can_id == can_id)).nonzero()[0]
        chosen = rows[len(rows) // 8 : len(rows) * 3 // 4 : max(1, len(rows) // 12)]
        found[can_id] = [frames.data[row, : frames.length[row]].tobytes() for row in chosen]
    return found


def measure(progress: Progress = unseen) -> list[Row]:
    """Processor time of one frame, encoded and decoded, microseconds; the values are those of a blended stop."""
    specs = contract(BusName.VEHICLE).by_id
    cases: list[tuple[Any, Any, Message, dict[str, Any], bytes]] = []
    for can_id, frames in payloads().items():
        theirs = database(BusName.VEHICLE).get_message_by_frame_id(can_id)
        for data in frames:
            message = specs[can_id].decode(data)
            cases.append((specs[can_id], theirs, message, dbc_values(specs[can_id], message), data))

    def each(one: Callable[[Any, Any, Message, dict[str, Any], bytes], object]) -> Callable[[], float]:
        def timed() -> float:
            begin = cpu_time_ns()
            for _ in range(REPEATS):
                for case in cases:
                    one(*case)
            return (cpu_time_ns() - begin) / (REPEATS * len(cases)) * 1e-3

        return timed

    encode = paired(
        "encode and protect a frame",
        each(lambda spec, _theirs, message, _values, _data: spec.encode(message, 7)),
        each(lambda spec, theirs, _message, values, _data: protected(spec, theirs.encode(values), 7)),
        "cantools, then protected",
        "us",
        pairs=PAIRS,
    )
    progress(0.5)
    decode = paired(
        "decode a frame",
        each(lambda spec, _theirs, _message, _values, data: spec.decode(data)),
        each(lambda _spec, theirs, _message, _values, data: theirs.decode(data, decode_choices=False)),
        "cantools, choices left as numbers",
        "us",
        pairs=PAIRS,
    )
    return [encode, decode]
