"""The paper's result figures, each as a report of its own (file name -> report)."""

import numpy as np

from ecu.law import paper_observer
from ecu.law.base_brake import reference_deceleration
from ecu.law.joint import layout
from hil.identify.summary import figures as identified
from hil.report.report import Chart, Curve, Number, Panel, Report, Section, Style, Trace
from hil.report.units import KMH, KN
from hil.validation.reproduce import manoeuvres
from hil.validation.reproduce.beyond import SEED, battery_refuses, motor_failure, nominal_plant, work_moved
from hil.validation.reproduce.cases import (
    ALPHAS,
    braking,
    ideal,
    method,
    onset,
    torque_error,
)
from hil.validation.reproduce.conditions import NOMINAL
from hil.validation.reproduce.identification import shipped_study
from hil.validation.reproduce.runs import Run, Vector, drive, ecu_parameters
from plant.manoeuvre import Manoeuvre

UNDER, OVER = 0.8, 1.25  # friction of the pads over what the controller believes


def figures() -> dict[str, Report]:
    """Return all figures; each drives its own runs."""
    study = shipped_study()
    return {
        "figure2_pedal_map.png": pedal_map(),
        **identified(study),
        "figure9_wheel_torque.png": wheel_torque(),
        "figure10_slippery_patch.png": slippery_patch(),
        "figure11_pad_friction.png": pad_friction(),
        "figure12_compensation.png": compensation(),
        "figure13_blending.png": blending(),
        "figure14_series.png": series(0.0, "Figure 14"),
        "figure15_series_blending.png": series(0.7, "Figure 15"),
        "motor_failure.png": motor_failure(),
        "battery_refuses.png": battery_refuses(),
        "work_moved_to_motors.png": work_moved(),
    }


def _stop(name: str = "joint", alpha: float = 0.0, pads: float = 1.0, enabled: bool = True) -> Run:
    return drive(manoeuvres.stop(NOMINAL.road()), nominal_plant(pads), method(name, enabled=enabled), SEED, alpha)


def _window(run: Run, before_s: float = 0.3) -> slice:
    return slice(max(onset(run) - round(before_s / 0.01), 0), int(braking(run)[-1]) + 1)


def _since(run: Run) -> Vector:
    return np.asarray(run.time_s - run.time_s[onset(run)])


def _style(name: str) -> Style:
    return "demand" if name == "ideal" else "line"


def pedal_map() -> Report:
    """Figure 2: reference deceleration over pedal travel."""
    travel = np.linspace(0.0, 1.0, 201)
    pedal = ecu_parameters().pedal
    a = np.array([reference_deceleration(s, pedal) for s in travel])
    at = reference_deceleration(manoeuvres.PEDAL, pedal)
    curves = (Curve("reference", travel, a), Curve("60 % travel", np.array([0.6]), np.array([at]), style="points"))
    chart = Chart("Reference deceleration map", "pedal travel", "1", "deceleration", "m/s2", curves)
    reason = "The paper prints its map as an image; this one is a progressive choice with 3.2 m/s2 at 60 % travel."
    return Report("Figure 2: pedal map", reason=reason, sections=(Section("Map", charts=(chart,)),))


def _kinematics(run: Run, k: slice, t: Vector, limit: float = 1.0) -> tuple[Panel, ...]:
    speed = Panel(
        "Speed",
        KMH,
        (Trace("vehicle", t, run.speed_mps[k]), Trace("estimated", t, run.estimated_speed_mps[k], "estimate")),
    )
    a = Panel(
        "Acceleration",
        "m/s2",
        (Trace("vehicle", t, run.acceleration_mps2[k]), Trace("demanded", t, -run.demanded_mps2[k], "demand")),
    )
    return speed, a


def _forces(runs: dict[str, Run]) -> tuple[Panel, Panel]:
    """Force and torque of the front left wheel: simulated, virtual sensor, both observers."""
    paper, joint = runs["paper"], runs["joint"]
    k = _window(joint)
    t = _since(joint)[k]
    s = paper.observer[k]
    sensor = s[:, paper_observer.K] * s[:, paper_observer.MODEL_FORCE]
    force = Panel("Longitudinal force, front left", KN, (
        Trace("simulated", t, joint.force_n[k, 0], group="sim"),
        Trace("virtual sensor (paper)", t, sensor, "demand"),
        Trace("Kalman filter (paper)", t, s[:, paper_observer.FILTER + 2], group="paper"),
    ))  # fmt: skip
    torque = Panel("Wheel torque, front left", "Nm", (
        Trace("simulated", t, joint.wheel_torque_nm[k, 0], group="sim"),
        Trace("paper's observer", t, paper.estimated_torque_nm[k, 0], group="paper"),
        Trace("joint filter", t, joint.estimated_torque_nm[k, 0], "estimate", group="joint"),
    ))  # fmt: skip
    return force, torque


