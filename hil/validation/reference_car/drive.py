"""Drive the reference car through one manoeuvre: fourth-order Runge-Kutta, 2.5 ms."""

# mypy: disable-error-code=no-any-return
# (elements of a vector are Any to the type checker)

from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from hil.validation.reference_car.body import rates
from hil.validation.reference_car.brake import pressure_rate_limits
from hil.validation.reference_car.car import NOMINAL, Car
from hil.validation.reference_car.compiled import entry, equation
from hil.validation.reference_car.manoeuvres import TICK_S, Manoeuvre
from hil.validation.reference_car.noise import whole
from hil.validation.reference_car.strengths import OUTPUTS, ROWS, STATES, E, S, Y

Vector = NDArray[np.float64]
STEP_S = 0.0025
PER_TICK = round(TICK_S / STEP_S)
HOLD_LIMIT_NM = 350.0
NOMINAL_RADIUS_M, NOMINAL_MASS_KG = NOMINAL.rolling_radius_m, NOMINAL.mass_kg
FRONT_GAIN_NM_PA, REAR_GAIN_NM_PA = NOMINAL.brake_gain_front_nm_pa, NOMINAL.brake_gain_rear_nm_pa
STANDSTILL_S = 0.8
APPLIED_PA = 1.5e5


@dataclass(frozen=True)
class Driven:
    """What happened, every 2.5 ms from the start: states, outputs, and the demands every 10 ms, as frames say them."""

    manoeuvre: Manoeuvre
    states: Vector
    outputs: Vector
    pressure_demand_pa: Vector
    motor_demand_nm: Vector

    @property
    def t_s(self) -> Vector:
        """Time of each row of states."""
        return np.arange(len(self.states), dtype=np.float64) * STEP_S


def start_state(manoeuvre: Manoeuvre, car: Car) -> Vector:
    """A car that rolls straight; pads and tyres at rest with their temperature."""
    x = np.zeros(STATES)
    x[S.speed_mps] = manoeuvre.speed_mps
    x[S.state_of_charge] = manoeuvre.state_of_charge
    disc = manoeuvre.disc_temperature_k
    for i in range(4):
        x[S.omega_rad_s + i] = manoeuvre.speed_mps / car.rolling_radius_m
        x[S.mu + i] = car.pad_a_1_ks / car.pad_b_1_j * disc / car.pad_epsilon_w
        x[S.pad_k + i] = disc
        x[S.disc_k + i] = disc
        x[S.winding_k + i] = car.ambient_k
        x[S.tyre_k + i] = 313.15
        x[S.pressure_pa + i] = manoeuvre.pressure_pa[0, i]
        x[S.line_pa + i] = manoeuvre.pressure_pa[0, i]
    return x


def drive(manoeuvre: Manoeuvre, car: Car, strength: Vector, onset_s: Vector, law: int, gusts: Vector) -> Driven:
    """Drive to the end of the demands, or until the car has stood for a while.

    Pressure control and motors act on what the frames tell them: a manoeuvre's demands in whole quanta. What holds a
    speed is logged as it is: rounded, it would jump by a quantum with every small change of the car.

    Parameters
    ----------
    strength : the hidden effects, (rows, 4).  onset_s : begin of each row in this log.
    law : number of a law that is in no list, 0 for none.
    gusts : force over mass on the body, and g times the slope of the road, (ticks, 2), m/s2.
    """
    ticks = manoeuvre.ticks
    states, outputs = np.zeros((ticks * PER_TICK, STATES)), np.zeros((ticks * PER_TICK, OUTPUTS))
    pressure_demand, motor_demand = whole(manoeuvre.pressure_pa, "pressure"), whole(manoeuvre.motor_nm, "motor")
    rows = _integrate(
        start_state(manoeuvre, car), car, strength, onset_s, law, pressure_demand, motor_demand,
        manoeuvre.steering_wheel_rad, manoeuvre.hold_mps, gusts, float(manoeuvre.direction), states, outputs,
    )  # fmt: skip
    driven = rows // PER_TICK
    return Driven(manoeuvre, states[:rows], outputs[:rows], pressure_demand[:driven], motor_demand[:driven])


@equation
def _held_demand(x: Vector, target_mps: float) -> float:
    """Torque demand of a driver who knows the nominal car: against the brake, and a share of the speed error."""
    push = 0.25 * NOMINAL_RADIUS_M * NOMINAL_MASS_KG * 1.5 * (target_mps - x[S.speed_mps])
    for i in range(4):
        push += 0.25 * (FRONT_GAIN_NM_PA if i < 2 else REAR_GAIN_NM_PA) * x[S.pressure_pa + i]
    return min(max(push, -HOLD_LIMIT_NM), HOLD_LIMIT_NM)


