"""What is measured for one seed under one condition: each case drives what it needs and returns named numbers."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dbc.bench_messages import PhysicalFault
from ecu.parameters.ecu import EcuParameters
from hil.scenario.effects import NONE, Effects
from hil.scenario.parameters import override
from hil.validation.reproduce import manoeuvres
from hil.validation.reproduce.conditions import BRAKE, Condition
from hil.validation.reproduce.runs import Fault, Run, Vector, drive, ecu_parameters, plant_parameters
from plant.manoeuvre import Manoeuvre
from plant.parameters.plant import PlantParameters
from plant.vehicle import GRAVITY_MPS2

ALPHAS = (0.0, 0.3, 0.5, 0.7)
ESTIMATION_ALPHAS = (0.0, 0.5, 0.7)
PADS = {"pads -25 %": 0.75, "pads nominal": 1.0, "pads +25 %": 1.25}
WEAK = 0.7
SHIFT_ALPHA = 0.5
SLOWEST_MPS = 1.5
SETTLED_S = 0.8
ADAPTED = 0.10
Numbers = dict[str, float]


def method(name: str = "joint", road: bool = True, enabled: bool = True) -> EcuParameters:
    """The controller with an observer: ``joint`` (our default) or ``paper``."""
    change = {"method": name, "road_correction": road, "enabled": enabled}
    return override(ecu_parameters(), {"compensation": change}, "reproduction")


def with_pads(plant: PlantParameters, factor: float) -> PlantParameters:
    """The plant with the friction of its pads scaled."""
    return override(plant, {"pad": {"a_1_ks": plant.pad.a_1_ks * factor}}, "pads")


def ideal(manoeuvre: Manoeuvre, plant: PlantParameters, seed: int, alpha: float, effects: Effects = NONE) -> Run:
    """The run without disturbance: same car and actuators, brake exactly nominal, mass and radius known exactly."""
    nominal, ecu = plant_parameters(), method(enabled=False)
    pads = replace(plant.pad, a_1_ks=0.0, b_1_j=0.0)  # the friction stays at its start value
    radius_m = plant.wheel.rolling_radius_m * (1.0 + float(effects.number("tyre_radius", "gain").mean()))
    known = {"mass_kg": plant.vehicle.mass_kg + float(effects.number("mass_offset", "mass_kg")[0])}
    known |= dict.fromkeys(("rolling_radius_m", "force_arm_m"), radius_m)
    knows = override(ecu, {"vehicle": known, "joint_filter": {"start_mass": 1e-5}}, "ideal")
    manoeuvre = replace(manoeuvre, initial_pad_friction=ecu.friction_brake.pad_friction)
    car = replace(plant, pad=pads, friction_brake=nominal.friction_brake)
    return drive(manoeuvre, car, knows, seed, alpha, effects=effects.without(*BRAKE))


def onset(run: Run, after_s: float = 0.0) -> int:
    """First sample with a demand."""
    return int(np.flatnonzero((run.demanded_mps2 > 0.05) & (run.time_s >= after_s))[0])


def braking(run: Run) -> NDArray[np.intp]:
    """Indices from the first demand to `SLOWEST_MPS`."""
    first = onset(run)
    return np.flatnonzero((np.arange(run.time_s.size) >= first) & (run.speed_mps > SLOWEST_MPS))


def rms(values: Vector) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def estimation(condition: Condition, seed: int) -> Numbers:
    """Figures 9 and 11: wheel torque and pad friction of the front left wheel, and the worst wheel."""
    out: Numbers = {}
    plant = condition.plant(plant_parameters(), seed)
    driven = partial(drive, effects=condition.effects)
    true = np.repeat(condition.friction, 2)
    for name in ("joint", "paper"):
        for alpha in ESTIMATION_ALPHAS:
            run = driven(manoeuvres.stop(condition.road()), plant, method(name), seed, alpha)
            k = braking(run)
            error = run.estimated_torque_nm[k] - run.wheel_torque_nm[k]
            share = [rms(error[:, w]) / np.abs(run.wheel_torque_nm[k, w]).mean() for w in range(4)]
            out[f"{name} torque {alpha:g}"] = 100.0 * share[0]
            out[f"{name} torque Nm {alpha:g}"] = rms(error[:, 0])
            if condition.tells_friction:
                friction = run.estimated_friction[k] / (run.pad_friction[k] * true) - 1.0
                out[f"{name} friction {alpha:g}"] = 100.0 * rms(friction[:, 0])
                out[f"{name} friction worst {alpha:g}"] = 100.0 * max(rms(friction[:, w]) for w in range(4))
    return out


def patch(condition: Condition, seed: int) -> Numbers:
    """Figure 10: eight metres of friction 0.2 in the stop, with and without the correction for the road."""
    plant = condition.plant(plant_parameters(), seed)
    driven = partial(drive, effects=condition.effects)
    dry = driven(manoeuvres.stop(condition.road()), plant, method(), seed)
    start_m = float(np.cumsum(dry.speed_mps)[onset(dry)]) * 0.01 + manoeuvres.PATCH_AFTER_M
    road = condition.road(((start_m, manoeuvres.PATCH_FRICTION), (start_m + manoeuvres.PATCH_LENGTH_M, 1.0)))
    out: Numbers = {}
    for name in ("joint", "paper"):
        error: dict[bool, float] = {}
        for corrected in (True, False):
            run = driven(manoeuvres.stop(road), plant, method(name, road=corrected), seed)
            k = braking(run)
            off = np.abs(run.estimated_torque_nm[k, 0] - run.wheel_torque_nm[k, 0])
            error[corrected] = rms(off)
            if corrected:
                entered = np.cumsum(run.speed_mps)[k] * 0.01 > start_m
                far = np.flatnonzero(off[entered] > ADAPTED * np.abs(run.wheel_torque_nm[k, 0]).mean())
                out[f"{name} adaptation"] = 10.0 * far.size
        out[f"{name} patch"] = error[True]
        out[f"{name} patch off"] = error[False]
        out[f"{name} cut"] = 100.0 * (1.0 - error[True] / error[False])
    return out


def torque_error(run: Run, best: Run) -> float:
    """Torque of all wheels against the ideal run's after the onset, % of its mean (Figures 12 and 13)."""
    a, b = onset(run), onset(best)
    n = min(run.time_s.size - a, best.time_s.size - b)
    settled = np.arange(n) * 0.01 > SETTLED_S
    settled &= (run.speed_mps[a : a + n] > SLOWEST_MPS) & (best.speed_mps[b : b + n] > SLOWEST_MPS)
    mine, its = (r.wheel_torque_nm[i : i + n].sum(axis=1)[settled] for r, i in ((run, a), (best, b)))
    return 100.0 * rms(mine - its) / float(np.abs(its).mean())


