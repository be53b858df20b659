"""Figures that the paper has not: motors lost, a battery that refuses, work moved to the motors."""

from dbc.bench_messages import PhysicalFault
from hil.report.report import Panel, Report, Section, Trace
from hil.validation.reproduce import manoeuvres
from hil.validation.reproduce.cases import SHIFT_ALPHA, WEAK, method, unshifted, with_pads, without_notice
from hil.validation.reproduce.conditions import NOMINAL
from hil.validation.reproduce.runs import Fault, drive, plant_parameters
from plant.parameters.plant import PlantParameters

SEED = 1


def nominal_plant(pads: float = 1.0) -> PlantParameters:
    """The plant that the figures show, with the friction of its pads scaled."""
    return with_pads(NOMINAL.plant(plant_parameters(), SEED), pads)


def motor_failure() -> Report:
    """Motors lost in the middle of a stop at alpha 0.7: who gives the torque."""
    at = manoeuvres.FAULT_AT_S
    a, p = [], []
    for name, wheels in (("one motor", 0b0001), ("front axle", 0b0011), ("all motors", 0b1111)):
        fault = Fault(PhysicalFault.MOTOR_DEAD, wheels, at)
        run = drive(manoeuvres.stop(NOMINAL.road()), nominal_plant(), method(), SEED, 0.7, (fault,))
        k = (run.time_s > at - 0.2) & (run.time_s < at + 0.6)
        t = run.time_s[k] - at
        a.append(Trace(name, t, run.acceleration_mps2[k], group=name))
        p.append(Trace(name, t, run.pressure_pa[k, 0] * 1e-5, group=name))
    panels = (Panel("Acceleration", "m/s2", tuple(a)), Panel("Pressure, front left", "bar", tuple(p)))
    reason = "The motors fail at 0 s and say so; friction takes over with a 6 Hz brake of 20 ms dead time."
    return Report("Motor failure at alpha 0.7", reason=reason, sections=(Section("Around the failure", panels=panels),))


def battery_refuses() -> Report:
    """The battery refuses in the middle of a stop at alpha 0.7, announced and without notice."""
    at = manoeuvres.FAULT_AT_S
    fault = Fault(PhysicalFault.BATTERY_REFUSES_CHARGE, 0, at)
    a, friction, motors = [], [], []
    for name, plant in (
        ("announced 0.3 s ahead", nominal_plant()),
        ("without notice", without_notice(nominal_plant())),
    ):
        run = drive(manoeuvres.stop(NOMINAL.road()), plant, method(), SEED, 0.7, (fault,))
        k = (run.time_s > at - 0.2) & (run.time_s < at + 0.8)
        t = run.time_s[k] - at
        of_pads = run.friction_torque_nm[k].sum(axis=1)
        a.append(Trace(name, t, run.acceleration_mps2[k], group=name))
        friction.append(Trace(name, t, of_pads, group=name))
        motors.append(Trace(name, t, run.wheel_torque_nm[k].sum(axis=1) - of_pads, group=name))
    panels = (
        Panel("Acceleration", "m/s2", tuple(a)),
        Panel("Torque of the friction brakes, all wheels", "Nm", tuple(friction)),
        Panel("Torque of the motors, all wheels", "Nm", tuple(motors)),
    )
    reason = "At 0 s the battery says that it takes no more, 0.3 s before it cuts or at once; it speaks every 0.1 s."
    return Report(
        "Battery refuses at alpha 0.7", reason=reason, sections=(Section("Around the refusal", panels=panels),)
    )


def work_moved() -> Report:
    """Weak pads: work moved to the motors, against the blending factor as set."""
    manoeuvre = manoeuvres.series(NOMINAL.road())
    heat, disc, pads = [], [], []
    for name, ecu in (("work moved to the motors", method()), ("alpha as set", unshifted())):
        run = drive(manoeuvre, nominal_plant(WEAK), ecu, SEED, SHIFT_ALPHA)
        heat.append(Trace(name, run.time_s, run.friction_heat_j * 1e-6, group=name))
        disc.append(Trace(name, run.time_s, run.disc_temperature_k[:, 0] - 273.15, group=name))
        pads.append(Trace(name, run.time_s, run.pad_friction[:, 0], group=name))
    panels = (
        Panel("Heat of the friction brakes", "MJ", tuple(heat)),
        Panel("Disc temperature, front left", "degC", tuple(disc)),
        Panel("Pad friction, front left", "1", tuple(pads)),
    )
    reason = f"Three brakings from 130 km/h, pads x{WEAK:g}, alpha {SHIFT_ALPHA:g}; both compensate the weak pads."
    return Report("Work moved to the motors at low pad friction", reason=reason,
                  sections=(Section("Over time", panels=panels),))  # fmt: skip
