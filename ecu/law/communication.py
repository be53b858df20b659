"""How far the stream of frames of each source is believed: rates of bad frames, second senders, replays.

Each stream has levels that bad frames raise by more than good ones lower them, so that no pattern of faults in between
good frames resets them: they rise for ever where the share of bad frames is above 1 / (1 + weight). A stream that is
not believed is believed again after a time without any odd frame.
"""

from collections.abc import Sequence
from typing import NamedTuple

from ecu.law.types import OTHERS_WELL, Health, Source
from ecu.parameters.control import SupervisionParameters


class Stream(NamedTuple):
    """What is held against one stream.

    ``bad``, ``foreign``, ``doubled``: levels; ``clean_s``: time since its last odd frame. What was found:
    ``corrupted``: its rate of bad frames is too high; ``second_sender``; ``out_of_time``: its counter is not the one
    that is due.
    """

    bad: int
    foreign: int
    doubled: int
    clean_s: float
    corrupted: bool
    second_sender: bool
    out_of_time: bool

    @property
    def suspect(self) -> bool:
        """Frames came that it cannot have sent, be it too few for a verdict."""
        return self.foreign > 0

    @property
    def foreign_found(self) -> bool:
        """Whose frames these are is not known: none of them is used."""
        return self.second_sender or self.out_of_time


Streams = tuple[Stream, ...]
CLEAN = Stream(0, 0, 0, 0.0, False, False, False)
ALL_CLEAN: Streams = (CLEAN,) * len(Source)


def judge_streams(
    streams: Streams, health: Sequence[Health], timed_out: Sequence[bool], p: SupervisionParameters, dt_s: float
) -> Streams:
    """Advance what is held against each stream by one tick (order of `Source`); the same object where nothing is."""
    if streams is ALL_CLEAN:
        last = health[-1]
        well = not (last.bad or last.foreign or last.doubled)
        if well and (health[:-1] == OTHERS_WELL or not any(h.bad or h.foreign or h.doubled for h in health)):
            return streams
    judged = tuple([_judge(stream, h, out, p, dt_s) for stream, h, out in zip(streams, health, timed_out, strict=True)])
    return ALL_CLEAN if judged == ALL_CLEAN else judged


def _judge(stream: Stream, h: Health, timed_out: bool, p: SupervisionParameters, dt_s: float) -> Stream:
    odd = h.bad or h.foreign or h.doubled
    if stream is CLEAN and not odd:
        return stream
    # foreign frames of one tick count as one: a node that was late may bring all of them at once
    bad_limit = p.bad_frame_weight * p.bad_frames_to_downgrade
    foreign_limit = p.foreign_frame_weight * p.foreign_frames_to_downgrade
    bad = _level(stream.bad, p.bad_frame_weight * h.bad, h.fresh, bad_limit)
    foreign = _level(stream.foreign, p.foreign_frame_weight * min(h.foreign, 1), h.fresh, foreign_limit)
    doubled = _level(stream.doubled, min(h.doubled, 1), h.fresh, foreign_limit)
    clean_s = 0.0 if odd or timed_out else stream.clean_s + dt_s
    healed = clean_s >= p.communication_healing_s
    corrupted = bad >= bad_limit or (stream.corrupted and not (healed and bad == 0))
    second_sender, out_of_time = stream.second_sender, stream.out_of_time
    if foreign >= foreign_limit and not (second_sender or out_of_time):
        # both streams go on, or one in another's place
        second_sender, out_of_time = not timed_out, timed_out
    elif doubled >= foreign_limit:
        second_sender = True
    elif healed and foreign == 0 and doubled == 0:
        second_sender = out_of_time = False
    if healed and not (bad or foreign or doubled):
        return CLEAN
    return Stream(bad, foreign, doubled, clean_s, corrupted, second_sender, out_of_time)


def _level(level: int, rise: int, fresh: bool, limit: int) -> int:
    return min(level + rise, 2 * limit) if rise else max(level - fresh, 0)