def compensation(condition: Condition, seed: int) -> Numbers:
    """Figures 12 and 13: torque error with and without compensation, four blending factors, three sets of pads."""
    out: Numbers = {}
    plant = condition.plant(plant_parameters(), seed)
    driven = partial(drive, effects=condition.effects)
    manoeuvre = manoeuvres.stop(condition.road())
    for alpha in ALPHAS:
        best = ideal(manoeuvre, plant, seed, alpha, condition.effects)
        for name, factor in PADS.items():
            pads = with_pads(plant, factor)
            without = torque_error(driven(manoeuvre, pads, method(enabled=False), seed, alpha), best)
            out[f"without {name} {alpha:g}"] = without
            for prefix, observer in (("", "joint"), ("paper ", "paper")):
                if observer == "paper" and alpha not in (0.0, 0.7):
                    continue
                error = torque_error(driven(manoeuvre, pads, method(observer), seed, alpha), best)
                out[f"{prefix}with {name} {alpha:g}"] = error
                out[f"{prefix}cut {name} {alpha:g}"] = 100.0 * (1.0 - error / without)
                out[f"{prefix}worse {name} {alpha:g}"] = error - without
        for prefix in ("", "paper ") if alpha in (0.0, 0.7) else ("",):
            out[f"{prefix}worst {alpha:g}"] = max(out[f"{prefix}worse {name} {alpha:g}"] for name in PADS)
    return out


