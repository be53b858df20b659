"""What is handed over (logs, logs.toml, vehicle.toml) and what is sealed (answer.json in a folder beside it)."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from math import hypot, pi
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from hil.errors import BrakebenchError, in_words
from hil.validation.reference_car.body import LINKS
from hil.validation.reference_car.car import NOMINAL, TOLERANCE, Car
from hil.validation.reference_car.case import Case, Hidden, logs
from hil.validation.reference_car.catalogue import find
from hil.validation.reference_car.manoeuvres import TICK_S
from hil.validation.reference_car.noise import USUALLY_LATE_S

_RENAMED = {
    "ehb_frequency_hz": "ehb_natural_frequency_hz", "ehb_damping": "ehb_damping_ratio",
    "imu_cutoff_hz": "sensor_imu_cutoff_hz",
}  # fmt: skip
_SCALES = {
    "slip_stiffness": ("tyre_lkx", 1.0), "tyre_friction": ("tyre_lmux", 1.0), "cornering_stiffness": ("tyre_lky", 1.0),
    "relaxation_length_m": ("tyre_lsgkp", 0.373),
}  # fmt: skip
_TOLD = (
    "mass_kg", "wheelbase_m", "cog_to_front_axle_m", "cog_height_m", "track_m", "yaw_inertia_kg_m2",
    "drag_coefficient", "lift_front", "lift_rear", "frontal_area_m2", "air_density_kg_m3", "rolling_resistance",
    "steering_ratio", "rolling_radius_m", "wheel_inertia_kg_m2", "brake_gain_front_nm_pa", "brake_gain_rear_nm_pa",
    "threshold_pressure_pa", "pad_a_1_ks", "pad_b_1_j", "pad_c_1_s", "pad_epsilon_w", "ambient_k", "ehb_frequency_hz",
    "ehb_damping", "ehb_dead_time_s", "ehb_build_rate_pa_s", "ehb_release_rate_pa_s", "ehb_max_pressure_pa",
    "motor_time_constant_s", "motor_rate_limit_nm_s", "motor_peak_torque_nm", "motor_peak_power_w",
    "motor_fade_start_mps", "motor_fade_end_mps", "motor_derating_start_k", "motor_derating_end_k",
    "battery_charge_power_w", "imu_cutoff_hz", "disc_heat_front_j_k", "disc_heat_rear_j_k", "disc_cooling_front_w_k",
    "disc_cooling_rear_w_k",
)  # fmt: skip
_SUPPORT, _ROLL_CENTRE_M = 0.03, 0.03
"""Half-widths of the links' support and of the roll centres, as drawings tell them."""
_OF_EQUATION = {"steering_ratio": 0.02 * NOMINAL.steering_ratio}
"""Half-width of a number that is exact in this car and stands in another equation of the plant."""
_ROLL_INERTIA_KG_M2 = 100.0
"""The hidden body rolls at once; with so much it does in 0.03 s, and the plant's steps still follow."""


def sealed_folder(folder: Path) -> Path:
    """Where the answer to the logs in ``folder`` lies: a folder beside it that no study opens."""
    return folder.with_name(folder.name + ".sealed")


def write(case: Case, folder: Path) -> Path:
    """Drive and write the case: logs, ``logs.toml`` and ``vehicle.toml`` into ``folder``, the answer beside it.

    Returns
    -------
    Path of the answer.

    Raises
    ------
    BrakebenchError
        There is something in the folder already, or it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BrakebenchError(f"{folder}: not empty; give a folder that is empty or does not exist")
    sealed = sealed_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        sealed.mkdir(parents=True, exist_ok=True)
        described = []
        for drive, table in zip(case.drives, logs(case), strict=True):
            name = f"{drive.name}.parquet"
            pa.parquet.write_table(pa.table(dict(table)), folder / name)
            described.append(
                f'["{name}"]\ndirection = {drive.direction}\n'
                f"initial_disc_temperature_k = {drive.disc_temperature_k:.2f}\n"
            )
        (folder / "logs.toml").write_text("\n".join(described), encoding="utf-8")
        (folder / "vehicle.toml").write_text(vehicle_toml(), encoding="utf-8")
        path = sealed / "answer.json"
        path.write_text(json.dumps(answer(case), indent=1), encoding="utf-8")
    except OSError as error:
        raise BrakebenchError(f"{folder}: cannot be written: {in_words(error)}") from error
    return path


_ACTS_LATE_S = 0.004
"""Half-width of the time from the stamp of a demand, and of the steering wheel's angle, to its action."""


