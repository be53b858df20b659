"""What effects declare of themselves agrees with their equations, their points and the vehicle."""

import ast
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from plant.effects.catalogue import BUILT_IN
from plant.effects.effect import GROUND, NODE_LATENCY, NODES, Effect, Parameter, Scope
from plant.excitation import AT_POINT, Excitation, of_parameter, of_point
from plant.injection.apply import Q
from plant.injection.theta import THETA
from plant.injection_points import INJECTION_POINTS
from plant.parameters import PlantParameters
from plant.vectors import INPUT, OUTPUT, PARAMETER, STATE

PLANT = Path(__file__).parents[4] / "plant"
SUBSYSTEMS = ("road_air", "chassis", "tyres", "pads", "hydraulics", "motors", "sensing")
IN_MODEL = [effect for effect in BUILT_IN if not effect.sensing]
NUMBERS = [(effect, parameter) for effect in BUILT_IN for parameter in effect.strengths]


def named(effect):
    return effect.name


def called(number):
    return f"{number[0].name}.{number[1].name}"


@pytest.mark.parametrize("effect", BUILT_IN, ids=named)
def test_subsystem_is_the_package(effect):
    assert effect.subsystem in SUBSYSTEMS
    assert (PLANT / "effects" / effect.subsystem / f"{effect.name}.py").exists()
    assert effect.sensing == (effect.subsystem == "sensing")


def test_an_effect_from_outside_is_of_no_subsystem():
    def dynamic(x, u, q, k, y):
        return

    outside = Effect("mine", 0, "", "", (), Scope.CAR, (), "", "", "", dynamic=dynamic)
    assert outside.subsystem == ""
    assert outside.excitation(0) is Excitation.ALWAYS


@pytest.mark.parametrize("effect", IN_MODEL, ids=named)
def test_acts_when_its_injection_points_do_or_always(effect):
    together = Excitation(0)
    for point in effect.injection_points:
        together |= of_point(point)
    expected = {Excitation.ALWAYS} if Excitation.ALWAYS in together else {Excitation.ALWAYS, together}
    assert effect.acts_when in expected


@pytest.mark.parametrize("effect", BUILT_IN, ids=named)
def test_excitation_of_every_member(effect):
    assert not isinstance(effect.acts_when, tuple) or len(effect.acts_when) == effect.scope.size
    of_all = [effect.excitation(member) for member in range(effect.scope.size)]
    if not effect.sensing:
        assert Excitation.NONE not in of_all
    elif effect.scope is Scope.NODE:  # what is measured on the way drives a replay: brakes and motors
        assert of_all[NODES.index("pressure")] is Excitation.BRAKES
        assert of_all[NODES.index("motor")] is Excitation.MOTORS
    elif {"pressure", "motor", GROUND} & set(effect.nodes):
        assert Excitation.NONE not in of_all


def test_excitation_of_points_and_numbers():
    assert set(AT_POINT) <= set(INJECTION_POINTS)
    assert of_point("brake.torque") is of_parameter("pad_a_1_ks") is Excitation.BRAKES
    assert of_point("motor_peak_power_w") is Excitation.MOTORS
    assert of_parameter("tyre_lky") is Excitation.TURNING
    assert of_parameter("vehicle_mass_kg") is Excitation.MOVING
    assert of_point("road.grade") is Excitation.ALWAYS


@pytest.mark.parametrize("number", NUMBERS, ids=called)
def test_aliases_are_all_that_a_number_changes(number):
    effect, parameter = number
    if parameter.aliases == (NODE_LATENCY,):
        assert effect.scope is Scope.NODE
        return
    changed, beyond = moved(effect, parameter)
    assert parameter.aliases == (() if beyond else changed)


