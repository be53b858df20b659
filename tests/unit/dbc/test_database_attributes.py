"""What a DBC's attributes and letters say: cycle times, senders, J1939, end-to-end protection, code pages."""

import pytest

from dbc.database import Message, Signal, parse_database

SIGNAL = ' SG_ S : 0|8@1+ (1,0) [0|0] "" B\n'
J1939 = 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'


def message(text, key):
    return parse_database(text.encode()).messages[key]


def test_cycle_time_comes_from_the_message_or_by_default():
    text = "BO_ 1 M: 8 A\nBO_ 2 N: 8 A\nBO_ 3 O: 8 A\n"
    text += 'BA_DEF_ BO_ "GenMsgCycleTime" FLOAT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 100;\n'
    text += 'BA_ "GenMsgCycleTime" BO_ 2 2.5;\nBA_ "GenMsgCycleTime" BO_ 3 0;\n'
    database = parse_database(text)
    assert [m.cycle_time_ms for m in database.messages.values()] == [100, 2.5, None]


def test_sender_comment_bit_rate_and_data_id():
    text = "BO_ 1 M: 8 Vector__XXX\nBO_ 2 N: 8 B\nBO_TX_BU_ 1 : X,Y;\n"
    text += 'CM_ BO_ 1 "first;\nsecond";\nBA_DEF_ "Baudrate" INT 0 1000000;\nBA_DEF_DEF_ "Baudrate" 500000;\n'
    text += 'BA_DEF_DEF_ "E2EDataID" 0;\nBA_ "E2EDataID" BO_ 2 45216;\n'
    database = parse_database(text)
    m, n = database.messages.values()
    assert (m.sender, m.comment, m.e2e_data_id) == ("X", "first;\nsecond", None)
    assert (n.sender, n.comment, n.e2e_data_id) == ("B", "", 45216)
    assert database.bit_rate == 500_000
    assert parse_database(text + 'BA_ "Baudrate" 250000;\n').bit_rate == 250_000
    assert parse_database("BO_ 1 M: 8 A\n").bit_rate is None


@pytest.mark.parametrize(
    ("statements", "expected"),
    [
        (J1939 + 'BA_ "VFrameFormat" BO_ 2364540158 3;', (True, False)),
        (J1939 + 'BA_ "VFrameFormat" BO_ 2364540158 "J1939PG";', (True, False)),
        (J1939 + 'BA_DEF_DEF_ "VFrameFormat" "J1939PG";', (True, False)),
        (J1939 + 'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2364540158 1;', (False, False)),
        ('BA_ "ProtocolType" "J1939";', (True, False)),
        ('BA_DEF_DEF_ "ProtocolType" "J1939";', (True, False)),
        (J1939 + 'BA_ "ProtocolType" "J1939";\nBA_ "VFrameFormat" BO_ 2364540158 1;', (False, False)),
        ('BA_ "VFrameFormat" BO_ 2364540158 15;', (False, True)),
        ('BA_DEF_ BO_ "VFrameFormat" INT 0 15;\nBA_ "VFrameFormat" BO_ 2364540158 14;', (False, True)),
        (J1939 + 'BA_ "VFrameFormat" BO_ 2364540158 9;', (False, False)),
        ("", (False, False)),
    ],
)
def test_frame_format(statements, expected):
    database = parse_database(f"BO_ 2364540158 EEC1: 8 A\n{SIGNAL}BO_ 5 S: 8 A\n{statements}\n")
    eec1 = database.messages[0xCF004FE, True]
    assert (eec1.pgn_match, eec1.is_fd) == expected
    assert not database.messages[5, False].pgn_match  # J1939 has 29-bit identifiers alone


def test_a_parameter_group_number_leaves_out_a_destination():
    assert Message("EEC1", 0x0CF004FE, True, 8, ()).pgn == 0xF004
    assert Message("TSC1", 0x0C00FE0B, True, 8, ()).pgn == 0x0000  # PDU1: the byte FE is the destination
    assert Message("REQUEST", 0x18EAFF17, True, 8, ()).pgn == 0xEA00
    assert Message("PAGE1", 0x19F004FE, True, 8, ()).pgn == 0x1F004


def test_a_transported_message_may_have_1785_bytes():
    last = ' SG_ Last : 14272|8@1+ (1,0) [0|0] "" B\n'
    database = parse_database("BO_ 2566834686 DM1: 1785 A\n" + last + "BO_ 2566834687 TOO: 1786 A\n")
    assert [(m.name, m.length, len(m.signals)) for m in database.messages.values()] == [("DM1", 1785, 1)]
    assert "1786 bytes" in database.warnings[0]


CHINESE = '\n SG_ a : 0|8@1+ (1,0) [0|35] "℃" B\nCM_ SG_ 1 a "电池温度";\nVAL_ 1 a 0 "关闭" 1 "打开" ;\n'
JAPANESE = CHINESE.replace("电池温度", "バッテリーの温度").replace("关闭", "閉").replace("打开", "開く")


@pytest.mark.parametrize(
    ("text", "encoding", "said"),
    [
        (CHINESE, "gb18030", "not Windows-1252"),
        (JAPANESE, "cp932", "not Windows-1252"),
        ('\n SG_ a : 0|8@1+ (1,0) [0|35] "°C" B\nCM_ SG_ 1 a "Größe der Öl-Wärme über µ² ± 5 Ü";\n', "cp1252", None),
        ('\n SG_ a : 0|8@1+ (1,0) [0|35] "°C" B\nCM_ SG_ 1 a "Pression – différée à l’arrêt";\n', "cp1252", None),
        ('\n SG_ a : 0|8@1+ (1,0) [0|35] "µ°" B\n', "cp1252", None),
        (CHINESE, "utf-8", None),
        (CHINESE, "utf-8-sig", None),
        (CHINESE, "utf-16", None),
    ],
)  # fmt: skip
def test_letters_are_read_as_what_they_look_like(text, encoding, said):
    whole = f"BO_ 1 M: 8 A{text}"
    database = parse_database(whole.encode(encoding))
    assert database.messages == parse_database(whole).messages
    assert len(database.warnings) == (said is not None)
    assert said is None or said in database.warnings[0]


def test_bytes_that_are_no_text_of_any_kind_are_replaced():
    database = parse_database(b'BO_ 1 M: 8 A\n SG_ a : 0|8@1+ (1,0) [0|35] "\x81x\xe9" B\n')
    assert database.messages[1, False].signals[0].unit == "\N{REPLACEMENT CHARACTER}xé"
    assert "line 2" in database.warnings[0]


@pytest.mark.parametrize(
    ("start", "length", "big_endian"),
    [
        (0, 1, False),
        (3, 17, False),
        (60, 4, False),
        (7, 1, True),
        (7, 64, True),
        (2, 3, True),
        (5, 13, True),
        (0, 9, True),
    ],
)
def test_the_mask_of_a_signal_has_its_bits(start, length, big_endian):
    signal = Signal("S", start, length, big_endian, False, False, 1, 0, "", None, None, {})
    bits, bit = set(), start
    for _ in range(length):
        bits.add(bit)
        bit = bit + 1 if not big_endian else bit - 1 if bit % 8 else bit + 15
    assert signal.mask() == sum(1 << b for b in bits)