def vehicle_toml() -> str:
    """The nominal car as stated: flat numbers, SI, each with the half-width of what the true one may be."""
    lines = [
        "# The car as its maker describes it. SI; <name>_tolerance is the half-width of what the true value may be."
    ]
    lines.append("# brake_gain_*: torque at one wheel per pressure, pads at rest at 423 K (150 degC).")
    for name in _TOLD:
        key = _RENAMED.get(name, name)
        lines.append(f"{key} = {float(getattr(NOMINAL, name))!r}")
        lines.append(f"{key}_tolerance = {TOLERANCE.get(name, _OF_EQUATION.get(name, 0.0))!r}")
    lines.append(
        "# factors on the tyre of the size 195/65 R15: slip stiffness, friction, cornering stiffness, relaxation"
    )
    for name, (key, value) in _SCALES.items():
        lines.append(f"{key} = {value!r}")
        lines.append(f"{key}_tolerance = {value * TOLERANCE[name] / float(getattr(NOMINAL, name)):.4f}")
    lines.append("# frames of the other nodes beside the wheel speeds'")
    lines.append(f"node_latency_s_tolerance = {2.0 * USUALLY_LATE_S:.5f}")
    acting = ("pressure_demand", "motor_demand", "steering")
    lines += [f"{node}_latency_s_tolerance = {_ACTS_LATE_S}" for node in acting]
    lines.append("ground_speed_latency_s_tolerance = 0.0")  # stamped when it was true
    lines.append("line_lag_s_tolerance = 0.0")  # its pressures are measured at the callipers
    lines.append("# suspension at the wheel, [front, rear]; linear springs, roll centres on the road")
    for key, (values, half) in _suspension(NOMINAL).items():
        lines.append(f"{key} = {values!r}")
        lines.append(f"{key}_tolerance = {half!r}")
    return "\n".join(lines) + "\n"