def moved(effect: Effect, parameter: Parameter):
    """Numbers of the vehicle that a strength changes, and whether it does anything else."""
    if effect.static is None or effect.dynamic or effect.rates:
        return (), True
    numbers = Q.slice("theta").start + THETA.slice(effect.name, effect.parameters[0].name).start
    results = []
    for value in (0.0, parameter.typical):
        q, y = np.zeros(Q.size), np.zeros(OUTPUT.size)
        q[: PARAMETER.size] = 10.0
        theta = THETA.neutral()
        theta[THETA.slice(effect.name, parameter.name)] = value
        q[Q.slice("theta")] = theta
        y[:] = 1.0
        getattr(effect.static, "py_func", effect.static)(q, numbers, y)
        results.append((q[: PARAMETER.size].copy(), y.copy()))
    (p, y), (p_moved, y_moved) = results
    names = tuple(name for name in PARAMETER.sizes if (p != p_moved)[PARAMETER.slice(name)].any())
    return names, bool((y != y_moved).any())


@pytest.mark.parametrize("effect", BUILT_IN, ids=named)
def test_baseline_is_a_section_of_the_parameter_set(effect):
    assert effect.baseline_section in ("", *(field.name for field in fields(PlantParameters)))


@pytest.mark.parametrize("number", NUMBERS, ids=called)
def test_a_difference_stays_within_bounds(number):
    _, parameter = number
    assert 0.0 < parameter.difference_step <= 1.0
    assert parameter.low <= parameter.neutral + parameter.step <= parameter.high
    assert parameter.step != 0.0
    assert 0.0 <= parameter.part_to_part < abs(parameter.typical)


def test_the_way_back_turns_what_goes_with_the_road():
    turned = {called(number) for number in NUMBERS if number[1].sign_along_road}
    assert turned == {"road_grade.grade", "headwind.wind_mps"}
    theta = np.arange(1.0, THETA.size + 1.0)
    back = THETA.driven_back(theta)
    where = [THETA.slice(*name.split(".")).start for name in sorted(turned)]
    assert sorted(np.flatnonzero(back != theta)) == sorted(where)
    assert np.array_equal(THETA.driven_back(back), theta)


def test_effects_know_nothing_of_what_injects_them():
    """The dependency goes one way: injection takes the effects, the model's submodels take neither."""
    submodels = [
        PLANT / f"{name}.py" for name in ("injection_points", "inject", "vectors", "brakes", "contact", "motors")
    ]
    for file in [*PLANT.joinpath("effects").rglob("*.py"), *submodels]:
        nodes = ast.walk(ast.parse(file.read_text()))
        imported = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
        above = ("plant.injection.", "plant.model", *(("plant.effects",) if file in submodels else ()))
        assert not [module for module in imported if module.startswith(above) or module == "plant.injection"], file


def _made_of(effect: Effect, parameter: Parameter, value: float) -> np.ndarray:
    """All that an effect changes, with this value of one parameter, of arbitrary inputs."""
    rng = np.random.default_rng(3)
    if effect.sensing:
        time_s, signals = np.arange(5.0), rng.uniform(1.0, 2.0, (5, 4))
        numbers = {p.name: np.full((5, p.size(effect.scope)), p.neutral) for p in effect.parameters}
        numbers[parameter.name][:] = value
        return np.concatenate([effect.sense(n, time_s, signals, numbers, {}).ravel() for n in effect.nodes])
    x, u, q, y = (rng.uniform(1.0, 2.0, size) for size in (STATE.size, INPUT.size, Q.size, OUTPUT.size))
    q[Q.slice("theta")] = THETA.neutral()
    q[Q.slice("theta")][THETA.slice(effect.name, parameter.name)] = value
    first = Q.slice("theta").start + THETA.slice(effect.name, effect.parameters[0].name).start
    if effect.static is not None:
        getattr(effect.static, "py_func", effect.static)(q, first, y)
    if effect.dynamic is not None:
        getattr(effect.dynamic, "py_func", effect.dynamic)(x, u, q, first, y)
    return np.concatenate([q[: PARAMETER.size], y])


@pytest.mark.parametrize("number", [one for one in NUMBERS if one[1].factor], ids=called)
def test_two_factors_make_their_product(number):
    effect, parameter = number
    size = 0.3 * abs(parameter.step)
    both = 3.0 * size + parameter.factor * 2.0 * size**2
    neither, one, other, product = (_made_of(effect, parameter, value) for value in (0.0, size, 2.0 * size, both))
    changed = one != neither
    assert changed.any()
    assert product[changed] * neither[changed] == pytest.approx(one[changed] * other[changed], rel=1e-9)