@equation
def _delayed(demand: Vector, i: int, t: float) -> float:
    """Demand of wheel ``i`` over the step that begins at ``t``; a change within the step counts for its share."""
    first, last = t / TICK_S + 1e-6, (t + STEP_S) / TICK_S + 1e-6
    before, after = floor(first), floor(last)
    share = (last - after) / (last - first) if after > before else 0.0
    return demand[max(before, 0), i] * (1.0 - share) + demand[max(after, 0), i] * share


@entry
def _integrate(
    x: Vector, car: Car, strength: Vector, onset_s: Vector, law: int, pressure_demand: Vector, motor_demand: Vector,
    steering: Vector, hold: Vector, gust: Vector, direction: float, states: Vector, outputs: Vector,
) -> int:  # fmt: skip
    """March with steps of 2.5 ms and fill ``states`` and ``outputs``; return the rows written."""
    ticks = steering.size
    e = np.zeros((ROWS, 4))
    play, since = x[S.pressure_pa : S.pressure_pa + 4].copy(), np.zeros(4)
    demand_pa, y, stages, trial = np.zeros(4), np.zeros(OUTPUTS), np.zeros((4, STATES)), np.zeros(STATES)
    stood = 0.0
    started = x[S.speed_mps] != 0.0
    row = 0
    for tick in range(ticks):
        now = tick * TICK_S
        for k in range(ROWS):
            for i in range(4):
                e[k, i] = strength[k, i] if now >= onset_s[k] else 0.0
        if hold[tick] == hold[tick]:
            motor_demand[tick, :] = _held_demand(x, hold[tick])
        for sub in range(PER_TICK):
            late = now + sub * STEP_S
            for i in range(4):
                demand_pa[i] = _delayed(pressure_demand, i, late - car.ehb_dead_time_s - e[E.ehb_dead_time, i])
            turned = steering[tick] + (sub + 0.5) / PER_TICK * (steering[min(tick + 1, ticks - 1)] - steering[tick])
            for stage in range(4):
                share = (0.0, 0.5, 0.5, 1.0)[stage] * STEP_S
                before = stages[max(stage - 1, 0)]
                for k in range(STATES):
                    trial[k] = x[k] + share * before[k]
                rates(
                    trial, demand_pa, motor_demand[tick], turned, gust[tick, 0], gust[tick, 1],
                    direction, car, e, law, play, since, stages[stage], y,
                )  # fmt: skip
                if stage == 0:
                    states[row] = x
                    outputs[row] = y
            for k in range(STATES):
                x[k] += STEP_S / 6.0 * (stages[0, k] + 2.0 * stages[1, k] + 2.0 * stages[2, k] + stages[3, k])
            for i in range(4):
                width = e[E.pressure_hysteresis, i]
                build, release = pressure_rate_limits(i, car, e)
                x[S.pressure_rate_pa_s + i] = min(max(x[S.pressure_rate_pa_s + i], -release), build)
                p = x[S.pressure_pa + i]
                play[i] = min(max(play[i], p - width), p + width)
                since[i] = since[i] + STEP_S if p > APPLIED_PA else 0.0
                if e[E.pressure_location, i] <= 1e-4:
                    x[S.line_pa + i] = p
            row += 1
        stood = stood + TICK_S if started and abs(x[S.speed_mps]) < 0.08 else 0.0
        if stood > STANDSTILL_S:
            break
    return row


def energy_balance(driven: Driven, car: Car) -> float:
    """Energy that does not add up over the drive without gusts, grade and hidden effects, as a share of the losses.

    Kinetic energy of body and wheels lost = work of the brakes and motors, slip, rolling and air.
    """
    first, last = driven.states[0], driven.states[-1]

    def kinetic(x: Vector) -> float:
        body = 0.5 * car.mass_kg * (x[S.speed_mps] ** 2 + x[S.lateral_mps] ** 2)
        turning = 0.5 * car.yaw_inertia_kg_m2 * x[S.yaw_rate_rad_s] ** 2
        spin: float = 0.5 * car.wheel_inertia_kg_m2 * float(np.sum(x[S.omega_rad_s : S.omega_rad_s + 4] ** 2))
        return float(body + turning) + spin

    omega = driven.states[:, S.omega_rad_s : S.omega_rad_s + 4]
    torque = driven.outputs[:, Y.brake_nm : Y.brake_nm + 4] + driven.outputs[:, Y.motor_true_nm : Y.motor_true_nm + 4]
    power = np.sum(torque * omega, axis=1) - driven.outputs[:, Y.drag_w]
    power -= driven.outputs[:, Y.slip_w] + driven.outputs[:, Y.rolling_w]
    work = float(np.trapezoid(power, dx=STEP_S))
    lost = float(np.trapezoid(np.abs(power), dx=STEP_S))
    return (kinetic(last) - kinetic(first) - work) / max(lost, 1.0)
