"""Broken DBCs: what is loaded all the same, and what is said."""

import pytest

from dbc.database import DatabaseError, parse_database
from dbc.database_values import MAX_WARNINGS

GOOD = ' SG_ OK : 56|8@1+ (1,0) [0|0] "" B'


def parse(text):
    return parse_database(text.encode(), "test.dbc")


def loaded(database, key=(1, False)):
    return {s.name: s for s in database.messages[key].signals}


# Each: lines of message 1 beside the signal OK, what S comes as (None: left out), words of one warning (None: none).
SIGNALS = [
    (' SG_ S : 0|8@1+ (1,0) [0|0] ""', (1, 0, None, None, ""), None),
    (' SG_ S : 0|8@1+ (1,0) [0|5] "-"', (1, 0, 0, 5, "-"), None),
    (' SG_ S : 0|8@1+ (.25,-500) [-500|.5] "NM" B', (0.25, -500, -500, 0.5, "NM"), None),
    (' SG_ S : 0|8@1+ (1.,+3) [1e2|2.5E+002] "" B', (1, 3, 100, 250, ""), None),
    (' SG_ S: 0|8@1+ (1,0) [0|0] "" B', (1, 0, None, None, ""), None),
    (' SG_ S:0|8@1+(1,0)[0|0]""B', (1, 0, None, None, ""), None),
    (' SG_ S :\n  0 | 8 @ 1 +\n ( 1 , 0 ) [ 0 | 0 ]\n "" B', (1, 0, None, None, ""), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "" B,\n  C,\n  D', (1, 0, None, None, ""), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "a;b" B', (1, 0, None, None, "a;b"), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "\\"" B', (1, 0, None, None, '"'), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "\\" B', (1, 0, None, None, "\\"), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "// SG_ X : 1|2@1+" B', (1, 0, None, None, "// SG_ X : 1|2@1+"), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "rpm B', (1, 0, None, None, "rpm B"), ("line 2", "never closed")),
    (' SG_ S : 0|8@1+ (1,0) [0|0] B', (1, 0, None, None, ""), ("line 2", "S", "no unit")),
    (' SG_ S : 0|8@1+ (1,0) "V" B', (1, 0, None, None, "V"), ("line 2", "no range")),
    (' SG_ S : 0|8@1+ (2) [0|0] "V" B', (2, 0, None, None, "V"), ("line 2", "offset 0")),
    (' SG_ S : 0|8@1+ [0|9] "V" B', (1, 0, 0, 9, "V"), ("line 2", "factor 1, offset 0")),
    (" SG_ S : 0|8@1+", (1, 0, None, None, ""), ("line 2", "factor 1, offset 0", "no range", "no unit")),
    (' SG_ S : 0|8@1+ (1,0) [|] "V" B', (1, 0, None, None, "V"), ("line 2", "M.S", "range |", "not used")),
    (' SG_ S : 0|8@1+ (1,0) [0|1e999] "V" B', (1, 0, None, None, "V"), ("line 2", "range 0|1e999", "not used")),
    (' SG_ S : 0|8@1+ (1,0) [9|1] "V" B', (1, 0, None, None, "V"), ("line 2", "minimum 9 above maximum 1")),
    (' SG_ S : 0|8@1+ (0,5) [0|0] "V" B', (0, 5, None, None, "V"), ("line 2", "factor 0", "always 5")),
    (' SG_ S X : 0|8@1+ (1,0) [0|0] "V" B', (1, 0, None, None, "V"), ("line 2", "'X'", "not used")),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "V" B;', (1, 0, None, None, "V"), None),
    (' SG_ S : 0|8@1+ (1,0) [0|0] "V" B // why', (1, 0, None, None, "V"), None),
    (' SG_ S : 0|8@1+ (a,0) [0|0] "V" B', None, ("line 2", "M.S", "factor a", "left out")),
    (' SG_ S : 0|8@1+ (1,5,0) [0|0] "V" B', None, ("line 2", "M.S", "offset 5,0", "left out")),
    (' SG_ S : 0|8@1+ (1_0,0) [0|0] "V" B', None, ("line 2", "M.S", "factor 1_0", "left out")),
    (' SG_ S : 0|8@1+ (1,0 [0|0] "V" B', None, ("line 2", "M.S", "factor (1,0", "left out")),
    (' SG_ S : 0|8@2+ (1,0) [0|0] "V" B', None, ("line 2", "SG_ S", "ORDER 0 or 1", "left out")),
    (' SG_ S : 0|8@1 (1,0) [0|0] "V" B', None, ("line 2", "SG_ S", "SIGN + or -", "left out")),
    (' SG_ S : 0@1+ (1,0) [0|0] "V" B', None, ("line 2", "SG_ S", "START|LENGTH", "left out")),
    (' SG_ S : -1|8@1+ (1,0) [0|0] "V" B', None, ("line 2", "SG_ S", "START|LENGTH", "left out")),
    (' SG_ S 0|8@1+ (1,0) [0|0] "V" B', None, ("line 2", "SG_ S", "expected SG_ NAME :", "left out")),
    (" SG_", None, ("line 2", "'SG_'", "expected SG_ NAME :", "left out")),
    (' SG_ S : 0|65@1+ (1,0) [0|0] "V" B', None, ("line 2", "M.S", "length 65 bits", "left out")),
    (' SG_ S : 64|1@1+ (1,0) [0|0] "V" B', None, ("line 2", "M.S", "64|1 do not fit into 8 bytes", "left out")),
    (' SG_ S mX : 0|8@1+ (1,0) [0|0] "V" B', None, ("line 2", "S", "'mX' is no multiplexer mark", "left out")),
    (' SG_ S m1 : 0|8@1+ (1,0) [0|0] "V" B', None, ("line 2", "M.S", "no signal of its message", "left out")),
]  # fmt: skip


