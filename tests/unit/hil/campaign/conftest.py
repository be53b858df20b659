import pytest


@pytest.fixture
def planned(tmp_path):
    """Write a campaign of a short stop and return its path."""
    (tmp_path / "short.toml").write_text(
        """title = "short stop"
[start]
speed_mps = 5.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.6]]
[end]
duration_s = 8.0
after_standstill_s = 0.1
[expect.stop_distance_m]
max = 6.0
[[faults]]
fault = "lost"
on = "WHEEL_SPEED_FRONT"
share = 0.1
"""
    )

    def write(text, name="campaign.toml"):
        path = tmp_path / name
        path.write_text('scenarios = ["short.toml"]\n' + text)
        return path

    return write
