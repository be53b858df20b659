"""The page docs/vehicle-set.md: every key of a vehicle set, generated from the shipped set and the short names."""

import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any

from hil.diagnosis.vehicle.keys import ALIASES, DERIVED, LINE_S, SPECIAL, UNLIMITED, WIDE
from hil.diagnosis.vehicle.latency import ALL_NODES, LATENCY_KEYS, MEASURED_S, latencies
from hil.diagnosis.vehicle.priors import INSTRUMENTS
from hil.validation.doc_pages.wrap import markdown

_WHAT = {
    "wheelbase_m": "between the axles",
    "cog_to_front_axle_m": "centre of gravity behind the front axle",
    "cog_to_rear_axle_m": "centre of gravity before the rear axle, instead of the former",
    "front_weight_share": "share of the weight on the front axle, instead of both (0 to 1)",
    "brake_gain_front": "torque at one front wheel per pressure, N m/Pa",
    "brake_gain_rear": "torque at one rear wheel per pressure, N m/Pa",
}
_DERIVED_WHAT = {
    "slip_stiffness": "longitudinal force per slip and load",
    "tyre_friction": "highest longitudinal force per load",
    "cornering_stiffness": "lateral force per slip angle and load",
    "relaxation_length_m": "of the longitudinal force at its usual load",
    "pitch_frequency_hz": "only its tolerance counts",
    "pitch_damping": "share of the critical one; only its tolerance counts",
    "dive_rad_s2_m": "pitch per deceleration; only its tolerance counts",
}
_LATENCY_WHAT = (
    "accelerations and yaw rate", "pressures", "motor torques", "from a logged pressure demand to its action",
    "from a logged torque demand to its action: stamps, and the dead time of the motor",
    "from the logged steering angle to its action", "yaw rate, beyond that of the accelerations: a filter of its own",
    "speed over ground",
)  # fmt: skip
_INSTRUMENT_WHAT = {
    "motor_torque_scale": "true over measured torque of all motors",
    "motor_demand_scale": "torque over demanded torque of all motors",
    "ax_scale": "scale of the accelerometer along the car", "ax_zero_mps2": "its zero, m/s2",
    "ground_speed_scale": "scale of the speed over ground", "road_grade": "slope of the road",
    "wind_mps": "wind along the road, m/s",
}  # fmt: skip
_INTRO = """# Vehicle set

The car as `brakebench explain --vehicle SET.toml` takes it: flat TOML, SI units. Generated from the shipped set and
the short names by `python -m hil.validation.doc_pages.vehicle_page`; a test holds it current. How a set is used:
[explain](explain.md).

```toml
mass_kg = 1650.0
mass_kg_tolerance = 15.0         # half-width of what it might be, two standard deviations
wheelbase_m = 2.72
cog_to_front_axle_m = 1.3
rolling_radius_m = 0.318
brake_gain_front_nm_pa = 2.9e-4
brake_gain_rear_nm_pa = 1.7e-4
```

- A number without tolerance is taken to be known to a hundredth (the centre of gravity along the car to 0.1 m); one
  that is not given, to what the tables say. A tolerance of 0 says that it is known exactly: no fit moves it.
- What stands once for each axle takes one number for both, or a list `[front, rear]`; its tolerance is one number,
  the larger half-width (a list of as many numbers is taken so).
  Of a number that the car has once, a list gives the mean, and half its spread as tolerance; the remarks say so.
- The mass is the whole car's, wheels included; the inertia is that of one wheel with all that turns with it; the
  rolling radius is effective, way per angle. A wheel's torque is its brake gain times the pressure above the threshold.
- A set may leave out {sections} altogether. Then torques are not compared with their demands, and pressures only
  where no pressure is demanded, and between left and right where both demands are equal. Without tyre keys each axle
  has its own cornering stiffness (`vehicle_slip_angle_share`), and the forms of tyre and suspension curves have wider
  bounds. Limits that a set does not state (rates of the pressure; torque, power with top speed, rate, fading and
  derating of the motors; power of the battery) are not simulated: another car's would be wrong. Motors whose torque is
  not stated are as strong as the largest demand in the logs. Where any of these limits is missing, wheels differ, too
  (one standard deviation): zeros of the pressures by 7 kPa, their gains by 0.5 %, pads by 1 %, motors by 0.5 % of the
  demanded and of the measured torque, radii by 0.12 %; clocks of the nodes by 50 ppm, and the steering wheel may stand
  half a degree off where the car goes straight.
- Numbers of the car and its instruments are no causes. What differs from what is told is fitted within its tolerance
  and reported; it is named as a cause where it is some two and a half tolerances off, or begins within the logs. A
  tolerance moves that line.
- Stamps are told beside the wheel speeds' ([latencies](#latencies)). Pads may lag behind the sensors of their
  pressures, as one pole, by {line:g} ms, or by `line_lag_s_tolerance`: 0 where pressures are measured at the callipers.
  Heat capacity and cooling of the discs may be off by a fifth and nearly a third where they are not stated.
- Springs, dampers, bars and links (`suspension_`, `vehicle_pitch_inertia_kg_m2`) that a set states may be off by their
  tolerance, at least by a twentieth, others by much more. Links support the torque of motors
  (`suspension_drive_support_tangent`) as they do the brakes' where a set says nothing else: so it is of motors in the
  wheels, not of motors on the body. Where a set does not state every number of `suspension_`, the
  detection threshold of the height, the lift, the dive and whatever else follows the loads is higher.
- Lift of the axles and drag are those of a wind tunnel: drag acts along the road, and what it does higher up is in
  the lift (SAE J1594).
- Where a set does not state the friction of the tyres, their longitudinal curve may be that of a brush or an
  exponential (`tyre_partial_sliding`, +- 0.5), and their friction may go down with the load from not at all to twice as
  much as the shipped tyre's (`tyre_pdx2`, +- 0.16).
- Without a `pad_` key the friction of the pads is one constant, which the brake gains contain. Drums are brakes like
  others, with a threshold of their own; motors on a differential give both wheels of their axle the same torque, and
  their rotor counts in the inertia of these wheels.
- Unknown keys are named in the remarks and left out.
"""
Entries = Mapping[str, Mapping[str, Any]]


