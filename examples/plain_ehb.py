"""An electro-hydraulic brake in plain python-can and cantools: pressures follow their demands with a lag of 50 ms.

brakebench run --without plant --bus loopback:demo &
brakebench plant --play sensors,iwm,battery,driver --bus loopback:demo &
python examples/plain_ehb.py brakebench demo          # python-can interface and channel; or: socketcan vcan0
"""

import sys
import time
from importlib.resources import files

import can
import cantools

AXLES = {"FRONT": ("FL", "FR"), "REAR": ("RL", "RR")}
PERIOD_S, LAG_S = 0.01, 0.05


def crc8(data, crc=0):
    """AUTOSAR end-to-end profile 1A: polynomial 0x1D, start and final XOR 0."""
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc


database = cantools.database.load_string((files("dbc") / "brake.dbc").read_text(), "dbc")
demands = {database.get_message_by_name(f"EHB_DEMAND_{axle}").frame_id: axle for axle in AXLES}
wheels = [wheel for axle in AXLES.values() for wheel in axle]
demand, pressure, counter, due = dict.fromkeys(wheels, 0.0), dict.fromkeys(wheels, 0.0), 0, time.monotonic()
with can.Bus(interface=sys.argv[1], channel=sys.argv[2]) as bus:
    while True:
        while (frame := bus.recv(max(0.0, due - time.monotonic()))) is not None:
            if frame.arbitration_id in demands and not frame.is_error_frame:
                values = database.decode_message(frame.arbitration_id, frame.data, decode_choices=False)
                for wheel in AXLES[demands[frame.arbitration_id]]:
                    if values[f"PRESSURE_DEMAND_{wheel}"] <= 250.0:  # above: not available
                        demand[wheel] = values[f"PRESSURE_DEMAND_{wheel}"]
        for wheel in wheels:
            pressure[wheel] += (demand[wheel] - pressure[wheel]) * PERIOD_S / LAG_S
        for axle, both in AXLES.items():
            message = database.get_message_by_name(f"EHB_PRESSURE_{axle}")
            values = {f"PRESSURE_{wheel}": pressure[wheel] for wheel in both} | {f"EHB_STATE_{axle}": 0}
            payload = bytearray(message.encode(values | {"ALIVE_COUNTER": counter, "CRC": 0}))
            payload[0] = crc8(message.dbc.attributes["E2EDataID"].value.to_bytes(2, "little") + payload[1:])
            bus.send(can.Message(arbitration_id=message.frame_id, data=payload, is_extended_id=False))
        counter, due = (counter + 1) % 15, due + PERIOD_S
