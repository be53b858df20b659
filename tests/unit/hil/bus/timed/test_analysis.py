"""The analysis of a database: what is bounded, what is left out, what is missed."""

from dbc.database import parse_database
from dbc.frame_length import FrameBits
from hil.bus.timed.analysis import analyse
from hil.bus.timed.frame_length import most_bits

DBC = """VERSION ""
BU_: A B
BO_ 256 URGENT: 7 A
 SG_ S : 0|8@1+ (1,0) [0|0] "" B
BO_ 512 MIDDLE: 7 A
 SG_ S : 0|8@1+ (1,0) [0|0] "" B
BO_ 768 LAST: 7 B
 SG_ S : 0|8@1+ (1,0) [0|0] "" A
BO_ 769 EVENT: 8 B
 SG_ S : 0|8@1+ (1,0) [0|0] "" A
BO_ 770 LONG: 64 B
 SG_ S : 0|8@1+ (1,0) [0|0] "" A
BA_DEF_ BO_ "GenMsgCycleTime" FLOAT 0 65535;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","StandardCAN_FD";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "GenMsgCycleTime" BO_ 256 2.5;
BA_ "GenMsgCycleTime" BO_ 512 3.5;
BA_ "GenMsgCycleTime" BO_ 768 3.5;
"""
WITH_FD = DBC + 'BA_ "VFrameFormat" BO_ 770 2;\nBA_ "GenMsgCycleTime" BO_ 770 100;\n'


def test_the_messages_of_the_counter_example() -> None:
    """Davis et al. 2007 from a database, and one more frame that blocks the last for 135 bits."""
    analysis = analyse(parse_database(DBC), 125_000)
    assert [one.message.name for one in analysis.messages] == ["URGENT", "MIDDLE", "LAST"]
    assert [one.transmission_ns for one in analysis.messages] == [1_000_000] * 3
    assert analysis.load == 1 / 2.5 + 2 / 3.5
    assert [one.response.blocking_ns for one in analysis.messages] == [135 * 8_000] * 3
    assert [one.message.name for one in analysis.messages if one.missed] == ["LAST"]
    left_out = {message.name: why for message, why in analysis.left_out}
    assert set(left_out) == {"EVENT", "LONG"}
    assert "no cycle time" in left_out["EVENT"]
    assert "64 bytes" in left_out["LONG"]


def test_flexible_frames_block_less_at_a_data_bit_rate() -> None:
    database = parse_database(WITH_FD)
    slow, fast = analyse(database, 500_000), analyse(database, 500_000, 2_000_000)
    for analysis, expected_ns in ((slow, 2_000), (fast, 500)):
        long = analysis.messages[-1]
        assert long.message.name == "LONG"
        nominal, data = most_bits(long.frame._replace(bit_rate_switch=True))
        assert long.transmission_ns == nominal * 2_000 + data * expected_ns
        assert analysis.messages[0].response.blocking_ns == long.transmission_ns
    assert FrameBits(*most_bits(slow.messages[-1].frame)).data == 0


def test_jitter_makes_responses_later() -> None:
    database = parse_database(DBC)
    none, some = analyse(database, 500_000), analyse(database, 500_000, jitter_ns=100_000)
    for without, late in zip(none.messages, some.messages, strict=True):
        assert without.response.response_ns is not None
        assert late.response.response_ns is not None
        assert late.response.response_ns >= without.response.response_ns + 100_000


def test_an_overloaded_bus_bounds_the_urgent_ones_only() -> None:
    analysis = analyse(parse_database(DBC), 100_000)
    assert analysis.load > 1.0
    assert [one.response.response_ns is None for one in analysis.messages] == [False, False, True]
    assert analysis.missed >= 1
