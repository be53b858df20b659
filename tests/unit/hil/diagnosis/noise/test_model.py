"""Noise of a case: what frames wait for the bus, and the noise of largest likelihood."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from hil.diagnosis.data.log import Log, make_log
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.noise.estimate import estimate, first_guess
from hil.diagnosis.noise.model import ChannelNoise, Noise, SampleMasks, whiten, whitened

WHEELS = ("fl", "fr", "rl", "rr")
WAIT_S, NOISE_PA, RAMP_PA_S = 3e-4, 2e3, 2.5e7


def _log(rng: np.random.Generator, wait_s: float) -> tuple[Log, np.ndarray]:
    """Pressures that go up and down quickly, logged in frames that wait, and without waiting."""
    t = np.arange(6000) * 0.01
    stamps = t + wait_s * rng.exponential(1.0, len(t))

    def pressure(at: np.ndarray) -> np.ndarray:
        return 2e6 + RAMP_PA_S * (np.abs((at % 0.4) - 0.2) - 0.1)

    taken = t + wait_s * rng.exponential(1.0, len(t))
    channels = {f"wheel_speed_{w}_rad_s": np.full(len(t), 60.0) for w in WHEELS}
    for w in WHEELS:
        channels[f"pressure_{w}_pa"] = pressure(taken) + NOISE_PA * rng.standard_normal(len(t))
        channels[f"pressure_demand_{w}_pa"] = pressure(t)
    return make_log("log", stamps, channels), pressure(stamps)


def test_frames_that_wait_are_noise_where_the_pressure_is_steep() -> None:
    log, true = _log(np.random.default_rng(1), WAIT_S)
    case = prepare([log], 0.3)
    frame = SampleMasks.of(case)
    rows = len(case.recordings[0].measured["pressure"])
    exact = np.interp(log.t_s[0] + 0.01 * np.arange(2 * rows), log.t_s, true).reshape(-1, 2).mean(axis=1)
    off = {"pressure.mean": (case.recordings[0].measured["pressure"].mean(axis=1) - exact)[:, None]}
    noise = Noise({"pressure.mean": ChannelNoise(NOISE_PA / 8**0.5, 0.0, 0.0, 1.0)}, ())
    white = whiten(off, frame, noise)[0]["pressure.mean"]
    unaware = whiten(off, replace(frame, jitter_variance={}), noise)[0]["pressure.mean"]
    assert white[5:-5].std() == pytest.approx(1.0, abs=0.15)
    assert unaware[5:-5].std() > 3.0


def test_wheels_carry_the_stamps_and_regular_stamps_wait_for_nothing() -> None:
    log, _ = _log(np.random.default_rng(1), WAIT_S)
    assert not any(name.startswith("wheel") for name in SampleMasks.of(prepare([log], 0.3)).jitter_variance)
    regular, _ = _log(np.random.default_rng(1), 0.0)
    assert max(values.max() for values in SampleMasks.of(prepare([regular], 0.3)).jitter_variance.values()) < 1.0


def test_what_is_far_off_for_a_moment_does_not_make_all_noisier() -> None:
    """Noise is estimated by the likelihood that numbers are fitted by, or the one spoils what the other gains."""
    rng = np.random.default_rng(4)
    log, _ = _log(rng, 0.0)
    frame = SampleMasks.of(prepare([log], 0.3))
    samples = len(frame.log_start)
    quiet = NOISE_PA * rng.standard_normal((samples, 1))
    off = quiet.copy()
    off[samples // 2 : samples // 2 + 30] += 200.0 * NOISE_PA * rng.standard_normal((30, 1))
    sizes = []
    for values in (quiet, off):
        tracks = {"pressure.mean": values}
        start = first_guess(tracks, frame)
        noise = estimate(tracks, frame, start)
        assert whiten(tracks, frame, noise)[1] > whiten(tracks, frame, start)[1]
        track, scales = noise.tracks["pressure.mean"], noise.scales["pressure.mean"]
        sizes.append(np.hypot(track.a, track.c) * np.median(scales))
    assert sizes[0] == pytest.approx(NOISE_PA, rel=0.1)
    assert sizes[1] < 2.5 * sizes[0]


def test_the_noise_that_made_the_residual_is_estimated() -> None:
    """Force, slope and accelerometer of a car that rolls and stands: where each tells, sizes and times come back."""
    rng, n = np.random.default_rng(7), 60000
    step = 0.02
    true = {"force": (0.03, 0.8), "slope": (0.04, 3.0), "accelerometer": (0.01, 3.0)}
    colour = {}
    for name, (size, tau_s) in true.items():
        keep = np.exp(-step / tau_s)
        colour[name] = lfilter([1.0], [1.0, -keep], size * np.sqrt(1.0 - keep**2) * rng.standard_normal(n))
    rolling = (np.arange(n) % 3000 < 2500) * 1.0
    restart = (np.arange(n) % 1500 == 0) * 1.0
    speed = np.zeros(n)
    for k in range(1, n):
        pushed = colour["force"][k - 1] + colour["slope"][k - 1]
        speed[k] = 0.0 if restart[k] else speed[k - 1] + step * rolling[k - 1] * pushed
    tracks = {
        "wheel.mean": (speed + 0.003 * rng.standard_normal(n))[:, None],
        "ax": (rolling * colour["force"] + colour["accelerometer"] + 0.015 * rng.standard_normal(n))[:, None],
    }
    fresh = np.zeros(n)
    fresh[0] = 1.0
    present = {"wheel.mean": rolling * (1.0 - restart), "ax": np.ones(n)}
    frame = SampleMasks(fresh, restart, rolling, 20.0 * rolling, np.zeros(n), step, present, ("wheel.mean", "ax"))
    noise = estimate(tracks, frame, first_guess(tracks, frame))
    for (size, tau_s), known in zip(noise.disturbances, true.values(), strict=False):
        assert size == pytest.approx(known[0], rel=0.25)
        assert tau_s == pytest.approx(known[1], rel=0.4)
    assert noise.tracks["ax"].a == pytest.approx(0.015, rel=0.05)


def test_a_coloured_error_of_the_ground_speed_is_none_of_the_wheels() -> None:
    """Blamed on the wheels it was an error of 0.5 % of their speed for half a minute, and bent radius and mass."""
    rng, n, step = np.random.default_rng(5), 20000, 0.02

    def coloured(size: float, tau_s: float) -> np.ndarray:
        keep = np.exp(-step / tau_s)
        return lfilter([1.0], [1.0, -keep], size * np.sqrt(1.0 - keep**2) * rng.standard_normal(n))

    force, wrong = coloured(0.04, 1.0), coloured(0.04, 2.0)
    speed = step * np.cumsum(force)
    tracks = {
        "wheel.mean": speed + 0.004 * rng.standard_normal(n),
        "ax": force + 0.02 * rng.standard_normal(n),
        "gps": speed + wrong + 0.02 * rng.standard_normal(n),
    }
    tracks = {name: values[:, None] for name, values in tracks.items()}
    fresh = (np.arange(n) == 0) * 1.0
    ones, zeros = np.ones(n), np.zeros(n)
    frame = SampleMasks(fresh, zeros, ones, 20.0 * ones, zeros, step, dict.fromkeys(tracks, ones), tuple(tracks))
    *_, wheels, ground = estimate(tracks, frame, first_guess(tracks, frame)).disturbances
    assert ground[0] == pytest.approx(0.04, rel=0.25)
    assert ground[1] == pytest.approx(2.0, rel=0.4)
    assert wheels[0] < 0.01


@pytest.mark.parametrize("seed", range(4))
def test_a_little_colour_is_not_lost_in_much_white_noise(seed: int) -> None:
    """A search that begins with too much of it must not end with none: slow causes would explain what it leaves."""
    rng, n, step = np.random.default_rng(seed), 9000, 0.02
    white, size, tau_s = 1200.0, 360.0, 1.0
    keep = np.exp(-step / tau_s)
    colour = lfilter([1.0], [1.0, -keep], size * np.sqrt(1.0 - keep**2) * rng.standard_normal(n))
    name = "pressure.left-right front"
    tracks = {name: (colour + white * rng.standard_normal(n))[:, None]}
    fresh, zeros = (np.arange(n) % 500 == 0) * 1.0, np.zeros(n)
    frame = SampleMasks(fresh, zeros, np.ones(n), np.full(n, 20.0), zeros, step, {name: np.ones(n)}, (name,))
    track = estimate(tracks, frame, first_guess(tracks, frame)).tracks[name]
    assert track.a == pytest.approx(white, rel=0.05)
    assert track.c == pytest.approx(size, rel=0.4)


def test_no_noise_nearby_is_likelier_than_the_estimate() -> None:
    """The search ends at the least cost: every number of the moving car a little off, either way, is no better."""
    rng, n, step = np.random.default_rng(11), 6000, 0.02
    keep = np.exp(-step / 1.0)
    force = lfilter([1.0], [1.0, -keep], 0.05 * np.sqrt(1.0 - keep**2) * rng.standard_normal(n))
    speed = step * np.cumsum(force) + 0.004 * rng.standard_normal(n)
    tracks = {"wheel.mean": speed[:, None], "ax": (force + 0.02 * rng.standard_normal(n))[:, None]}
    fresh = (np.arange(n) == 0) * 1.0
    ones, zeros = np.ones(n), np.zeros(n)
    frame = SampleMasks(fresh, zeros, ones, 20.0 * ones, zeros, step, dict.fromkeys(tracks, ones), tuple(tracks))
    noise = estimate(tracks, frame, first_guess(tracks, frame))
    best = whiten(tracks, frame, noise)[1]
    for change in (0.9, 1.1):
        for name, track in noise.tracks.items():
            off = replace(noise, tracks={**noise.tracks, name: replace(track, a=track.a * change)})
            assert whiten(tracks, frame, off)[1] < best
        (size, tau_s), *others = noise.disturbances
        for first in ((size * change, tau_s), (size, tau_s * change)):
            assert whiten(tracks, frame, replace(noise, disturbances=(first, *others)))[1] < best + 0.2


@pytest.mark.parametrize(("act", "tracks"), [
    (WHEELS, {"mean", "front-rear", "left-right front", "left-right rear"}), (WHEELS[:2], {"mean", "left-right front"}),
    (WHEELS[2:], {"mean", "left-right rear"}),
])  # fmt: skip
def test_motors_of_one_axle_tell_a_torque_and_a_difference_once(act, tracks):
    """What front and rear differed by counted the mean twice, and two zeros were reported with no noise at all."""
    t = np.arange(1000) * 0.01
    channels = {f"wheel_speed_{w}_rad_s": np.full(len(t), 60.0) for w in WHEELS}
    for name in ("motor_torque", "motor_torque_demand"):
        channels |= {f"{name}_{w}_nm": -200.0 * np.sin(t) ** 2 * (w in act) for w in WHEELS}
    names = SampleMasks.of(prepare([make_log("log", t, channels)], 0.3)).names
    assert {name.removeprefix("motor.") for name in names if name.startswith("motor.")} == tracks


@pytest.mark.parametrize("measured", [("wheel.mean",), ("wheel.mean", "ax")])
def test_some_columns_are_whitened_as_among_all_where_a_channel_along_the_road_is_missing(measured) -> None:
    """Chosen columns lie otherwise in memory; a car without ground speed or acceleration could not be whitened."""
    n = 200
    rng, ones, zeros = np.random.default_rng(4), np.ones(n), np.zeros(n)
    tracks = {name: rng.standard_normal((n, 5)).astype(np.float32) for name in measured}
    fresh = (np.arange(n) == 0) * 1.0
    frame = SampleMasks(fresh, zeros, ones, 20.0 * ones, zeros, 0.02, dict.fromkeys(tracks, ones), measured)
    noise = first_guess({name: values[:, :1] for name, values in tracks.items()}, frame)
    assert np.array_equal(whitened(tracks, frame, noise, [0, 3]), whitened(tracks, frame, noise)[:, [0, 3]])


def test_a_late_ground_speed_is_not_compared_while_it_is_that_of_the_segment_before():
    """It jumps where the simulated speed is set to the measured one, and comes 0.1 to 0.2 s late: no Jacobian column of
    its latency told what a step did, and fits of a stranger's car stood still."""
    log, _ = _log(np.random.default_rng(1), 0.0)
    channels = {**log.channels, "speed_mps": np.full(len(log.t_s), 18.0)}
    frame = SampleMasks.of(prepare([make_log("log", log.t_s, channels)], 0.3))
    starts = np.flatnonzero(frame.segment_start)
    after = int(0.5 / frame.sample_s)
    assert len(starts) > 1
    for start in starts:
        assert not frame.present["gps"][start : start + after].any()
        assert frame.present["gps"][start - 5 : start].all()
        assert frame.present["gps"][start + after]
        assert frame.present["wheel.mean"][start + 1]