def _torque_numbers(runs: dict[str, Run]) -> tuple[Number, ...]:
    numbers = []
    for name, label in (("paper", "paper's observer"), ("joint", "joint filter")):
        run = runs[name]
        k = braking(run)
        error = float(np.sqrt(np.mean((run.estimated_torque_nm[k, 0] - run.wheel_torque_nm[k, 0]) ** 2)))
        mean = float(np.abs(run.wheel_torque_nm[k, 0]).mean())
        numbers.append(Number(f"RMSE, {label}", round(error, 1), "Nm", note=f"{100 * error / mean:.1f} % of the mean"))
    return tuple(numbers)


def wheel_torque() -> Report:
    """Figure 9: observed wheel torque in base braking."""
    runs = {name: _stop(name) for name in ("joint", "paper")}
    k = _window(runs["joint"])
    panels = (*_kinematics(runs["joint"], k, _since(runs["joint"])[k]), *_forces(runs))
    reason = "Paper: 19 Nm, 6 %. Each observer drives its own controller; slip from an on-board reference speed."
    return Report("Figure 9: wheel-torque observer, base braking from 20 m/s", reason=reason,
                  numbers=_torque_numbers(runs), sections=(Section("Over time", panels=panels),))  # fmt: skip


def slippery_patch() -> Report:
    """Figure 10: the same with eight metres of friction 0.2."""
    dry = _stop()
    start_m = float(np.cumsum(dry.speed_mps)[onset(dry)]) * 0.01 + manoeuvres.PATCH_AFTER_M
    ends = ((start_m, manoeuvres.PATCH_FRICTION), (start_m + manoeuvres.PATCH_LENGTH_M, 1.0))
    manoeuvre = manoeuvres.stop(NOMINAL.road(ends))
    runs = {n: drive(manoeuvre, nominal_plant(), method(n), SEED) for n in ("joint", "paper")}
    without = drive(manoeuvre, nominal_plant(), method("paper", road=False), SEED)
    k = _window(runs["joint"])
    t = _since(runs["joint"])[k]
    force, torque = _forces(runs)
    size = t.size
    uncorrected = without.observer[k][:size, paper_observer.FILTER + 2]
    force = Panel(
        force.title,
        force.unit,
        (*force.traces, Trace("Kalman filter, K = 1", t[: uncorrected.size], uncorrected, group="off")),
    )
    slip = Panel("Wheel speed over vehicle speed, front left", "1", (
        Trace("front left", t, _wheel_share(runs["joint"])[k]),
    ))  # fmt: skip
    panels = (*_kinematics(runs["joint"], k, t), slip, force, torque)
    reason = (
        "A road of friction 0.2 for eight metres: the front wheels lock on it. Paper: the correction halves the RMSE."
    )
    return Report("Figure 10: changing road", reason=reason, numbers=_torque_numbers(runs),
                  sections=(Section("Over time", panels=panels),))  # fmt: skip


def _wheel_share(run: Run) -> Vector:
    radius = ecu_parameters().vehicle.rolling_radius_m
    return np.asarray(run.observer[:, layout.LAST_WHEEL] * radius / np.maximum(run.speed_mps, 0.5))


def pad_friction() -> Report:
    """Figure 11: estimated pad friction for three blending factors."""
    sections, numbers = [], []
    for alpha in (0.0, 0.5, 0.7):
        runs = {name: _stop(name, alpha) for name in ("joint", "paper")}
        joint = runs["joint"]
        k = _window(joint)
        t = _since(joint)[k]
        n = min(t.size, runs["paper"].estimated_friction[_window(runs["paper"])].shape[0])
        traces = (
            Trace("simulated", t, joint.pad_friction[k, 0], group="sim"),
            Trace(
                "paper's method", t[:n], runs["paper"].estimated_friction[_window(runs["paper"])][:n, 0], group="paper"
            ),
            Trace("joint filter", t, joint.estimated_friction[k, 0], "estimate", group="joint"),
        )
        sections.append(
            Section(f"alpha = {alpha:g}", panels=(Panel(f"Pad friction, front left, alpha = {alpha:g}", "1", traces),))
        )
        i = braking(joint)
        error = float(np.sqrt(np.mean((joint.estimated_friction[i, 0] / joint.pad_friction[i, 0] - 1.0) ** 2)))
        numbers.append(Number(f"RMSE, alpha {alpha:g}", round(100.0 * error, 2), "%", limit="paper: < 8"))
    reason = "72 km/h, discs at 150 degC, 60 % pedal; error of the joint filter over the whole stop."
    title = "Figure 11: pad friction for three blending factors"
    return Report(title, reason=reason, numbers=tuple(numbers), sections=tuple(sections))


def _four_runs(manoeuvre: Manoeuvre, alpha: float) -> dict[str, Run]:
    return {
        "ideal": ideal(manoeuvre, nominal_plant(), SEED, alpha),
        "under-braking": drive(manoeuvre, nominal_plant(UNDER), method(enabled=False), SEED, alpha),
        "over-braking": drive(manoeuvre, nominal_plant(OVER), method(enabled=False), SEED, alpha),
        "compensated": drive(manoeuvre, nominal_plant(UNDER), method(), SEED, alpha),
    }


