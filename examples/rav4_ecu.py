"""A brake controller that knows a Toyota RAV4's database and nothing of ours: deceleration from the pedal, every 20 ms.

brakebench run --without ecu --bus loopback:demo &
brakebench gateway examples/rav4_gateway.toml --bus loopback:demo --to loopback:rav4 &
python examples/rav4_ecu.py brakebench rav4          # python-can interface and channel; or: socketcan vcan0
"""

import sys
import time
from pathlib import Path

import cantools

DATABASE = cantools.database.load_file(Path(__file__).with_name("rav4_brake.dbc"), database_format="dbc")
BRAKE, ACC = (DATABASE.get_message_by_name(name) for name in ("BRAKE", "ACC_CONTROL"))
FULL_PEDAL_MPS2 = 5.4


def toyota_sum(can_id, data):
    """Last byte of many messages: length, identifier and all bytes before it, added up."""
    return (len(data) + (can_id >> 8) + (can_id & 0xFF) + sum(data[:-1])) & 0xFF


def command(brake):
    """Payload of ACC_CONTROL out of the last one of BRAKE, None before the first."""
    amount = 0.0 if brake is None else BRAKE.decode(brake)["BRAKE_AMOUNT"] / 255.0
    data = bytearray(ACC.encode({"ACCEL_CMD": -FULL_PEDAL_MPS2 * amount, "CHECKSUM": 0}, padding=False))
    data[-1] = toyota_sum(ACC.frame_id, data)
    return bytes(data)


def main(interface, channel):
    """Command what the pedal asks for, for ever."""
    import can

    brake, due = None, time.monotonic()
    with can.Bus(interface=interface, channel=channel) as bus:
        while True:
            while (frame := bus.recv(max(0.0, due - time.monotonic()))) is not None:
                if frame.arbitration_id == BRAKE.frame_id and not frame.is_error_frame:
                    brake = bytes(frame.data)
            bus.send(can.Message(arbitration_id=ACC.frame_id, data=command(brake), is_extended_id=False))
            due += 0.02


if __name__ == "__main__":
    main(*sys.argv[1:3])
