"""How finely a recording is stepped through: a stop, a pressure that holds the car, a start."""

import numpy as np

from hil.diagnosis.data.log import make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.simulation.substeps import STEPS, rows_per_step

WHEELS = ("fl", "fr", "rl", "rr")
BRAKES, STOPS, LEAVES, END = 4.0, 9.0, 20.0, 26.0


def _paces():
    """At the rows of 10 ms of 26 s: coasts, brakes from 4 s, stands from 9 s, drives off at 20 s."""
    t = np.arange(round(END / 0.01)) * 0.01
    speed = np.where(t < BRAKES, 15.0, np.clip(15.0 - 3.0 * (t - BRAKES), 0.0, None)) + np.clip(t - LEAVES, 0.0, None)
    braking = (t > BRAKES) & (t < LEAVES - 1.0)
    channels = {f"wheel_speed_{w}_rad_s": speed / 0.308 for w in WHEELS}
    channels |= {f"pressure_{w}_pa": 15e5 * braking for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": 15e5 * braking for w in WHEELS}
    (recording,) = prepare([make_log("log", t, channels)], 0.308).recordings
    return rows_per_step(recording)


def test_steps_are_short_where_something_is_quick_and_long_elsewhere():
    pace = _paces()

    def within(begin_s, end_s):
        return set(pace[round(begin_s / 0.01) : round(end_s / 0.01)])

    assert within(0.5, 3.9) == {STEPS}
    assert within(BRAKES, BRAKES + 0.11) == {1}
    assert within(BRAKES + 0.13, BRAKES + 0.19) == {STEPS // 2}
    assert within(5.0, 7.5) == {STEPS}
    assert within(8.2, STOPS + 2.8) == {STEPS // 2}  # creeps, and rings on its brakes
    assert within(STOPS + 3.2, 18.5) == {STEPS}  # stands; where a simulated car still rolls the plant's are shorter
    assert within(LEAVES + 0.1, LEAVES + 2.5) == {STEPS // 2}
    assert within(LEAVES + 3.5, END - 0.5) == {STEPS}