def compensation() -> Report:
    """Figure 12: kinematics and friction of the ideal, under-, over-braking and compensated stop."""
    runs = _four_runs(manoeuvres.stop(NOMINAL.road()), 0.0)
    speed, a = [], []
    for name, run in runs.items():
        k = _window(run)
        style = _style(name)
        speed.append(Trace(name, _since(run)[k], run.speed_mps[k], style, group=name))
        a.append(Trace(name, _since(run)[k], run.acceleration_mps2[k], style, group=name))
    run = runs["compensated"]
    k = _window(run)
    friction = Panel("Pad friction, front left, compensated run", "1", (
        Trace("simulated", _since(run)[k], run.pad_friction[k, 0], group="sim"),
        Trace("estimated", _since(run)[k], run.estimated_friction[k, 0], "estimate", group="joint"),
        Trace("in use", _since(run)[k], run.used_friction[k, 0], "demand"),
    ))  # fmt: skip
    panels = (Panel("Speed", KMH, tuple(speed)), Panel("Acceleration", "m/s2", tuple(a)), friction)
    numbers = tuple(
        Number(
            f"error, {name}", round(torque_error(run, runs["ideal"]), 2), "%", note="torque, after 0.8 s, of the mean"
        )
        for name, run in runs.items()
        if name != "ideal"
    )
    reason = f"Pads of {UNDER:g} and {OVER:g} times the friction that the controller believes; friction braking only."
    return Report("Figure 12: compensation in one stop", reason=reason, numbers=numbers,
                  sections=(Section("Over time", panels=panels),))  # fmt: skip


def blending() -> Report:
    """Figure 13: torque error with and without compensation over the blending factor."""
    manoeuvre = manoeuvres.stop(NOMINAL.road())
    alphas = np.array(ALPHAS)
    curves = []
    best = {alpha: ideal(manoeuvre, nominal_plant(), SEED, alpha) for alpha in ALPHAS}
    for pads, label in ((UNDER, "under-braking"), (OVER, "over-braking")):
        for enabled in (False, True):
            errors = [
                torque_error(drive(manoeuvre, nominal_plant(pads), method(enabled=enabled), SEED, alpha), best[alpha])
                for alpha in ALPHAS
            ]
            name = f"{label}, {'compensated' if enabled else 'not compensated'}"
            curves.append(Curve(name, alphas, np.array(errors), style="estimate" if enabled else "line", group=label))
    chart = Chart("Torque error", "blending factor alpha", "1", "RMSE of the torque, of its mean", "%", tuple(curves))
    reason = "Against the ideal run, from 0.8 s after the pedal to 1.5 m/s."
    return Report("Figure 13: compensation and blending", reason=reason, sections=(Section("Error", charts=(chart,)),))


def _characteristic(run: Run) -> tuple[Vector, Vector]:
    """Mean deceleration over pedal travel in the second and third braking, in steps of demanded deceleration."""
    pedal = ecu_parameters().pedal
    travel = np.linspace(0.0, 1.0, 1001)
    demand = np.array([reference_deceleration(s, pedal) for s in travel])
    k = np.zeros(run.time_s.size, bool)
    for start in manoeuvres.SERIES_AT_S[1:]:
        k |= (run.time_s > start) & (run.time_s < start + manoeuvres.PULSE_S)
    edges = np.arange(0.0, 3.4, 0.2)
    step = np.digitize(run.demanded_mps2[k], edges)
    x = np.array([np.interp(run.demanded_mps2[k][step == n].mean(), demand, travel) for n in np.unique(step)])
    y = np.array([-run.acceleration_mps2[k][step == n].mean() for n in np.unique(step)])
    return 100.0 * x, y


def series(alpha: float, title: str) -> Report:
    """Figures 14 and 15: three brakings from 130 km/h: kinematics, friction, deceleration over pedal."""
    runs = _four_runs(manoeuvres.series(NOMINAL.road()), alpha)
    speed = Panel("Speed", KMH, tuple(Trace(n, r.time_s, r.speed_mps, _style(n), group=n) for n, r in runs.items()))
    run = runs["compensated"]
    friction = Panel("Pad friction, front left", "1", (
        *(Trace(n, runs[n].time_s, runs[n].pad_friction[:, 0], group=n) for n in ("under-braking", "over-braking")),
        Trace("compensated", run.time_s, run.pad_friction[:, 0], group="compensated"),
        Trace("estimated", run.time_s, run.estimated_friction[:, 0], "estimate", group="compensated"),
    ))  # fmt: skip
    curves = tuple(Curve(name, *_characteristic(r), style=_style(name), group=name) for name, r in runs.items())
    chart = Chart("Deceleration over pedal, stops 2 and 3", "pedal travel", "%", "deceleration", "m/s2", curves)
    section = Section("Three brakings from 130 km/h", panels=(speed, friction), charts=(chart,))
    reason = f"alpha = {alpha:g}; pads of {UNDER:g} and {OVER:g} times the friction that the controller believes."
    return Report(f"{title}: series of brakings", reason=reason, sections=(section,))