def slopes(run: Run) -> list[float]:
    """Slope of deceleration over demanded deceleration of each braking of a series, through zero."""
    result = []
    for start in manoeuvres.SERIES_AT_S:
        k = (run.time_s > start + SETTLED_S + 0.5) & (run.time_s < start + manoeuvres.PULSE_S)
        d, a = run.demanded_mps2[k], -run.acceleration_mps2[k]
        result.append(float(d @ a / (d @ d)))
    return result


def series(condition: Condition, seed: int) -> Numbers:
    """Figures 14 and 15: slope of deceleration over pedal at each stop, against the ideal run's, %."""
    out: Numbers = {}
    plant = condition.plant(plant_parameters(), seed)
    driven = partial(drive, effects=condition.effects)
    manoeuvre = manoeuvres.series(condition.road())
    for alpha in (0.0, 0.7):
        best = slopes(ideal(manoeuvre, plant, seed, alpha, condition.effects))
        for name in ("joint", "paper"):
            worst = np.zeros(3)
            for factor in (0.8, 1.25):
                pads = with_pads(plant, factor)
                mine = slopes(driven(manoeuvre, pads, method(name), seed, alpha))
                worst = np.maximum(worst, np.abs(np.array(mine) / np.array(best) - 1.0))
            out[f"{name} stop 1 {alpha:g}"] = 100.0 * float(worst[0])
            out[f"{name} later {alpha:g}"] = 100.0 * float(worst[1:].max())
    return out


def dips(run: Run, from_s: float, grade: float = 0.0) -> Numbers:
    """How far deceleration fell below demand after a fault, m/s2, for how long, ms, and the speed lost by it, m/s.

    What the hill brakes is the driver's, not the pedal's.
    """
    k = (run.time_s >= from_s) & (run.time_s < from_s + 1.5) & (run.speed_mps > SLOWEST_MPS)
    before = (run.time_s >= from_s - 0.3) & (run.time_s < from_s)
    lack = run.demanded_mps2 + run.acceleration_mps2 + GRAVITY_MPS2 * grade
    dip = lack[k]
    return {
        "depth": float(dip.max()),
        "above 1.0": 10.0 * float((dip > 1.0).sum()),
        "above 0.3": 10.0 * float((dip > 0.3).sum()),
        "lost": float(np.maximum(dip - lack[before].mean(), 0.0).sum()) * 0.01,
    }


def failures(condition: Condition, seed: int) -> Numbers:
    """Motors lost and battery full in the middle of a stop at alpha 0.7."""
    out: Numbers = {}
    plant = condition.plant(plant_parameters(), seed)
    driven = partial(drive, effects=condition.effects)
    at = manoeuvres.FAULT_AT_S
    for name, wheels in (("one", 0b0001), ("axle", 0b0011), ("all", 0b1111)):
        fault = Fault(PhysicalFault.MOTOR_DEAD, wheels, at)
        run = driven(manoeuvres.stop(condition.road()), plant, method(), seed, 0.7, (fault,))
        out |= {f"{name} {key}": value for key, value in dips(run, at, condition.grade).items()}
    at += 0.01 * (seed % 10)  # the battery speaks every 0.1 s: any moment between
    refuses = Fault(PhysicalFault.BATTERY_REFUSES_CHARGE, 0, at)
    for name, vehicle in (("announced", plant), ("at once", without_notice(plant))):
        run = driven(manoeuvres.stop(condition.road()), vehicle, method(), seed, 0.7, (refuses,))
        out |= {f"{name} {key}": value for key, value in dips(run, at, condition.grade).items()}
    run = driven(full_battery(condition), small_battery(plant), method(), seed, 0.7)
    out["full depth"] = dips(run, run.time_s[onset(run)] + SETTLED_S, condition.grade)["depth"]
    return out


