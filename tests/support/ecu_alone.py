"""The controller's node with frames made for it, and its unit on a bus."""

from dbc.batch import Batch
from dbc.contract import spec_of
from ecu.node import SOURCES, EcuNode
from hil.fmu.ecu_unit import EcuUnit
from hil.scenario.scenario import load_scenario

PARAMETERS = load_scenario("stop72").ecu
SI = {
    "BRAKE_PEDAL.PEDAL_TRAVEL_1": 0.5,
    "BRAKE_PEDAL.PEDAL_TRAVEL_2": 0.5,
    "BATTERY_STATUS.STATE_OF_CHARGE": 0.7,
    "BATTERY_STATUS.CHARGE_POWER_LIMIT": 5e4,
    "WHEEL_SPEED_FRONT.WHEEL_SPEED_FL": 60.0,
    "WHEEL_SPEED_FRONT.WHEEL_SPEED_FR": 60.0,
    "WHEEL_SPEED_REAR.WHEEL_SPEED_RL": 60.0,
    "WHEEL_SPEED_REAR.WHEEL_SPEED_RR": 60.0,
}


def values(pedal=0.5):
    """Inputs as the node's messages hold them."""
    specs = [spec_of(kind) for kind in SOURCES]
    fields = [f"{spec.name}.{field.signal}" for spec in specs for field in spec.fields]
    told = SI | {"BRAKE_PEDAL.PEDAL_TRAVEL_1": pedal, "BRAKE_PEDAL.PEDAL_TRAVEL_2": pedal}
    return fields, [told.get(name, 0.0) for name in fields]


class Alone:
    """The controller's node with frames made for it."""

    def __init__(self):
        self.node, self.batch, self.now_ns = EcuNode(PARAMETERS), Batch(SOURCES), 0

    def frames(self, pedal=0.5):
        self.batch.values[:] = values(pedal)[1]
        return self.batch.frames(self.now_ns)

    def tick(self, inbox):
        return self.node.step(self.now_ns, inbox)


def on_bus():
    one = EcuUnit(PARAMETERS, on_bus=True)
    one.initialise()
    return one
