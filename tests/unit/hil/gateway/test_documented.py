"""The TOML and the edits that docs/gateway.md shows."""

import re
from pathlib import Path

from hil.gateway.database import load
from hil.gateway.map import load_map
from hil.gateway.protection import Profile2, ToyotaSum
from hil.gateway.restbus import RestBus, sendings

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs" / "gateway.md").read_text()
MAP, SETTINGS = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
EDITS = re.findall(r"^    (\w+(?:\.\w+)?=\S+)$", PAGE, re.MULTILINE)
THEIRS = """VERSION ""
BU_: CAR ACC
BO_ 170 WHEEL_SPEEDS: 8 CAR
 SG_ WHEEL_SPEED_FL : 0|16@1+ (0.01,0) [0|0] "km/h" ACC
 SG_ WHEEL_SPEED_FR : 16|16@1+ (0.01,0) [0|0] "km/h" ACC
 SG_ BRAKE_PRESSED : 32|1@1+ (1,0) [0|0] "" ACC
 SG_ MODE : 33|2@1+ (1,0) [0|0] "" ACC
 SG_ COUNTER : 40|4@1+ (1,0) [0|0] "" ACC
BO_ 835 ACC_CONTROL: 8 ACC
 SG_ ACCEL_CMD : 16|16@1- (0.001,0) [0|0] "m/s^2" CAR
VAL_ 170 MODE 0 "OFF" 2 "READY" ;
"""


def test_the_map_of_the_page(tmp_path):
    (tmp_path / "their.dbc").write_text(THEIRS)
    (tmp_path / "map.toml").write_text(MAP)
    found = load_map(tmp_path / "map.toml")
    (sent,), (heard,), (ours,) = found.theirs, found.heard, found.ours
    assert (sent.sending.cycle_ns, sent.sending.protection) == (12_000_000, ToyotaSum(170))
    assert (sent.sending.counter, sent.sending.start["MODE"]) == (("COUNTER", 15), 2)
    assert sent.oldest_ns == {"WHEEL_SPEED_FRONT": 25_000_000, "BRAKE_PEDAL": 25_000_000}
    assert heard.protection == Profile2(bytes(range(1, 17)))
    assert heard.oldest_ns == 50_000_000
    assert ours.spec.name == "EHB_DEMAND_FRONT"


def test_settings_and_edits_of_the_page(tmp_path):
    (tmp_path / "settings.toml").write_text(SETTINGS)
    chosen = sendings(load(ROOT / "examples" / "rav4_brake.dbc"), ["CAR"], tmp_path / "settings.toml")
    restbus = RestBus(chosen)
    assert len(EDITS) == 4
    assert [restbus.edit(line) for line in EDITS] == [
        "SPEED.SPEED = 30.5 km/h", "BRAKE_2.BRAKE_PRESSED = 1", "SPEED off", "SPEED on",
    ]  # fmt: skip
