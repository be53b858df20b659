"""Causes in words: signs, units, intervals, onset; every effect has words of its own."""

import pytest

from hil.diagnosis.estimation.terms import LOCATIONS
from hil.diagnosis.result.effect_phrases import PHRASES
from hil.diagnosis.result.phrases import sentence
from plant.injection.theta import THETA


def _cause(effect, location, parameters, onset=None):
    declared = THETA.effect(effect)
    entries = {
        name: {"value": value, "unit": declared.parameter(name).unit, "ci95": list(interval)}
        for name, (value, interval) in parameters.items()
    }
    return {
        "effect": effect, "title": declared.title, "location": location, "parameters": entries, "onset": onset,
        "curve": [], "variables": [], "injection_point": "",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("effect", "location", "parameters", "words"),
    [
        ("pad_mu_gain", "front", {"gain": (-0.15, (-0.18, -0.12))}, "Front pads bite 15 % less (95 %: 12 to 18 %)"),
        ("pad_mu_gain", "fl", {"gain": (0.05, (-0.01, 0.11))}, "Front left pads bite 5 % more (95 %: -1 to 11 %)"),
        ("wrong_scale", "wheel", {"gain": (2.6, (2.59, 2.61))},
         "Wheel speeds in the log are 3.6 times what they should be (95 %: 3.59 to 3.61)"),
        ("wrong_scale", "imu", {"gain": (-2.0, (-2.02, -1.98))},
         "Accelerations and yaw rate in the log are -1 times what they should be (95 %: -1.02 to -0.98)"),
        ("timestamp_offset", "imu", {"delay_s": (0.021, (0.018, 0.024))},
         "Accelerations and yaw rate are 21 ms older than their stamps (95 %: 18 to 24 ms)"),
        ("residual_drag", "rl", {"torque_nm": (30.0, (28.0, 32.0))},
         "Rear left pads drag with the brake released, 30 N m at a wheel (95 %: 28 to 32 N m)"),
        ("headwind", "car", {"wind_mps": (-5.0, (-6.0, -4.0))}, "Tailwind of 18 km/h (95 %: 14 to 22 km/h)"),
        ("pad_temp_fade", "car", {"fade_1_k": (0.002, (0.0015, 0.0025)), "start_k": (600.0, (580.0, 620.0))},
         "All pads fade when hot, by 0.20 % per K above 600 K (95 %: 0.15 to 0.25 % per K)"),
    ],
)  # fmt: skip
def test_a_cause_in_words(effect, location, parameters, words):
    assert sentence(_cause(effect, location, parameters)) == words


def test_the_onset_is_in_the_words():
    late = _cause("pad_mu_gain", "front", {"gain": (-0.15, (-0.18, -0.12))}, {"log": "run3.csv", "t_s": 41.2})
    assert sentence(late).endswith(", from 41.2 s of run3.csv on")
    assert "95 %" not in sentence(late, interval=False)


def test_every_strength_has_words_and_none_shows_a_raw_name():
    strengths = {f"{effect.name}.{one.name}": (effect, one) for effect in THETA.effects for one in effect.strengths}
    assert set(PHRASES) == set(strengths)
    for effect, one in strengths.values():
        for value in (one.typical or one.high, -(one.typical or one.high)):
            entry = {one.name: (value, (0.9 * value, 1.1 * value))}
            for location in LOCATIONS[effect.scope]:
                text = sentence(_cause(effect.name, location, entry))
                assert not {"_", "{", "}", "[", "|"} & set(text), text


def test_an_unlisted_cause_says_where_it_acts_and_what_it_depends_on():
    cause = {
        "effect": "unlisted", "title": "", "injection_point": "friction.mu", "location": "front", "parameters": {},
        "onset": None, "variables": ["pressure"], "curve": [{"x": 0.0}],
    }  # fmt: skip
    assert sentence(cause) == "An unlisted cause acts on the pad friction that acts (front) and depends on the pressure"
