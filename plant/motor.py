"""In-wheel motor: map, lag, heat."""

from plant.compiled import equation


@equation
def torque_limit(speed_rad_s: float, peak_nm: float, peak_w: float, max_speed_rad_s: float) -> float:
    """Torque magnitude of the map at a wheel speed, N m: constant torque, then constant power, none above top speed."""
    speed = max(abs(speed_rad_s), 1e-3)
    return 0.0 if speed > max_speed_rad_s else min(peak_nm, peak_w / speed)


@equation
def fade_out(speed_mps: float, end_mps: float, start_mps: float) -> float:
    """Share of the braking torque left at low speed: 1 above ``start_mps``, 0 below ``end_mps``, linear between."""
    return min(max((abs(speed_mps) - end_mps) / (start_mps - end_mps), 0.0), 1.0)


@equation
def derating(winding_k: float, start_k: float, end_k: float) -> float:
    """Share of the torque left by the winding temperature: linear from 1 to 0."""
    return min(max((end_k - winding_k) / (end_k - start_k), 0.0), 1.0)


@equation
def torque_rate(demand_nm: float, torque_nm: float, time_s: float, limit_nm_s: float) -> float:
    """Rate of the motor torque, N m/s: first-order lag as in the paper (its reference 4), rate limited."""
    return min(max((demand_nm - torque_nm) / time_s, -limit_nm_s), limit_nm_s)


@equation
def winding_rate(winding_k: float, loss_w: float, ambient_k: float, resistance_k_w: float, time_s: float) -> float:
    """Rate of the winding temperature, K/s: one heat store with thermal resistance R and time constant tau."""
    return (resistance_k_w * loss_w - (winding_k - ambient_k)) / time_s
