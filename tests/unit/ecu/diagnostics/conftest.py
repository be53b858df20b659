import pytest
from uds_tester import VirtualConnection, client_over


class Bench:
    """A standing car in NORMAL, its ECU, a tester and udsoncan's client."""

    def __init__(self, rig):
        self.rig = rig
        rig.car.pedal = (0.0, 0.0)
        rig.car.wheel_speed = 0.0
        rig.step(700)
        assert rig.node.memory.modes.mode == 1
        self.tester = VirtualConnection(lambda out: rig.step(1, out))
        self.client = client_over(self.tester)

    @property
    def server(self):
        return self.rig.node.diagnostics

    def drive(self):
        self.rig.car.wheel_speed = 65.0
        self.tester.step(400)

    def unlock(self):
        self.client.change_session(3)
        self.client.unlock_security_access(1)


@pytest.fixture
def bench(rig):
    return Bench(rig)
