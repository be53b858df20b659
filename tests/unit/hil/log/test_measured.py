import numpy as np
import pytest

from dbc.database import parse_database
from hil.log.read import read_log
from hil.log.signals.decode import decode_log


@pytest.fixture(scope="module")
def rav4(measured_data):
    database = parse_database((measured_data / "rav4" / "toyota_new_mc_pt.dbc").read_bytes(), "toyota")
    return decode_log(read_log(measured_data / "rav4" / "bus0.log"), database)


def test_every_frame_of_the_rav4_minute_is_accounted_for(rav4):
    assert rav4.frames == 53_800
    assert rav4.decoded + rav4.unknown == 53_800
    assert rav4.rejected == 0
    assert rav4.recording.truncated_at is None
    assert rav4.messages["WHEEL_SPEEDS"].rate_hz == pytest.approx(82.9, abs=0.1)


def test_rav4_wheel_speeds_equal_the_reference(rav4, measured_data):
    reference = np.loadtxt(measured_data / "rav4" / "reference_wheel_speed.csv", delimiter=",", skiprows=1)
    for column, wheel in enumerate(("FL", "FR", "RL", "RR"), start=1):
        t_s, speed_kmh = rav4.series(f"WHEEL_SPEEDS.WHEEL_SPEED_{wheel}")
        np.testing.assert_array_equal(t_s, reference[:, 0])
        np.testing.assert_allclose(speed_kmh / 3.6, reference[:, column], rtol=0, atol=5.1e-7)


def test_every_frame_of_the_motec_drive_is_accounted_for(measured_data):
    database = parse_database((measured_data / "motec" / "sample_can_spec.dbc").read_bytes(), "motec")
    log = decode_log(read_log(measured_data / "motec" / "can_sample.log"), database)
    assert (log.frames, log.decoded + log.unknown, log.rejected) == (82_558, 82_558, 0)
    t_s, speed_mps = log.series("ID_D4.WS_FL")
    assert len(t_s) == log.messages["ID_D4"].count
    assert 30.0 < speed_mps.max() < 40.0