def _suspension(car: Car) -> dict[str, tuple[float | list[float], float]]:
    """Springs, dampers, bars and links of a car that dives, pitches and rolls as ``car``, each with its half-width.

    Pitch and heave are not coupled: c_f a = c_r b, dampers alike (Mitschke/Wallentowitz, Dynamik der Kraftfahrzeuge).
    Pitch stiffness is what of m h the links do not carry, over the dive; inertia and damping follow from frequency and
    damping ratio. Support: tan = share h / (L b) of what of the torque slows the body and not the wheels, b the axle's
    share: of the brakes that of the pads, of the motors a half. Bars are what the roll needs beyond the springs, shared
    so that loads across are, by weight.
    """
    front_m, rear_m = car.cog_to_front_axle_m, car.wheelbase_m - car.cog_to_front_axle_m
    moment = car.mass_kg * car.cog_height_m
    stiffness = (1.0 - LINKS) * moment / car.dive_rad_s2_m
    w = 2.0 * pi * car.pitch_frequency_hz
    inertia = stiffness / w**2
    springs = [stiffness / (2.0 * m * car.wheelbase_m) for m in (front_m, rear_m)]
    pads = car.brake_gain_front_nm_pa / (car.brake_gain_front_nm_pa + car.brake_gain_rear_nm_pa)
    body = car.mass_kg / (car.mass_kg + 4.0 * car.wheel_inertia_kg_m2 / car.rolling_radius_m**2)
    passed = body * LINKS * car.cog_height_m / car.wheelbase_m
    weight = [rear_m / car.wheelbase_m, front_m / car.wheelbase_m]
    roll = [share * moment / car.roll_rad_s2_m for share in weight]
    dive, frequency, damping, rolling = (
        TOLERANCE[name] / float(getattr(car, name))
        for name in ("dive_rad_s2_m", "pitch_frequency_hz", "pitch_damping", "roll_rad_s2_m")
    )
    return {
        "suspension_ride_rate_n_m": (_rounded(springs), round(dive * max(springs))),
        "suspension_progression_n_m3": (0.0, 0.0),
        "suspension_damping_ns_m": (
            _rounded(2.0 * car.pitch_damping / w * c for c in springs),
            round(2.0 * car.pitch_damping / w * max(springs) * hypot(damping, dive, frequency)),
        ),
        "suspension_brake_support_tangent": ([round(passed / b, 3) for b in (pads, 1.0 - pads)], _SUPPORT),
        "suspension_drive_support_tangent": ([round(passed / 0.5, 3)] * 2, _SUPPORT),
        "suspension_anti_roll_nm_rad": (
            _rounded(k - 0.5 * c * car.track_m**2 for k, c in zip(roll, springs, strict=True)),
            round(rolling * max(roll)),
        ),
        "suspension_roll_centre_height_m": (0.0, _ROLL_CENTRE_M),
        "vehicle_roll_inertia_kg_m2": (_ROLL_INERTIA_KG_M2, 0.05 * _ROLL_INERTIA_KG_M2),
        "vehicle_pitch_inertia_kg_m2": (round(inertia), round(inertia * hypot(dive, 2.0 * frequency))),
    }  # fmt: skip


def _rounded(values: Iterable[float]) -> list[float]:
    return [float(round(value, -1)) for value in values]


def answer(case: Case) -> dict[str, Any]:
    """What is sealed: truth about the car, the noise, and what was hidden."""
    listed = [find(one.effect) for one in case.hidden]
    verdict = "none" if not listed else "unlisted" if any(kind.law for kind in listed) else "named"
    return {
        "verdict": verdict,
        "family": case.family,
        "index": case.index,
        "seed": case.seed,
        "manoeuvres": case.manoeuvres,
        "variant": case.variant,
        "causes": [_cause(case, one) for one in case.hidden],
        "snr": case.snr,
        "snr_alone": case.snr_alone,
        "target_snr": case.target_snr,
        "reached": case.reached,
        "noise": asdict(case.noise),
        "vehicle": {name: float(value) for name, value in case.car._asdict().items()},
        "nominal": {name: float(value) for name, value in NOMINAL._asdict().items()},
        "logs": [f"{drive.name}.parquet" for drive in case.drives],
    }


def read_answer(folder: Path) -> dict[str, Any]:
    """Open the answer to the logs in ``folder``.

    Raises
    ------
    BrakebenchError
        It is not there.
    """
    path = sealed_folder(folder) / "answer.json"
    try:
        opened: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BrakebenchError(f"{path}: no answer to open: {in_words(error)}") from error
    return opened


def _cause(case: Case, one: Hidden) -> dict[str, Any]:
    kind = find(one.effect)
    cause: dict[str, Any] = {
        "effect": one.effect,
        "location": one.wheel,
        "parameters": {kind.parameter: {"value": one.magnitude, "unit": kind.unit}},
        "onset": None,
        "onset_s": one.onset_s,
    }
    if kind.law:
        cause |= {"injection_point": kind.joint, "variables": list(kind.variables)}
    if one.onset_s is not None:
        starts = case.starts_s()
        k = int(np.searchsorted(starts, one.onset_s, side="right")) - 1
        within = min(one.onset_s - starts[k], case.drives[k].ticks * TICK_S)
        cause["onset"] = {"log": f"{case.drives[k].name}.parquet", "t_s": within}
    return cause
