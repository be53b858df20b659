"""A controller of your own as an object: anything with ``step(now_ns, inbox) -> frames`` takes the ECU's place.

python examples/own_ecu.py                    # in virtual time
python examples/own_ecu.py loopback:demo      # as a process, beside `brakebench run --without ecu --bus loopback:demo`
"""

import sys

from dbc.exchange import Receiver, Transmitter
from dbc.frame import Frame, Received
from dbc.messages import (
    BrakeMode,
    BrakePedal,
    BrakeStatus,
    EhbDemandFront,
    EhbDemandRear,
    MotorDemandFront,
    MotorDemandRear,
)
from hil.bench.node_process import ECU, serve
from hil.bench.result import measure
from hil.bench.virtual import simulate
from hil.scenario.scenario import load_scenario

FULL_PRESSURE_PA = 70e5


class PedalFollower:
    """Pressure from the pedal, motors at rest; `Receiver` and `Transmitter` do the end-to-end protection."""

    def __init__(self) -> None:
        self._receiver = Receiver((BrakePedal,))
        self._transmitter = Transmitter()

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Every 10 ms: take what arrived, send what follows from it."""
        self._receiver.accept(now_ns, inbox)
        pedal = self._receiver.latest(BrakePedal)
        travel = 0.0 if pedal is None else pedal.pedal_travel_1 or 0.0
        pressure = FULL_PRESSURE_PA * travel**2
        return self._transmitter.frames(
            now_ns,
            [
                EhbDemandFront(pressure, pressure),
                EhbDemandRear(pressure, pressure),
                MotorDemandFront(0.0, 0.0),
                MotorDemandRear(0.0, 0.0),
                BrakeStatus(BrakeMode.NORMAL, 0, 0.0, None),
            ],
        )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        serve(ECU, PedalFollower, sys.argv[1], say=print)
    else:
        result = measure(simulate(load_scenario("stop72"), ecu=PedalFollower()))
        print(f"stopped within {result.stop_distance_m:.1f} m")
