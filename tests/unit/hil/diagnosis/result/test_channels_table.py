"""The table of what was read: one row a channel, over all logs."""

import numpy as np

from hil.diagnosis.data.channels_read import channels_read
from hil.diagnosis.data.read import from_frame
from hil.diagnosis.result.channels_table import channels_section


def test_a_channel_of_several_logs_is_one_row() -> None:
    t = np.arange(300) * 0.01
    logs = [from_frame({"t_s": t * k, "speed_mps": 20.0 - t, "ax_mps2": np.where(t < 1.0, np.nan, -k)}) for k in (1, 2)]
    (table,) = channels_section({"channels_read": channels_read(logs)}).tables
    speed, ax = table.rows
    assert speed == ("speed_mps", "m/s", "50 to 100", 0, 0.0, "17 to 20", None)
    assert ax == ("ax_mps2", "m/s2", "50 to 100", 0, 33.3, "-2 to -1", None)
