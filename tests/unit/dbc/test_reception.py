"""Frames in time: jitter and losses are one sender's, a second sender and a replay are not."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dbc.contract import encode, spec_of
from dbc.e2e import COUNTER_MODULUS
from dbc.exchange import Receiver
from dbc.frame import BusName, Frame
from dbc.messages import BrakePedal
from dbc.reception import ADOPTED_CYCLES, FORGOTTEN_IN, MOST_LATE_CYCLES, SILENT_CYCLES

CYCLE_NS = 10_000_000
STEADY = MOST_LATE_CYCLES * FORGOTTEN_IN
REAL, FAKE = 0.6, 0.0


def payload(number, travel=REAL):
    return encode(BrakePedal(travel, travel), number % COUNTER_MODULUS)


class Ear:
    """A reception, and what it said of each tick: travels used as fresh, bad, foreign and doubled frames."""

    def __init__(self):
        self.receiver = Receiver([BrakePedal])
        self.reception = self.receiver.receptions[BrakePedal]
        self.used, self.bad, self.foreign, self.doubled = [], 0, 0, 0

    def hear(self, tick, *payloads):
        r, used = self.reception, []
        for data in payloads:
            before = r.last_valid_ns, r.message
            self.receiver.accept(tick * CYCLE_NS, [Frame(BusName.VEHICLE, spec_of(BrakePedal).can_id, data)])
            if r.fresh:
                used.append(r.message.pedal_travel_1)
            else:
                assert (r.last_valid_ns, r.message) == before
        if r.odd_ns == tick * CYCLE_NS:
            self.bad, self.foreign, self.doubled = self.bad + r.bad, self.foreign + r.foreign, self.doubled + r.doubled
        self.used += used
        return used

    @property
    def odd(self):
        return self.bad, self.foreign, self.doubled


@pytest.fixture
def ear():
    """In step with its sender for long enough."""
    made = Ear()
    for tick in range(40 - STEADY, 40):
        made.hear(tick, payload(tick))
    assert (len(made.used), made.odd) == (STEADY - 1, (0, 0, 0))
    return made


@example(script=[(False, 4), (True, 0), (True, 0), (True, 0), (False, 0)])
@settings(max_examples=60)
@given(st.lists(st.tuples(st.booleans(), st.integers(0, MOST_LATE_CYCLES - 1)), min_size=1, max_size=60))
def test_one_sender_with_losses_and_lateness_is_never_two(script):
    """Frames wait behind the one before, as on any line; what is older than the time-out is another matter."""
    ear, due = Ear(), 0
    arrivals = {}
    for number, (lost, late) in enumerate([(False, 0)] * 3 + script):
        due = max(due, number + late)
        if not lost:
            arrivals.setdefault(due, []).append(payload(number))
    for tick in range(max(arrivals) + 1):
        ear.hear(tick, *arrivals.get(tick, []))
    assert ear.odd[1:] == (0, 0)
    assert ear.bad == 0


@pytest.mark.parametrize("offset", range(COUNTER_MODULUS))
@pytest.mark.parametrize("first", [True, False])
def test_a_second_sender_is_seen_in_its_first_tick(ear, offset, first):
    for tick in range(40, 50):
        both = [payload(tick), payload(tick + offset, FAKE)]
        ear.hear(tick, *(both if first else reversed(both)))
        assert ear.foreign >= max(tick - 40, 1)


def test_a_second_sender_that_answers_with_the_next_counter_is_seen_when_it_speaks(ear):
    assert ear.hear(40, payload(40), payload(41, FAKE)) == [REAL, FAKE]
    assert ear.foreign == 1  # in the tick of its first frame
    for tick in range(41, 50):
        ear.hear(tick, payload(tick), payload(tick + 1, FAKE))
        assert ear.foreign >= tick - 39


@pytest.mark.parametrize("late", [2, 3, 5, 7, 12, 13, 200, 203, 1502])
def test_a_replay_is_not_used_and_the_real_stream_is_when_it_comes_back(ear, late):
    for tick in range(40, 100):
        assert ear.hear(tick, payload(tick - late, FAKE)) == []
    assert ear.foreign + ear.bad >= 55
    assert ear.hear(100, payload(100)) == [REAL] or ear.hear(101, payload(101)) == [REAL]
    assert ear.hear(102, payload(102)) == [REAL]


@pytest.mark.parametrize("late", [15, 16, 29, 195])
def test_a_replay_by_the_counters_length_and_one_more_or_less_cannot_be_seen(ear, late):
    """The stated limit of a counter 0..14."""
    for tick in range(40, 60):
        ear.hear(tick, payload(tick - late, FAKE))
    assert ear.used[-1] == FAKE


def test_a_swap_of_two_frames_is_one_foreign_frame(ear):
    assert ear.hear(40) == []
    ear.hear(41, payload(41), payload(40))
    ear.hear(42, payload(42))
    assert ear.used[-2:] == [REAL, REAL]
    assert ear.odd == (0, 1, 0)


def test_a_frame_that_comes_twice_is_neither_good_nor_bad(ear):
    in_row = ear.reception.valid_in_row
    ear.hear(40, payload(40), payload(40))
    assert ear.odd == (0, 0, 1)
    assert (ear.reception.valid_in_row, ear.reception.bad_in_row) == (in_row + 1, 0)


def test_old_bytes_are_bad_frames_and_a_counter_that_stands_still_is_foreign(ear):
    for tick in range(40, 45):
        ear.hear(tick, payload(39))
    assert ear.odd == (5, 0, 0)
    for tick in range(45, 50):
        ear.hear(tick, payload(39, FAKE))
    assert ear.odd == (5, 5, 0)
    assert FAKE not in ear.used


def test_a_sender_that_pauses_or_restarts_after_silence_is_followed(ear):
    ear.hear(60, payload(40))  # stopped for 200 ms, and went on
    ear.hear(61, payload(41))
    assert ear.used[-2:] == [REAL, REAL]
    start = 61 + SILENT_CYCLES
    ear.hear(start, payload(7))
    ear.hear(start + 1, payload(8))
    assert ear.used[-1] == REAL
    assert ear.odd == (0, 0, 0)


def test_a_receiver_that_was_stopped_reads_its_queue(ear):
    ear.hear(60, *[payload(n) for n in range(40, 61)])
    ear.hear(61, payload(61))
    assert ear.odd == (0, 0, 0)
    assert len(ear.used) == STEADY - 1 + 22


def test_what_waited_before_the_first_tick_comes_at_once():
    ear = Ear()
    ear.hear(200, *[payload(n) for n in range(200)])
    for tick in range(201, 300):
        ear.hear(tick, payload(tick - 1))
    assert ear.odd == (0, 0, 0)
    assert len(ear.used) == 199 + 99


def test_a_sender_restarted_without_silence_is_adopted_when_it_has_lived_alone_long_enough(ear):
    tick = 40
    while not ear.hear(tick, payload(tick + 7)):
        tick += 1
        assert tick < 40 + 2 * ADOPTED_CYCLES
    assert tick == 41 + ADOPTED_CYCLES


def test_a_clock_that_runs_faster_brings_a_frame_more_now_and_then():
    ear = Ear()
    for number in range(3000):
        ear.hear(round(number * 0.999), payload(number))
    assert ear.foreign <= 3
    assert len(ear.used) == 2999


def test_a_sender_of_twice_the_rate_is_seen(ear):
    for n in range(10):
        ear.hear(40 + n, payload(40 + 2 * n), payload(41 + 2 * n))
    assert ear.foreign >= 9


def test_frames_of_no_use_never_raise(ear):
    frame = Frame(BusName.VEHICLE, 160, b"")
    assert ear.hear(40, frame.data, b"\x00" * 8, b"\xff" * 8, b"\x01" * 9) == []
    assert ear.odd == (4, 0, 0)


@settings(max_examples=40)
@given(st.lists(st.integers(0, COUNTER_MODULUS - 1), min_size=1, max_size=60))
def test_counters_at_random_leave_the_senders_own_place_in_time(counters):
    ear = Ear()
    for tick in range(40 - STEADY, 40):
        ear.hear(tick, payload(tick))
    for tick, counter in enumerate(counters, 40):
        ear.hear(tick, payload(counter, FAKE))
    end = 40 + len(counters)
    back = [tick for tick in range(end, end + 4) if ear.hear(tick, payload(tick))]
    assert len(back) >= 2, "the sender itself is believed within two frames"
