"""What is driven. Every run begins with some seconds of motor drive: that is where a car's mass shows."""

from plant.manoeuvre import Manoeuvre, SpeedPhase
from plant.road import RoadSegment

PEDAL = 0.6
RAMP_S = 0.3
STOP_FROM_MPS = 20.0
STOP_AT_S = 6.0
FAULT_AT_S = 8.0
SERIES_FROM_MPS = 130.0 / 3.6
SERIES_AT_S = (9.0, 25.0, 41.0)
PULSE_S = 6.0
PATCH_AFTER_M, PATCH_LENGTH_M, PATCH_FRICTION = 25.0, 8.0, 0.2 / 1.19


def stop(road: tuple[RoadSegment, ...], pad_friction: float | None = None, state_of_charge: float = 0.7) -> Manoeuvre:
    """Drive up from 12 to 20 m/s, hold, and brake to rest with 60 % pedal (Figures 9 to 13)."""
    return Manoeuvre(
        initial_speed_mps=STOP_FROM_MPS - 8.0,
        duration_s=20.0,
        pedal=((STOP_AT_S, 0.0), (STOP_AT_S + RAMP_S, PEDAL)),
        speed_phases=(SpeedPhase(0.0, STOP_AT_S, STOP_FROM_MPS),),
        road=road,
        initial_pad_friction=pad_friction,
        initial_state_of_charge=state_of_charge,
        end_after_standstill_s=0.1,
    )


def series(road: tuple[RoadSegment, ...], pad_friction: float | None = None) -> Manoeuvre:
    """Three brakings from 130 km/h, driving up again between them (Figures 14 and 15)."""
    pedal: list[tuple[float, float]] = []
    phases = []
    free_s = 0.0
    for start in SERIES_AT_S:
        pedal += [
            (start, 0.0),
            (start + 4.0 * RAMP_S, PEDAL),
            (start + PULSE_S, PEDAL),
            (start + PULSE_S + RAMP_S, 0.0),
        ]
        phases.append(SpeedPhase(free_s, start, SERIES_FROM_MPS))
        free_s = start + PULSE_S + RAMP_S
    return Manoeuvre(
        initial_speed_mps=SERIES_FROM_MPS - 8.0,
        duration_s=free_s + 0.5,
        pedal=tuple(pedal),
        speed_phases=tuple(phases),
        road=road,
        initial_pad_friction=pad_friction,
    )


def two_stops(road: tuple[RoadSegment, ...], pad_friction: float | None = None) -> Manoeuvre:
    """Two brakings from 20 m/s; what the first teaches is there for the second."""
    first, second, end = STOP_AT_S, STOP_AT_S + 14.0, STOP_AT_S + 4.5
    return Manoeuvre(
        initial_speed_mps=STOP_FROM_MPS - 8.0,
        duration_s=second + 8.0,
        pedal=(
            (first, 0.0),
            (first + RAMP_S, PEDAL),
            (end, PEDAL),
            (end + RAMP_S, 0.0),
            (second, 0.0),
            (second + RAMP_S, PEDAL),
        ),
        speed_phases=(SpeedPhase(0.0, first, STOP_FROM_MPS), SpeedPhase(end + RAMP_S, second, STOP_FROM_MPS)),
        road=road,
        initial_pad_friction=pad_friction,
        end_after_standstill_s=0.1,
    )
