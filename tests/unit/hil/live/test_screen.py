"""What the terminal shows, drawn to text."""

import io

import pytest

console_of = pytest.importorskip("rich.console").Console

from dbc.contract import spec_of  # noqa: E402
from dbc.database import parse_database  # noqa: E402
from dbc.e2e import protect  # noqa: E402
from dbc.frame import BusName, Frame, LinkEvent, LinkState  # noqa: E402
from dbc.messages import BrakeMode, BrakeStatus, BrakeTroubleCode  # noqa: E402
from hil.live.feed import Feed  # noqa: E402
from hil.live.screen import Screen  # noqa: E402
from hil.log.signals.databases import Databases  # noqa: E402

CAR = {"wheel_radius_m": 0.3, "torque_constant_nm_a": 1.5}
MS = 1_000_000
STRANGE = """VERSION ""
BU_: A
BO_ 256 STRANGE: 2 A
 SG_ S : 0|16@1+ (0.5,0) [0|0] "km/h" A
BO_ 257 OTHER: 1 A
 SG_ T : 0|8@1+ (1,0) [0|0] "" A
"""


def drawn(screen, now_ns, width=80, height=None):
    stream = io.StringIO()
    console = console_of(file=stream, width=width, height=height or 100, highlight=False)
    console.print(screen.drawn(now_ns, width, height))
    return stream.getvalue().splitlines()


def frame(message, counter, at_ns):
    spec = spec_of(type(message))
    return Frame(spec.bus, spec.can_id, spec.encode(message, counter), at_ns)


def values(kind, **given):
    return kind(**{name: given.get(name, 0) for name in kind._fields})


@pytest.fixture
def screen():
    return Screen(Feed(Databases.own(), Databases.own()), CAR, {0x1001: "pedal_lost"}, "loopback:a")


def full(screen):
    """Every message of ours once, all bytes zero but for a sound protection."""
    for place, live in enumerate(screen.feed.messages):
        data = bytes(live.message.length)
        if live.checker is not None:
            data = protect(live.message.e2e_data_id, bytearray(data), 0)
        screen.feed.hear([Frame(BusName(live.bus), live.can_id, data, (place + 1) * MS)])


@pytest.mark.parametrize("width", [40, 60, 80, 120])
@pytest.mark.parametrize("height", [10, 24, 50])
def test_it_fits_and_counts_what_has_no_room(screen, width, height):
    full(screen)
    lines = drawn(screen, 100 * MS, width, height)
    assert len(lines) <= height
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    listed = sum(message.name[:20] in text for message in screen.feed.messages)
    count = len(screen.feed.messages)
    assert (f"{count - listed} more" in text) == (listed < count)


def test_mode_and_codes_come_from_the_bus(screen):
    screen.feed.hear([frame(values(BrakeStatus, mode=BrakeMode.DEGRADED), 0, MS)])
    assert drawn(screen, 2 * MS)[0].startswith(" DEGRADED ")
    screen.feed.hear(
        [frame(values(BrakeTroubleCode, trouble_code=0x1001, stored_codes=1, occurrences=3, status=1), 0, 3 * MS)]
    )
    text = "\n".join(drawn(screen, 4 * MS))
    assert "1001 pedal_lost" in text
    assert "3 times" in text


def test_a_message_that_is_late_or_unsound_stands_first(screen):
    full(screen)
    broken = screen.feed.messages[3]
    data = bytearray(protect(broken.message.e2e_data_id, bytearray(broken.message.length), 1))
    data[-1] ^= 1
    screen.feed.hear([Frame(BusName(broken.bus), broken.can_id, bytes(data), 20 * MS)])
    lines = drawn(screen, 5_000 * MS, 60)
    at = next(i for i, line in enumerate(lines) if line.startswith("message"))
    assert lines[at + 1].split() == [broken.name, lines[at + 1].split()[1], "crc"]
    assert lines[at + 2].rstrip().endswith("s ago")


def test_a_silent_bus_is_told(screen):
    lines = drawn(screen, MS)
    assert lines[-1].rstrip() == "nothing has come on the buses yet"
    assert "loopback:a" in lines[0]


def test_link_events_are_told(screen):
    screen.feed.hear([LinkEvent(BusName.VEHICLE, LinkState.BUS_OFF, 0, 1, "no such [bold]device\x1b[2J")])
    text = "\n".join(drawn(screen, MS))
    assert "no such [bold]device" in text
    assert "\x1b" not in text


def test_another_cars_bus_has_messages_and_no_wheels():
    feed = Feed(Databases.joined([parse_database(STRANGE)], {}), Databases.own())
    feed.hear([Frame(BusName.VEHICLE, 256, b"\0\1", MS), Frame(BusName.VEHICLE, 0x777, b"", 2 * MS)])
    lines = drawn(Screen(feed, None, {}, "vcan0"), 3 * MS)
    assert "wheel" not in "".join(lines)
    assert [line.split()[0] for line in lines[2:3]] == ["STRANGE"]
    assert "0x777" in "".join(lines)