def small_battery(plant: PlantParameters) -> PlantParameters:
    """The plant with a battery so small that one stop fills it."""
    return replace(plant, battery=replace(plant.battery, capacity_j=2e6))


def without_notice(plant: PlantParameters) -> PlantParameters:
    """The plant with a battery that enforces its limits as it announces them."""
    return replace(plant, battery=replace(plant.battery, notice_s=0.0))


def full_battery(condition: Condition) -> Manoeuvre:
    """The stop that fills `small_battery`: charge power tapers off while the car brakes."""
    return manoeuvres.stop(condition.road(), state_of_charge=0.99)


def weak_pads(condition: Condition, seed: int) -> Numbers:
    """Pads x0.7, two stops: error of the estimate in the first, deceleration of the second, with and without."""
    plant = with_pads(condition.plant(plant_parameters(), seed), WEAK)
    driven = partial(drive, effects=condition.effects)
    out: Numbers = {}
    true = np.repeat(condition.friction, 2)
    for name, ecu in (("with", method()), ("paper", method("paper")), ("without", method(enabled=False))):
        run = driven(manoeuvres.two_stops(condition.road()), plant, ecu, seed)
        second = onset(run, manoeuvres.STOP_AT_S + 10.0)
        k = slice(second + 60, second + 460)
        hill = GRAVITY_MPS2 * condition.grade  # as in `dips`
        braked = float(np.mean(-run.acceleration_mps2[k])) - hill
        reached = 100.0 * (braked / float(np.mean(run.demanded_mps2[k])) - 1.0)
        out[f"{name} second"] = abs(reached)
        if condition.tells_friction:
            first = onset(run)
            at = slice(first + 150, first + 430)
            error = run.estimated_friction[at] / (run.pad_friction[at] * true) - 1.0
            out[f"{name} estimate"] = 100.0 * float(np.abs(error.mean(axis=0)).max())
    return out


def unshifted() -> EcuParameters:
    """The controller that leaves the blending factor as it was asked, however weak the pads."""
    return override(method(), {"compensation": {"motor_preference": 0.0}}, "no shift")


def shift(condition: Condition, seed: int) -> Numbers:
    """Work moved to the motors where the pads are weak: a series at alpha 0.5, pads x0.7, with and without it.

    Without it the blending factor stays what was asked; the compensation works in both.
    """
    plant = with_pads(condition.plant(plant_parameters(), seed), WEAK)
    driven = partial(drive, effects=condition.effects)
    manoeuvre = manoeuvres.series(condition.road())
    best = slopes(ideal(manoeuvre, plant, seed, SHIFT_ALPHA, condition.effects))
    controllers = (("", method()), ("no ", unshifted()))
    runs = {name: driven(manoeuvre, plant, ecu, seed, SHIFT_ALPHA) for name, ecu in controllers}
    out: Numbers = {}
    for name, run in runs.items():
        rise = run.disc_temperature_k[:, 0] - run.disc_temperature_k[0, 0]
        out[f"{name}shift heat"] = float(run.friction_heat_j[-1] - run.friction_heat_j[0])
        out[f"{name}shift recuperated"] = float(run.recuperated_j[-1] - run.recuperated_j[0])
        out[f"{name}shift rise"] = float(rise.max())
        out[f"{name}shift friction"] = float(run.pad_friction[:, 0].min())
        off = np.abs(np.array(slopes(run)) / np.array(best) - 1.0)
        out[f"{name}shift slope"] = 100.0 * float(off[1:].max())
    for key in ("heat", "rise"):
        out[f"{key} saved"] = 100.0 * (1.0 - out[f"shift {key}"] / out[f"no shift {key}"])
    return out


CASES: dict[str, Callable[[Condition, int], Numbers]] = {
    "estimation": estimation,
    "patch": patch,
    "compensation": compensation,
    "series": series,
    "failures": failures,
    "weak pads": weak_pads,
    "shift": shift,
}