def _shipped() -> dict[str, Entries]:
    source = resources.files("plant") / "parameters" / "paper_car.toml"
    return tomllib.loads(source.read_text(encoding="utf-8"))


def page() -> str:
    """The page in Markdown."""
    shipped = _shipped()
    flat = {f"{section}_{name}": entry for section, entries in shipped.items() for name, entry in entries.items()}
    sections = ", ".join(f"`{section}_`" for section in UNLIMITED)
    lines = [_INTRO.format(sections=sections, line=1e3 * LINE_S)]
    lines += ["## The car's six and their like", "", "| key | also | what |", "|---|---|---|"]
    lines += [f"| {_names(name)} | {what} |" for name, what in _WHAT.items()]
    lines += _short(flat) + _derived(flat) + _latencies() + _instruments()
    for section, entries in shipped.items():
        lines += ["", f"## `{section}_`", "", *_table_head()]
        lines += [f"| `{section}_{name}` | {_row(f'{section}_{name}', entry)} |" for name, entry in entries.items()]
    return markdown(lines)


def _short(flat: Entries) -> list[str]:
    shorts: dict[str, list[str]] = {}
    for short, name in ALIASES.items():
        if name not in SPECIAL:
            shorts.setdefault(name, []).append(short)
    lines = ["", "## Short names", "", "| key | also | unit | shipped | +- where it is not given |"]
    lines.append("|---|---|---|---|---|")
    for name, also in shorts.items():
        first = next((one for one in also if name.endswith(one)), also[0])
        others = ", ".join(f"`{one}`" for one in (*also, name) if one != first)
        lines.append(f"| `{first}` | {others} | {_row(name, flat[name])} |")
    return lines


def _derived(flat: Entries) -> list[str]:
    said = "Each sets a number of the plant; in brackets, how many times the given one."
    lines = ["", "## Numbers made of others", "", said, "", "| key | sets | what |", "|---|---|---|"]
    for key, (name, place, factor) in DERIVED.items():
        pair = isinstance(flat[name]["value"], list)
        where = f", {('front', 'rear')[place]}" if pair and place is not None else ""
        times = "" if factor == 1.0 else f" ({factor:.4g} times it)"
        lines.append(f"| `{key}` | `{name}`{where}{times} | {_DERIVED_WHAT.get(key, '')} |")
    return lines


def _latencies() -> list[str]:
    unstated = latencies({}, {}, measured=False)
    lines = [
        "", "## Latencies", "",
        "How much later than the wheel speeds a node's frames are stamped, or how much later than its stamp a demand",
        f"acts, s; each with a tolerance. `{ALL_NODES}_tolerance` is that of all but the last two. In a set that",
        f"states every limit, as measurements do, it is {1e3 * MEASURED_S:g} ms where it is not given.", "",
        "| key | +- where it is not given | what |", "|---|---|---|",
    ]  # fmt: skip
    for key, one, what in zip(LATENCY_KEYS, unstated, _LATENCY_WHAT, strict=True):
        lines.append(f"| `{key}` | {one.half_width_s:g} | {what} |")
    return lines


def _instruments() -> list[str]:
    lines = [
        "", "## Instruments and road", "",
        "`<key>_tolerance` alone, no value: what is measured is taken as it is, the road as level, the air as still.",
        "In a set that states every limit nothing of this is free unless it is given.", "",
        "| key | +- where it is not given | what |", "|---|---|---|",
    ]  # fmt: skip
    for key, (_, _, usual) in INSTRUMENTS.items():
        lines.append(f"| `{key}` | {usual:g} | {_INSTRUMENT_WHAT[key]} |")
    return lines


def _names(special: str) -> str:
    """The key to write first, then all others for the same number."""
    others = [short for short, name in ALIASES.items() if name == special != short]
    first, *more = others if special.startswith("brake_gain") else [special, *others]
    return f"`{first}` | {', '.join(f'`{one}`' for one in more)}"


def _table_head() -> list[str]:
    return ["| key | unit | shipped | +- where it is not given |", "|---|---|---|---|"]


def _row(name: str, entry: Mapping[str, Any]) -> str:
    """Unit, shipped value, and how far off it may be where a set does not say."""
    values = entry["value"] if isinstance(entry["value"], list) else [entry["value"]]
    if not all(isinstance(value, int | float) for value in values):
        return f"{entry['unit']} | `{entry['value']}` | "
    tolerance = max(float(entry["tolerance"]), WIDE.get(name, 0.0) * max(abs(float(value)) for value in values))
    shown = ", ".join(f"{value:g}" for value in values)
    return f"{entry['unit']} | {shown} | {f'{tolerance:.3g}' if tolerance else 'exact'}"


if __name__ == "__main__":
    from pathlib import Path

    Path("docs/vehicle-set.md").write_text(page(), encoding="utf-8")
