"""The page docs/faults.md: every fault of the library, generated from the catalogue, between words of its own."""

from dbc.messages import BrakeMode, Fault
from hil.faults.catalogue import FAMILIES, FAULTS, ROWS
from hil.faults.fault import COMMON, FaultKind, Parameter
from hil.validation.doc_pages.wrap import markdown

_FAMILIES = {
    "bus": "Frames on their way",
    "protection": "End-to-end protection",
    "link": "The link of a node",
    "signal": "Signals",
    "physical": "The car",
    "process": "Processes",
    "disk": "The recorder",
    "clock": "The machine's time of day",
}

_OPENING = """# Faults

Every fault that the bench can put into a car by name, and what is right for a controller to do about it. The tables
are generated from `hil/faults` by `python -m hil.validation.doc_pages.faults_page`; a test holds them current.
`brakebench inject` lists the names.

A fault acts between a node and its bus, in the process that plays the node: in virtual time, on the loopback, on vcan
and on an adapter alike, and the same seed gives the same frames. Armed faults travel on the bench bus as
`FAULT_PARAMETER` and `FAULT_SELECT`, those of the car as `FAULT_COMMAND` (`dbc/bench.dbc`), so a recording tells what
was armed when. Nothing is armed by itself. A fault ends after `for_s`, after `count` frames, when it is cleared, or
with the run; several act one behind the other in the order in which they were armed. Armed again on the same target,
a fault begins anew. On the frames of a controller that is not ours nothing acts: nobody stands between it and the bus.

## Arming a fault

In a scenario ([scenarios.md](scenarios.md)):

```toml
[[faults]]
fault = "counter_frozen"
on = "BRAKE_PEDAL"
at_s = 1.0
for_s = 0.5
```

In a test ([testing.md](testing.md)), as a call, as a context that ends it, and over a family:

```python
import pytest
from hil.faults.catalogue import names


@pytest.mark.parametrize("name", names("signal"))
def test_no_sensor_releases_the_brake(bench, name):
    bench.drive("72 km/h")
    bench.pedal(0.6)
    bench.inject(name, on="WHEEL_SPEED_FRONT.WHEEL_SPEED_FL", after=1.0, for_s=0.3)
    with bench.inject("motor_dead", wheel="fl", after=1.0):
        bench.run(2.0)
    assert bench.speed_mps < 15.0
```

By hand, on a bench that runs (`brakebench run`, or `brakebench plant` and `brakebench ecu`):

```sh
brakebench inject silent --on WHEEL_SPEED_FRONT --for 0.3
brakebench inject signal_value --on BRAKE_PEDAL.PEDAL_TRAVEL_1 --set value=1.0 --for 1
brakebench inject motor_dead --on fl,fr
brakebench inject motor_dead --on fl,fr --clear
```

A target is a message (`BRAKE_PEDAL`), a signal (`BRAKE_PEDAL.PEDAL_TRAVEL_1`), all messages of a node (`SENSORS`,
`EHB`, `IWM`, `DRIVER`, `BATTERY`, `ECU`; `PLANT`: of the whole car), `ALL`, a process (`ECU`, `PLANT`), or wheels
(`fl`, `fl,rr`, `front`, `rear`, `all`). Values are SI. A fault of the car's frames begins in the tick at its time, one
of the controller's, or of both, up to a cycle later.

## Valid frames for scripts

`hil.faults.frames.protected(message, counter, values)` gives one frame with counter and check value;
`hil.faults.frames.Sender(message, values)` counts by itself, sends in the message's cycle where it is stepped as a
node, and with `next()` at will:

```python
from hil.faults.frames import Sender, protected

frame = protected("BRAKE_PEDAL", 3, {"PEDAL_TRAVEL_1": 0.5, "PEDAL_TRAVEL_2": 0.5})
second = Sender("MOTOR_DEMAND_FRONT", {"TORQUE_DEMAND_FL": 0.0, "TORQUE_DEMAND_FR": 0.0}, counter=7)
bus.send(frame, second.next(), second.next(TORQUE_DEMAND_FL=-100.0))
```

## The words of CANoe

Faults of counter and check value mean what CANoe's interaction layer means by `ILNodeDisturbCounter` and
`ILNodeDisturbChecksum`: a disturbed counter has the check value that belongs to it, a disturbed check value leaves the
counter right. The function names are those of its CAPL help.

| CANoe | here |
|---|---|
| `ILNodeDisturbCounter`, modes 0 value, 1 freeze | `counter_value`, `counter_frozen` |
| modes 2 random, 3 offset | `counter_random`, `counter_offset` |
| `ILNodeDisturbChecksum`, modes 0 value, 1 freeze | `crc_value`, `crc_frozen` |
| modes 2 random, 3 offset | `crc_random`, `crc_offset` |
| `disturbanceCount` n, -1, 0 | `count` n, `count` 0 (any number), clear |
| `disturbanceValue` | `value`, `offset` |
| `continueMode` 0 correct, 1 last valid, 2 last value | `goes_on` 0, 1, 2 |

## What each bus can do

| | virtual time | loopback, vcan | emulated PCI adapter (QEMU) | `slcan` over a pty | timed bus |
|---|---|---|---|---|---|
| families bus, protection, signal, physical | yes | yes | yes | yes | yes |
| family link: the events and silence a node sees | yes | yes | yes | yes | yes |
| family process: real signals to real processes | the equivalent | yes | yes | yes | the equivalent |
| a driver's own error states, bus-off | no | no | no | yes | yes |
| transmit queue really full (ENOBUFS) | no | no | yes | no | yes |
| bit errors, error frames, ACK, wrong bit rate | no | no | no | no | yes |
| delay of others by `babble`: arbitration | no | no | no | no | yes |
| `restart-ms` | no | no | no | no | yes |

## Expected

*Found within*: time from the first frame befallen, or the switch in the car, to the trouble code in `BRAKE_STATUS`;
where there is none, the fault may stay unfound. *Modes*: those that are right while it acts; NORMAL is right until it
is found. *Trouble*: the codes that may be told, and no other; "of the target" are those of the message or sensor that
it acts on. *Stop*: whether physics, or the driver's own channel, forces an effect on the stop. The budgets are
assumptions of this project, no figures of a standard.

Every fault but those of the car, the recorder and the machine has these parameters; those of the car have all but
`count`:
"""


