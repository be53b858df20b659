"""A brake controller in plain python-can and cantools: pressure from the pedal, motors at rest, every 10 ms.

brakebench run --without ecu --bus loopback:demo &
python examples/plain_ecu.py brakebench demo          # python-can interface and channel; or: socketcan vcan0
"""

import sys
import time
from importlib.resources import files

import can
import cantools

DEMANDS = {
    "EHB_DEMAND_FRONT": ("PRESSURE_DEMAND_FL", "PRESSURE_DEMAND_FR"),
    "EHB_DEMAND_REAR": ("PRESSURE_DEMAND_RL", "PRESSURE_DEMAND_RR"),
    "MOTOR_DEMAND_FRONT": ("TORQUE_DEMAND_FL", "TORQUE_DEMAND_FR"),
    "MOTOR_DEMAND_REAR": ("TORQUE_DEMAND_RL", "TORQUE_DEMAND_RR"),
}


def crc8(data, crc=0):
    """AUTOSAR end-to-end profile 1A: polynomial 0x1D, start and final XOR 0."""
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc


database = cantools.database.load_string((files("dbc") / "brake.dbc").read_text(), "dbc")
pedal, counter, due = database.get_message_by_name("BRAKE_PEDAL"), 0, time.monotonic()
with can.Bus(interface=sys.argv[1], channel=sys.argv[2]) as bus:
    travel = 0.0
    while True:
        while (frame := bus.recv(max(0.0, due - time.monotonic()))) is not None:
            if frame.arbitration_id == pedal.frame_id and not frame.is_error_frame:
                travel = pedal.decode(frame.data, decode_choices=False)["PEDAL_TRAVEL_1"]
        pressure = 70.0 * (travel / 100.0) ** 2 if travel <= 100.0 else 0.0
        for name, signals in DEMANDS.items():
            message = database.get_message_by_name(name)
            value = pressure if name.startswith("EHB") else 0.0
            payload = bytearray(message.encode(dict.fromkeys(signals, value) | {"ALIVE_COUNTER": counter, "CRC": 0}))
            data_id = message.dbc.attributes["E2EDataID"].value
            payload[0] = crc8(data_id.to_bytes(2, "little") + payload[1:])
            bus.send(can.Message(arbitration_id=message.frame_id, data=payload, is_extended_id=False))
        counter, due = (counter + 1) % 15, due + 0.01
