"""Who is already there: a bus is listened to before the first frame is sent."""

from collections.abc import Callable, Mapping, Sequence

from dbc.frame import BusName, Frame
from hil.bus.bus import Bus, BusError
from hil.rt.clock import WallClock

LISTEN_NS = 300_000_000  # three cycles of the slowest message
_LOOK_NS = 50_000_000  # how often a stop is looked at meanwhile
_MOST_NAMED = 6
Key = tuple[BusName, int, bool]
"""Bus, identifier, and whether that has 29 bits."""


class OtherSenderError(BusError):
    """Somebody sends what we would send; said before the first frame."""


def refuse_others(
    buses: Sequence[Bus], ours: Mapping[Key, str], stopped: Callable[[], bool], who: str, instead: str
) -> None:
    """Listen for 0.3 s; what is heard meanwhile is of no further use.

    Parameters
    ----------
    buses : open; the first one gives its name to the error.
    ours : what we would send, with a name for people.
    stopped : tells whether somebody asks to stop.
    who, instead : of the error: who would send it, and what to do other than to stop the other sender.

    Raises
    ------
    OtherSenderError : somebody sends some of ``ours``; it names what.
    """
    heard: set[Key] = set()
    clock = WallClock()
    end_ns = clock.now_ns() + LISTEN_NS
    while clock.now_ns() < end_ns and not stopped():
        clock.sleep_until(clock.now_ns() + _LOOK_NS)
        for bus in buses:
            heard.update((item.bus, item.can_id, item.extended) for item in bus.receive(0.0) if isinstance(item, Frame))
    names = [ours[key] for key in sorted(heard & ours.keys(), key=lambda key: (tuple(BusName).index(key[0]), key[1:]))]
    if names:
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        raise OtherSenderError(
            f"bus {buses[0].name}: somebody already sends {', '.join(names[:_MOST_NAMED])}{more}, which {who} would "
            f"send; stop that one, take another channel, or {instead}"
        )