def page() -> str:
    """The documentation of the faults in Markdown."""
    lines = [*_OPENING.splitlines(), *[f"- {_parameter(p)}" for p in COMMON]]
    for family in FAMILIES:
        lines += ["", f"## {_FAMILIES[family]}", "", "| fault | what | takes | parameters | found within | modes |"]
        lines[-1] += " trouble | stop |"
        lines.append("|---|---|---|---|---|---|---|---|")
        lines += [_row(kind) for kind in FAULTS if kind.family == family]
    lines += ["", "## The table of faults to be withstood", "", "| row | faults |", "|---|---|"]
    lines += [f"| {row} | {', '.join(f'`{k.name}`' for k in FAULTS if k.row == row)} |" for row in ROWS]
    return markdown(lines)


def _row(kind: FaultKind) -> str:
    expected = kind.reaction
    within = "-" if expected.detect_ms is None else f"{expected.detect_ms:g} ms"
    modes = ", ".join(mode.name for mode in BrakeMode if mode in expected.modes)
    parameters = "; ".join(_parameter(p) for p in kind.parameters) or "-"
    stop = "yes" if expected.braking else "no"
    takes = kind.takes.value
    return f"| `{kind.name}` | {kind.text} | {takes} | {parameters} | {within} | {modes} | {_trouble(kind)} | {stop} |"


def _trouble(kind: FaultKind) -> str:
    if kind.of_target and kind.reaction.modes != {BrakeMode.NORMAL}:
        return "of the target"
    bits = [one.name or "" for one in Fault if one in kind.reaction.trouble]
    return "any" if len(bits) > 6 else ", ".join(bits) or "none"


def _parameter(parameter: Parameter) -> str:
    unit = f" {parameter.unit}" if parameter.unit else ""
    wide = parameter.unit == "SI"
    bounds = "" if wide else f" {parameter.low:g} to {parameter.high:g}{unit}"
    default = "" if parameter.default is None else f", default {parameter.default:g}"
    return f"`{parameter.name}`{bounds}{default}: {parameter.text}"


if __name__ == "__main__":
    from pathlib import Path

    Path("docs/faults.md").write_text(page(), encoding="utf-8")
