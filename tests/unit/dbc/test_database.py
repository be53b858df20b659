import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc.contract import database_text
from dbc.database import MAX_TEXT_BYTES, DatabaseError, parse_database
from dbc.frame import BusName

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n'
SOUND = 'BO_ 100 SOUND: 8 A\n SG_ X : 0|8@1+ (0.5,-1) [0|0] "km/h" B\n'


def parse(*lines, encoding="utf-8"):
    return parse_database((HEAD + SOUND + "\n".join(lines) + "\n").encode(encoding), "test.dbc")


def assert_warns(database, *words):
    assert any(all(word in warning for word in words) for warning in database.warnings), database.warnings


def test_a_sound_signal_comes_with_everything():
    database = parse(
        "BO_ 2566844672 EXT: 8 A",
        ' SG_ Y : 7|16@0- (0.01,-67.67) [-10|10] "°C" B',
        "BO_ 5 F: 8 A",
        ' SG_ Z : 0|32@1- (1,0) [0|0] "" B',
        "SIG_VALTYPE_ 5 Z : 1;",
        'VAL_ 2566844672 Y 0 "off" 1 "on" ;',
    )
    assert database.warnings == ()
    message = database.messages[0x18FEF100 & 0x1FFFFFFF, True]
    signal = message.signals[0]
    assert (message.name, message.length) == ("EXT", 8)
    assert (signal.start, signal.length, signal.big_endian, signal.signed) == (7, 16, True, True)
    assert (signal.factor, signal.offset, signal.unit) == (0.01, -67.67, "°C")
    assert (signal.minimum, signal.maximum, signal.choices) == (-10, 10, {0: "off", 1: "on"})
    assert signal.first_bit == 0
    single = database.messages[5, False].signals[0]
    assert (single.is_float, single.signed) == (True, False)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (['BO_ 1 M: 8 A', ' SG_ S : 0|999999@1+ (1,0) [0|0] "" B'], ("M.S", "999999")),
        (['BO_ 1 M: 8 A', ' SG_ S : 0|0@1+ (1,0) [0|0] "" B'], ("M.S", "length 0")),
        (['BO_ 1 M: 8 A', ' SG_ S : 60|8@1+ (1,0) [0|0] "" B'], ("M.S", "do not fit")),
        (['BO_ 1 M: 8 A', ' SG_ S : 56|9@0+ (1,0) [0|0] "" B'], ("M.S", "do not fit")),
        (['BO_ 1 M: 8 A', ' SG_ S : 0|24@1- (1,0) [0|0] "" B', "SIG_VALTYPE_ 1 S : 1;"], ("M.S", "floating point")),
        (['BO_ 1 M: 8 A', ' SG_ S : 0|8@1+ (1e999,0) [0|0] "" B'], ("M.S", "factor")),
        (['BO_ 1099511627776 M: 8 A', ' SG_ S : 0|8@1+ (1,0) [0|0] "" B'], ("message M", "identifier")),
        (['BO_ 2048 M: 8 A', ' SG_ S : 0|8@1+ (1,0) [0|0] "" B'], ("message M", "identifier 0x800")),
        (['BO_ 1 M: 1785 A', ' SG_ S : 0|8@1+ (1,0) [0|0] "" B'], ("message M", "1785 bytes")),
        (['BO_ 1 M: 8 A', ' SG_ S : what@1+'], ("line 8", "SG_ S : what@1+", "expected SG_ NAME")),
        (['BO_ 1 M: 8 A', ' SG_ S : 0|8@1+ (nan,0) [0|0] "" B'], ("line 8", "M.S", "factor nan", "left out")),
        (
            ['BO_ 1 M: 8 A', ' SG_ P m0M : 0|8@1+ (1,0) [0|0] "" B', ' SG_ S m0M : 8|8@1+ (1,0) [0|0] "" B',
             "SG_MUL_VAL_ 1 S P 0-0;", "SG_MUL_VAL_ 1 P S 0-0;"],
            ("M.", "left out"),
        ),
    ],
)  # fmt: skip
def test_an_unsound_signal_or_message_is_left_out_and_said(lines, words):
    database = parse(*lines)
    assert_warns(database, *words)
    assert "S" not in {s.name for m in database.messages.values() for s in m.signals}
    assert database.messages[100, False].signals[0].unit == "km/h"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (['BO_ 1 M: 8 A', ' SG_ S : 0|8@1+ (1,0) [0|0] "" B', 'VAL_ 1 T 0 "x" ;'], ("VAL_", "no such signal")),
        (['BO_ 1 M: 8 A', "SIG_VALTYPE_ 7 S : 1;"], ("SIG_VALTYPE_", "no such signal")),
        (['BA_ "Empty";'], ("line 7", "cannot be read")),
        (['CM_ "never closed'], ("line 7", "never closed")),
        (
            ['BO_ 1 M: 8 A', ' SG_ P M : 0|8@1+ (1,0) [0|0] "" B', ' SG_ S m0 : 8|8@1+ (1,0) [0|0] "" B',
             "SG_MUL_VAL_ 1 S P 0-99999999999;"],
            ("M.S", "multiplexer"),
        ),
    ],
)  # fmt: skip
def test_an_unsound_statement_is_left_out_and_said(lines, words):
    database = parse(*lines)
    assert_warns(database, *words)
    assert database.messages[100, False].signals[0].unit == "km/h"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (['BO_ 1 M: 8 A', ' SG_ S : 0|8@1+ (1,0) [0|0] "" B', ' SG_ T : 4|8@1+ (1,0) [0|0] "" B'], ("M.T", "overlaps")),
        (['BO_ 1 M: 8 A', ' SG_ S : 7|8@0+ (1,0) [0|0] "" B', ' SG_ T : 0|4@1+ (1,0) [0|0] "" B'], ("overlaps",)),
        (['BO_ 1 M: 8 A', ' SG_ S : 0|8@1+ (0,5) [0|0] "" B'], ("M.S", "factor 0")),
        (['BO_ 1 M: 8 A', ' SG_ S : 0|8@1+ (1,0) [9|1] "" B'], ("M.S", "minimum 9")),
    ],
)  # fmt: skip
def test_what_is_odd_is_kept_and_said(lines, words):
    database = parse(*lines)
    assert_warns(database, *words)
    signals = {s.name: s for s in database.messages[1, False].signals}
    assert "S" in signals
    assert signals["S"].minimum in (None, 0)


