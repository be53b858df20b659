import pytest

from plant.battery import charge_limit
from plant.motor import derating, fade_out, torque_limit, torque_rate, winding_rate


@pytest.mark.parametrize(
    ("speed", "torque"), [(0.0, 700.0), (50.0, 700.0), (-50.0, 700.0), (150.0, 500.0), (-150.0, 500.0), (158.0, 0.0)]
)
def test_map(plain, speed, torque):
    assert plain(torque_limit)(speed, 700.0, 75e3, 157.0) == pytest.approx(torque)


@pytest.mark.parametrize(("speed", "share"), [(0.0, 0.0), (0.8, 0.0), (1.8, 0.5), (2.8, 1.0), (-2.8, 1.0), (30.0, 1.0)])
def test_fade_out(plain, speed, share):
    assert plain(fade_out)(speed, 0.8, 2.8) == pytest.approx(share)


@pytest.mark.parametrize(("kelvin", "share"), [(300.0, 1.0), (393.15, 1.0), (408.15, 0.5), (423.15, 0.0), (500.0, 0.0)])
def test_derating(plain, kelvin, share):
    assert plain(derating)(kelvin, 393.15, 423.15) == pytest.approx(share)


def test_lag_and_rate_limit(plain):
    assert plain(torque_rate)(-10.0, 0.0, 0.008, 5000.0) == pytest.approx(-1250.0)
    assert plain(torque_rate)(-500.0, 0.0, 0.008, 5000.0) == -5000.0
    assert plain(torque_rate)(500.0, 0.0, 0.008, 5000.0) == 5000.0


def test_400_nm_for_ever_reaches_the_start_of_derating(plain, paper_car):
    m = paper_car.motor
    loss = m.copper_loss_w_nm2 * 400.0**2
    rate = plain(winding_rate)(m.derating_start_k, loss, 293.15, m.winding_resistance_k_w, m.winding_time_s)
    assert abs(rate) * m.winding_time_s < 1.0


@pytest.mark.parametrize(("soc", "power"), [(0.0, 80e3), (0.9, 80e3), (0.925, 40e3), (0.95, 0.0), (1.0, 0.0)])
def test_charge_limit(plain, soc, power):
    assert plain(charge_limit)(soc, 80e3, 0.90, 0.95) == pytest.approx(power)
