"""``brakebench compare`` as a user runs it."""

import json

import pytest


@pytest.mark.slow
def test_virtual_and_real_time_agree(brakebench, channel, tmp_path, short):
    result = json.loads(brakebench("compare", short, "--bus", channel, "--json", "--out", "both", check=(0, 4)).stdout)
    distance, lateness = result["stop_distance_m"], result["lateness_ms"]
    print("stop distance", distance, "lateness", lateness, "overruns", result["overruns"])
    # the phases of the processes are those of virtual time; what a busy machine adds is some ticks
    assert abs(distance["difference"]) < 0.02 * distance["virtual"] + 5.0 * 1e-3 * lateness["max"]
    ages = {row["message"]: row for row in result["latency"]}
    assert ages["BRAKE_PEDAL"]["virtual_ms"] == {"p50": 5.0, "p99": 5.0, "max": 5.0}
    assert 0.0 < ages["EHB_DEMAND_FRONT"]["real_ms"]["p50"] < 100.0
    assert len(result["signals"]) > 60
    for name in ("log_virtual", "log_real", "figure", "page"):
        assert (tmp_path / result[name]).exists()
