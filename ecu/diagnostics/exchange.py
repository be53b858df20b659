"""What passes between the controller's node and its diagnostics at a tick: a view in, orders out."""

import math
from typing import NamedTuple

from dbc.messages import BrakeMode
from ecu.law.estimator import Estimates
from ecu.law.trouble_codes import TroubleCode, TroubleMemory
from ecu.law.types import Four, Inputs, Outputs, Source
from ecu.parameters.ecu import EcuParameters

STANDSTILL_RAD_S = 0.3  # choice: 0.1 m/s, ten times what the wheel speed sensors' noise is
STANDSTILL_MPS = 0.5  # choice: estimated speed; a wheel speed that is stuck at 0 does not make a standstill
_WITH_DEMANDS = (BrakeMode.NORMAL, BrakeMode.DEGRADED, BrakeMode.FRICTION_ONLY)


class View(NamedTuple):
    """The controller after the law's step; the diagnostics read it and change nothing in it.

    ``pressure_zero_pa``: what the node takes off what the pressure sensors show.
    """

    time_s: float
    inputs: Inputs
    outputs: Outputs
    estimates: Estimates
    friction: Four
    troubles: TroubleMemory
    parameters: EcuParameters
    pressure_zero_pa: Four

    @property
    def standstill(self) -> bool:
        """The car stands, by every wheel speed and by the estimate."""
        limit_s = self.parameters.supervision.timeout_s
        health = self.inputs.health
        return (
            all(abs(speed) <= STANDSTILL_RAD_S for speed in self.inputs.wheel_speed_rad_s)
            and all(health[s].age_s < limit_s for s in (Source.WHEEL_SPEED_FRONT, Source.WHEEL_SPEED_REAR))
            and self.estimates.speed_mps <= STANDSTILL_MPS
        )

    @property
    def actuators_free(self) -> bool:
        """Pressure and motors may be asked for by the tester: the car stands, and the driver does not brake."""
        o = self.outputs
        return self.standstill and o.mode in _WITH_DEMANDS and o.demanded_deceleration_mps2 == 0.0


class Orders(NamedTuple):
    """What the node is to do at this tick; all of it ends with the tick but what changes the node itself.

    ``pressure_pa``, ``motor_nm``: demands in the place of the law's, NaN of a wheel that stays the law's, None where
    all do. ``silent``: no messages but those of diagnostics on the vehicle bus. ``parameters``: from now on.
    ``pressure_zero_pa``: what the sensors show without pressure, from now on. ``forget``: codes to be taken out of
    the law's memory. ``restart``: the law begins anew; ``hard``: with the parameters and the
    sensors' zero it first had.
    """

    pressure_pa: Four | None = None
    motor_nm: Four | None = None
    silent: bool = False
    parameters: EcuParameters | None = None
    pressure_zero_pa: Four | None = None
    forget: tuple[TroubleCode, ...] = ()
    restart: bool = False
    hard: bool = False


NO_ORDERS = Orders()


def instead(law: Four, tester: Four | None) -> Four:
    """The law's demands, the tester's where there is one."""
    if tester is None:
        return law
    a, b, c, d = (own if math.isnan(other) else other for own, other in zip(law, tester, strict=True))
    return (a, b, c, d)
