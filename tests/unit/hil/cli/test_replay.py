"""`replay --wait-for`: an identifier is read as it is meant, or not at all."""

import pytest

from hil.bench.replay_selection import ReplayError
from hil.cli.replay import _identifier
from hil.log.signals.databases import Databases

OWN = Databases.own()


@pytest.mark.parametrize(
    ("text", "can_id"), [("0x714", 0x714), ("0X1a0", 0x1A0), ("0x18DAF101", 0x18DAF101), ("BRAKE_STATUS", 0x130)]
)
def test_an_identifier_in_hexadecimal_or_a_message(text, can_id):
    assert _identifier(text, OWN) == can_id


@pytest.mark.parametrize("text", ["714", "7E8", "0x", "0x20000000", "0x-1", "0x7_14", "-0x1", " 0x1", "NOBODY", ""])
def test_what_may_be_meant_otherwise_is_refused(text):
    with pytest.raises(ReplayError, match=r"--wait-for .*: expected an identifier in hexadecimal with 0x, as"):
        _identifier(text, OWN)