@pytest.mark.parametrize(("line", "expected", "words"), SIGNALS)
def test_a_signal_is_read_where_what_is_needed_stands_there(line, expected, words):
    database = parse(f"BO_ 1 M: 8 A\n{line}\n{GOOD}\n")
    signals = loaded(database)
    assert "OK" in signals
    if expected is None:
        assert "S" not in signals
    else:
        s = signals["S"]
        assert (s.start, s.length, s.factor, s.offset, s.minimum, s.maximum, s.unit) == (0, 8, *expected)
    if words is None:
        assert database.warnings == ()
    else:
        assert any(all(word in warning for word in words) for warning in database.warnings), database.warnings


# Each: text, names of what is loaded, by identifier, words of one warning (None: none).
TEXTS = [
    ('BO_ 1 M: 8 A SG_ S : 0|8@1+ (1,0) [0|0] "" B SG_ T : 8|8@1+ (1,0) [0|0] "" B', {1: "S T"}, None),
    ('BO_ 1 M: 8 SG_ S : 0|8@1+ (1,0) [0|0] "" B', {1: "S"}, None),
    ("BO_ 1 M : 8\n  A\nBO_ 2 N:8 A", {1: "", 2: ""}, None),
    ('BO_ 1 M: 8 FILTER\n SG_ S : 0|8@1+ (1,0) [0|0] "" FILTER\n' + GOOD, {1: "OK S"}, None),
    ("BO_ 1 M: 8\nBO_ 2 N: 8", {1: "", 2: ""}, None),
    ("BO_\n1\nM:\n8\nA\n" + GOOD, {1: "OK"}, None),
    ("BO_ 1 M: 8 A\r\n" + GOOD + "\r\n", {1: "OK"}, None),
    ("\ufeffBO_ 1 M: 8 A\n" + GOOD, {1: "OK"}, None),
    ("BO_ 1 M 8 A\n" + GOOD + "\nBO_ 2 N: 8 A\n" + GOOD, {2: "OK"}, ("line 1", "BO_ 1 M 8 A", "expected BO_")),
    ("BO_ 0x1 M: 8 A\n" + GOOD + "\nBO_ 2 N: 8 A", {2: ""}, ("line 2", "signal OK", "stands in no message")),
    (GOOD + "\nBO_ 2 N: 8 A\n" + GOOD, {2: "OK"}, ("line 1", "signal OK", "stands in no message")),
    ("BO_ 1 M: 8 A\nBO_ 1 N: 8 A\n" + GOOD, {1: "OK"}, ("line 2", "0x1", "M and N", "last one")),
    ("BO_ 1 M: 8 A\n" + GOOD + "\n" + GOOD, {1: "OK"}, ("line 3", "M.OK", "defined twice")),
    ("BO_ 2048 M: 8 A\nBO_ 1 N: 8 A", {1: ""}, ("line 1", "message M", "0x800", "11 bits")),
    ("BO_ 4294967295 M: 8 A\nBO_ 1 N: 8 A", {1: ""}, ("line 1", "message M", "0x7fffffff", "29 bits")),
    ("BO_ 1 M: 65 A\nBO_ 2 N: 64 A", {2: ""}, ("line 1", "message M", "65 bytes", "CAN FD")),
    ('CM_ "never closed;\nBO_ 1 M: 8 A\n' + GOOD, {1: "OK"}, ("line 1", "never closed", "'never closed'")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nCM_ "no semicolon"\nBO_ 2 N: 8 A', {1: "OK", 2: ""}, ("line 3", "without ';'")),
    ('CM_ "never closed;\nCM_ "but this";\nBO_ 1 M: 8 A\n', {1: ""}, ("line 1", "never closed")),
    ('CM_ BO_ 1 "C:\\dir\\";\nBO_ 1 M: 8 A\n' + GOOD, {1: "OK"}, None),
    ('BA_ "x" BO_ 1 5\nBO_ 1 M: 8 A\n' + GOOD, {1: "OK"}, ("line 1", "BA_", "without ';'")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nVAL_ 1 X 0 "a";', {1: "OK"}, ("line 3", "VAL_ of 1 X", "no such signal")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nSIG_VALTYPE_ 1 OK x;', {1: "OK"}, ("line 3", "SIG_VALTYPE_", "cannot be read")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nSIG_VALTYPE_ 1 OK : 1;', {1: ""}, ("line 2", "M.OK", "floating point of 8 bits")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nSG_MUL_VAL_ 1 OK S 5-2;', {1: "OK"}, ("line 3", "SG_MUL_VAL_", "cannot be read")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nBA_ "GenMsgCycleTime" BO_ 1 "x";', {1: "OK"}, ("GenMsgCycleTime", "no number")),
    ('BO_ 1 M: 8 A\n' + GOOD + '\nBA_ "x" BO_ one 5;', {1: "OK"}, ("line 3", "BA_", "cannot be read")),
    ('BO_ 1 M: 8 A\n SG_ S m3 : 0|8@1+ (1,0) [0|0] "" B\n SG_ P M : 8|8@1+ (1,0) [0|0] "" B\n SG_ Q M : 16|8@1+ (1,0) '
     '[0|0] "" B', {1: "P Q"}, ("line 2", "M.S", "SG_MUL_VAL_", "left out")),
    ('BO_ 1 M: 8 A\n SG_ S m3 : 0|8@1+ (1,0) [0|0] "" B\n SG_ P m : 8|8@1+ (1,0) [0|0] "" B', {1: "P S"},
     ("line 3", "P", "read as 'M'")),
    ('BO_ 1 M: 8 A\n SG_ S m3 : 0|8@1+ (1,0) [0|0] "" B\n SG_ P M : 8|8@1+ (1,0) [0|0] "" B\nSG_MUL_VAL_ 1 S X 3-3;',
     {1: "P"}, ("line 2", "M.S", "multiplexer X cannot select it")),
    ('BO_ 1 M: 8 A\n SG_ Ä : 0|8@1+ (1,0) [0|0] "" B\n SG_ Ö : 8|8@1+ (1,0) [0|0] "" B', {1: "_ __2"},
     ("line 2", "ASCII", "'_'")),
    ('BO_ 1 M: 8 A\n SG_ S\x1b[31m : 0|8@1+ (1,0) [0|0] "\x07" B', {1: "S__31m"}, ("line 2", "control character")),
    ("BO_ 1 M: 8 A\n\0" + GOOD, {1: "OK"}, ("line 2", "control character")),
]  # fmt: skip


@pytest.mark.parametrize(("text", "names", "words"), TEXTS)
def test_what_can_be_used_of_a_broken_text_is_loaded(text, names, words):
    database = parse(text)
    found = {key[0]: " ".join(sorted(s.name for s in m.signals)) for key, m in database.messages.items()}
    assert found == names
    if words is None:
        assert database.warnings == ()
    else:
        assert any(all(word in warning for word in words) for warning in database.warnings), database.warnings


@pytest.mark.parametrize(
    ("statement", "choices"),
    [
        ('VAL_ 1 OK -1 "minus" 5 "five";', {-1: "minus", 5: "five"}),
        ('VAL_ 1 OK 0"a"1"b";', {0: "a", 1: "b"}),
        ('VAL_ 1 OK\n 0 "a;b"\n 1 "two\nlines" ;', {0: "a;b", 1: "two\nlines"}),
        ('VAL_ 1 OK 0 "say \\"a\\"" 1.0 "b" ;', {0: 'say "a"', 1: "b"}),
        ('VAL_ 1 OK 0 "a" x "b" 2 "c";', {0: "a", 2: "c"}),
        ('VAL_ 1 OK 0 "a" 1 2 "c" "d";', {0: "a", 2: "c"}),
        ('VAL_ 1 OK 0 "a" 1 "b', {0: "a", 1: "b"}),
        ('VAL_TABLE_ T 0 "off" 1 "on";\nVAL_ 1 OK T;', {0: "off", 1: "on"}),
        ('VAL_TABLE_ T 0 "off";\nSGTYPE_ Y : 8@1+ (1,0) [0|0] "" 0, T;\nSGTYPE_ 1 OK : Y;', {0: "off"}),
        ('VAL_TABLE_ T 0 "off";\nSGTYPE_ Y : 8@1+ (1,0) [0|0] "" 0, T;\nSIG_TYPE_REF_ 1 OK : Y;', {0: "off"}),
        ("VAL_ 1 OK Missing;", {}),
        ("VAL_ 1 OK ;", {}),
    ],
)
def test_value_names(statement, choices):
    database = parse(f"BO_ 1 M: 8 A\n{GOOD}\n{statement}\n")
    assert loaded(database)["OK"].choices == choices


@pytest.mark.parametrize(
    ("statement", "comment"),
    [
        ('CM_ SG_ 1 OK "plain";', "plain"),
        ('CM_ SG_ 1 OK "two\nlines; BO_ 5 GHOST: 8 A\n SG_ X : 0|8@1+ (1,0)";',
         "two\nlines; BO_ 5 GHOST: 8 A\n SG_ X : 0|8@1+ (1,0)"),
        ('CM_ SG_ 1 OK "say \\"a\\"";', 'say "a"'),
        ('CM_ SG_ 1 OK "the "big" one";', 'the "big" one'),
        ('CM_ SG_ 1 OK "never closed\nCM_ BO_ 1 "x";', "never closed"),
        ("CM_ SG_ 1 OK;", ""),
    ],
)  # fmt: skip
def test_comments(statement, comment):
    assert loaded(parse(f"BO_ 1 M: 8 A\n{GOOD}\n{statement}\n"))["OK"].comment == comment


def test_an_absurd_multiplexer_range_stays_a_range():
    database = parse(
        'BO_ 1 M: 8 A\n SG_ P M : 0|8@1+ (1,0) [0|0] "" B\n SG_ S m0 : 8|8@1+ (1,0) [0|0] "" B\n'
        "SG_MUL_VAL_ 1 S P 3-3, 2-2, 9-99999999999999999999, 5-6;\n"
    )
    assert loaded(database)["S"].mux_ranges == ((0, 0), (2, 3), (5, 6), (9, 2**64 - 1))
    assert any("P has 8 bits" in w for w in database.warnings)


def test_branches_with_overlapping_ranges_are_told():
    head = 'BO_ 1 M: 8 A\n SG_ P M : 0|8@1+ (1,0) [0|0] "" B\n SG_ S m0 : 8|8@1+ (1,0) [0|0] "" B\n'
    head += ' SG_ T m5 : 15|2@0+ (1,0) [0|0] "" B\n'
    assert parse(head + "SG_MUL_VAL_ 1 S P 0-4;\nSG_MUL_VAL_ 1 T P 5-9;\n").warnings == ()
    assert "M.T: overlaps M.S" in parse(head + "SG_MUL_VAL_ 1 S P 0-5;\n").warnings[0]


def test_multiplexers_in_a_loop_are_left_out_and_a_deep_chain_is_bounded():
    lines = [f' SG_ S{i} m1M : {i}|1@1+ (1,0) [0|0] "" B' for i in range(40)]
    rules = [f"SG_MUL_VAL_ 1 S{i} S{i - 1} 1-1;" for i in range(1, 40)]
    text = "\n".join(["BO_ 1 M: 8 A", *lines, *rules])
    assert set(loaded(parse(text + "\nSG_MUL_VAL_ 1 S0 S39 1-1;\n"))) == set()
    assert set(loaded(parse(text.replace("S0 m1M", "S0 M")))) == {f"S{i}" for i in range(17)}


def test_warnings_are_in_the_order_of_the_text_and_bounded():
    text = "BO_ 1 M: 8 A\n" + GOOD + "\nBO_ 2\n" * 2 * MAX_WARNINGS
    warnings = parse(text).warnings
    assert len(warnings) == MAX_WARNINGS + 1
    assert warnings[0].startswith("line 3: ")
    assert warnings[1].startswith("line 5: ")
    assert warnings[-1] == f"and {MAX_WARNINGS} further warnings"


def test_a_warning_repeats_no_more_than_the_begin_of_a_name():
    database = parse(f"BO_ 1 {'M' * 100_000}: 8 A\n" + (GOOD + "\n") * 100)
    assert max(len(w) for w in database.warnings) < 300


def test_none_of_the_messages_can_be_used():
    with pytest.raises(
        DatabaseError, match=r"test\.dbc: none of its 2 messages can be used: line 1: message M: .*0x800"
    ):
        parse("BO_ 2048 M: 8 A\nBO_ 2049 N: 8 A\n")
