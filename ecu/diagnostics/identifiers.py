"""Data identifiers: what each names, its unit, its bytes.

0xF1xx identification, 0xF2xx quantities of the law (periodic too), 0x02xx groups of values as a snapshot holds them,
0x1000 to 0x1FFF parameters, 0x40xx demands that a tester may set (`ecu.diagnostics.actuators`). Numbers are big endian:
quantities 32-bit floats behind the low byte of the law's tick number, parameters 64-bit floats.
"""

import struct
from collections.abc import Callable
from typing import NamedTuple

from ecu.diagnostics import calibration, quantities
from ecu.diagnostics.exchange import View
from ecu.law.trouble_codes import FreezeFrame

ACTIVE_SESSION = 0xF186
FIRST_QUANTITY = 0xF200


class Identifier(NamedTuple):
    """``size`` in bytes; ``form``: how its bytes are to be read (`struct`, or text)."""

    name: str
    unit: str
    form: str
    size: int
    read: Callable[[View], bytes]


def _text(name: str, text: str) -> Identifier:
    return Identifier(name, "", "text", len(text), lambda _: text.encode("ascii"))


IDENTIFICATION: dict[int, Identifier] = {
    0xF187: _text("spare_part_number", "BRAKEBENCH-ECU"),
    0xF188: _text("software_number", "BRAKEBENCH-LAW"),
    0xF189: _text("software_version", "0001"),
    0xF18A: _text("supplier", "BRAKEBENCH"),
    0xF18B: Identifier("manufacturing_date", "", "3B", 3, lambda _: bytes((0x20, 0x26, 0x01))),
    0xF18C: _text("serial_number", "00000001"),
    0xF190: _text("vehicle_identification_number", "BRAKEBENCH0000001"),
    0xF191: _text("hardware_number", "EMULATED-ECU"),
    0xF193: _text("hardware_version", "0001"),
    0xF195: _text("software_version_of_the_supplier", "0001"),
    0xF197: _text("system_name", "BRAKE BLENDING CONTROLLER"),
}


class Group(NamedTuple):
    """Values of a snapshot under one identifier."""

    name: str
    unit: str
    form: str
    values: Callable[[float, FreezeFrame], tuple[float, ...]]

    def encode(self, time_s: float, frame: FreezeFrame) -> bytes:
        """Bytes of the values."""
        return struct.pack(self.form, *self.values(time_s, frame))


SNAPSHOT: dict[int, Group] = {
    0x0200: Group("snapshot_time", "s", ">f", lambda t, _: (t,)),
    0x0201: Group("snapshot_mode", "1", ">B", lambda _, f: (f.mode,)),
    0x0202: Group("snapshot_speed", "m/s", ">f", lambda _, f: (f.speed_mps,)),
    0x0203: Group("snapshot_demanded_deceleration", "m/s2", ">f", lambda _, f: (f.demanded_deceleration_mps2,)),
    0x0204: Group("snapshot_pedal_travel", "1", ">2f", lambda _, f: f.pedal),
    0x0205: Group("snapshot_pressures", "Pa", ">4f", lambda _, f: f.pressure_pa),
    0x0206: Group("snapshot_motor_currents", "A", ">4f", lambda _, f: f.motor_current_a),
}


def _now(view: View) -> FreezeFrame:
    i, o = view.inputs, view.outputs
    return FreezeFrame(
        o.mode, view.estimates.speed_mps, o.demanded_deceleration_mps2, (i.pedal_1, i.pedal_2), i.pressure_pa,
        i.motor_current_a,
    )  # fmt: skip


def _of_group(group: Group) -> Identifier:
    size = struct.calcsize(group.form)
    return Identifier(group.name, group.unit, group.form, size, lambda view: group.encode(view.time_s, _now(view)))


def _of_quantity(quantity: quantities.Quantity) -> Identifier:
    return Identifier(
        quantity.name, quantity.unit, ">Bf", quantities.RECORD_BYTES, lambda view: quantities.record(quantity, view)
    )


def _of_parameter(one: calibration.Parameter) -> Identifier:
    form = f">{one.numbers}d" if one.numbers else "text"
    return Identifier(
        f"{one.table}.{one.name}", one.unit, form, one.size, lambda view: calibration.read(one, view.parameters)
    )


IDENTIFIERS: dict[int, Identifier] = {
    **{did: _of_group(group) for did, group in SNAPSHOT.items()},
    **{did: _of_parameter(one) for did, one in calibration.PARAMETERS.items()},
    **IDENTIFICATION,
    **{FIRST_QUANTITY + i: _of_quantity(quantity) for i, quantity in enumerate(quantities.QUANTITIES)},
}
"""All that can be read from a view; the active session and the tester's demands are the server's."""
