"""Brake disc as one heat store."""

from plant.compiled import equation


@equation
def disc_temperature_rate(
    temperature_k: float,
    heat_w: float,
    speed_mps: float,
    ambient_k: float,
    heat_capacity: float,
    cooling: float,
    cooling_speed: float,
) -> float:
    """Rate of the disc temperature, K/s: C T' = Q - (h0 + h1 v)(T - Tamb).

    Limpert, Brake Design and Safety, lumped disc with convection that grows with the speed.

    Parameters
    ----------
    heat_w : Q, friction torque times wheel speed.  heat_capacity : C, J/K.
    cooling : h0, W/K.  cooling_speed : h1, W s/(m K).
    """
    return (heat_w - (cooling + cooling_speed * speed_mps) * (temperature_k - ambient_k)) / heat_capacity
