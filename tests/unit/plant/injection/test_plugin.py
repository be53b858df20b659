import importlib.util
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

import hil.scenario.effects
from hil.scenario.effects import EffectError, plugin_table, read_effects
from hil.validation.doc_pages.sensitivities_figure import draw
from hil.validation.sensitivities import SHOWN, signatures
from plant.injection.theta import THETA, Theta
from plant.open_loop_manoeuvres import MANOEUVRES, drive
from plant.signals import NAMES, simulate

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def parking_brake():
    spec = importlib.util.spec_from_file_location("parking_brake", ROOT / "examples" / "parking_brake.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.EFFECT


@pytest.fixture
def installed(parking_brake, monkeypatch):
    class Point:
        name, value = "parking_brake", "parking_brake:EFFECT"

        def load(self):
            return parking_brake

    monkeypatch.setattr(
        hil.scenario.effects, "entry_points", lambda group: [Point()] if group == "brakebench.effects" else []
    )
    hil.scenario.effects.plugins.cache_clear()
    hil.scenario.effects.layout.cache_clear()
    yield parking_brake
    hil.scenario.effects.plugins.cache_clear()
    hil.scenario.effects.layout.cache_clear()


def test_the_example_brakes_the_rear_wheels(installed, paper_car):
    effects = read_effects({"parking_brake": {"torque_nm": 80.0}}, "test.toml: effects")
    plan = drive(MANOEUVRES["coast_down"], paper_car)
    free = simulate(plan)[0]
    held = simulate(plan, effects.theta, plugins=effects.plugins)[0]
    speed = NAMES.index("speed_mps")
    # 2 x 80 N m / (1 + 115/200) / 0.308 m / 1463 kg, more as the car slows
    lost = (free[100, speed] - held[100, speed]) / 1.0
    assert lost == pytest.approx(2 * 80.0 / (1 + 116 / 200) / 0.308 / 1530.0, rel=0.03)


def test_an_effect_from_outside_begins_and_ends(installed, paper_car):
    plan = drive(MANOEUVRES["coast_down"], paper_car)
    times = {"torque_nm": 80.0, "onset_s": 2.0, "until_s": 3.0}
    effects = read_effects({"parking_brake": times}, "test.toml: effects")
    free, held = simulate(plan)[0], simulate(plan, effects.theta, plugins=effects.plugins)[0]
    speed = NAMES.index("speed_mps")
    assert np.array_equal(free[:200, speed], held[:200, speed])
    late = free[310:, speed] - held[310:, speed]
    assert late.min() > 0.1
    assert np.ptp(late) < 0.05


def test_a_name_taken_twice_is_refused(parking_brake):
    with pytest.raises(ValueError, match="same name"):
        Theta((parking_brake, parking_brake))


def test_what_is_no_effect_is_refused(monkeypatch):
    point = EntryPoint("pi", "math:pi", "brakebench.effects")
    monkeypatch.setattr(hil.scenario.effects, "entry_points", lambda group: [point])
    hil.scenario.effects.plugins.cache_clear()
    with pytest.raises(EffectError, match="expected an Effect"):
        hil.scenario.effects.plugins()
    hil.scenario.effects.plugins.cache_clear()


def test_no_plugin_no_table():
    assert plugin_table(THETA).shape[0] == 0


def test_an_effect_from_outside_has_a_signature(installed, paper_car, tmp_path):
    found = signatures(drive(MANOEUVRES["coast_down"], paper_car))
    assert [s.name for s in found].count("parking_brake") == 1
    mine, drag = (next(s for s in found if s.effect.name == name) for name in ("parking_brake", "residual_drag"))
    assert found[-1] is mine
    # 60 N m at each rear wheel, mostly in the wheel speeds: as residual drag, in both rear wheels and larger
    assert mine.total > 10.0 * SHOWN
    assert set(np.array(NAMES)[np.argsort(mine.sizes)[-5:]]) >= {f"wheel_speed_{w}_rad_s" for w in ("rl", "rr")}
    assert mine.total > drag.total
    draw("with a parking brake", found, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000