def test_branches_of_a_multiplexer_may_overlap():
    database = parse(
        'BO_ 1 M: 8 A', ' SG_ P M : 0|8@1+ (1,0) [0|0] "" B', ' SG_ S m0 : 8|8@1+ (1,0) [0|0] "" B',
        ' SG_ T m1 : 8|8@1+ (1,0) [0|0] "" B',
    )  # fmt: skip
    assert database.warnings == ()
    by_name = {s.name: s for s in database.messages[1, False].signals}
    assert (by_name["T"].multiplexer, by_name["T"].mux_ranges) == ("P", ((1, 1),))
    database = parse(
        'BO_ 1 M: 8 A', ' SG_ P M : 0|8@1+ (1,0) [0|0] "" B', ' SG_ S m0 : 8|8@1+ (1,0) [0|0] "" B',
        ' SG_ T m0 : 12|8@1+ (1,0) [0|0] "" B', ' SG_ U : 16|8@1+ (1,0) [0|0] "" B',
    )  # fmt: skip
    assert_warns(database, "M.T", "overlaps M.S")
    assert_warns(database, "M.T", "overlaps M.U")


def test_the_last_of_two_messages_with_one_identifier_is_used():
    database = parse("BO_ 1 M: 8 A", "BO_ 1 N: 8 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" B')
    assert database.messages[1, False].name == "N"
    assert_warns(database, "0x1", "M and N")


def test_two_messages_of_one_name_are_told_apart():
    database = parse("BO_ 1 M: 8 A", "BO_ 2 M: 8 A")
    assert {m.name for m in database.messages.values()} == {"SOUND", "M", "M_2"}
    assert_warns(database, "message M", "used twice")


def test_windows_text_keeps_its_letters():
    database = parse("BO_ 1 M: 8 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "µ°" B', encoding="cp1252")
    assert database.messages[1, False].signals[0].unit == "µ°"
    assert database.warnings == ()


def test_letters_outside_ascii_in_a_name():
    database = parse("BO_ 1 LÜFTER: 8 A", ' SG_ S : 0|8@1+ (1,0) [0|0] "" B')
    assert database.messages[1, False].name == "L_FTER"
    assert_warns(database, "line 7", "ASCII")


def test_a_comment_that_quotes_a_message_is_a_comment():
    database = parse('CM_ "see\nBO_ 9 GHOST: 8 A\n SG_ S : 0|999999@1+ (1,0) [0|0] m";')
    assert database.warnings == ()
    assert set(database.messages) == {(100, False)}


def test_independent_signals_are_passed_over_silently():
    database = parse('BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX', ' SG_ S : 0|8@1+ (1,0) [0|0] "" B',
                     'VAL_ 3221225472 S 0 "x" ;')  # fmt: skip
    assert database.warnings == ()


@pytest.mark.parametrize("content", [b"", b"hello", b"\0" * 100, b"<xml/>", HEAD.encode(), b" " * (MAX_TEXT_BYTES + 1)])
def test_what_is_no_database_is_refused_with_the_file(content):
    with pytest.raises(DatabaseError, match=r"^x\.dbc: "):
        parse_database(content, "x.dbc")


OURS = database_text(BusName.VEHICLE)


@settings(max_examples=60)
@given(st.integers(0, len(OURS) - 1), st.integers(0, 40), st.text(max_size=6))
def test_a_damaged_database_loads_or_is_refused(at, length, text):
    damaged = OURS[:at] + text + OURS[at + length :]
    try:
        database = parse_database(damaged.encode("utf-8", "surrogatepass"))
    except DatabaseError:
        return
    assert database.messages
