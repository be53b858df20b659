"""Hostile DBCs: no exception but ours, nothing that cannot be decoded, work that grows with the length alone."""

import random
import sys

import pytest

from dbc.contract import database_text
from dbc.database import DatabaseError, parse_database
from dbc.database_json import database_from_json, database_to_json
from dbc.database_values import MAX_WARNINGS
from dbc.frame import BusName

MUTANTS = 2000
CALLS_PER_BYTE = 12  # of Python and built-in functions; what is sound takes about 2
CALLS = 20_000

EVERYTHING = (
    'VERSION ""\nNS_ :\n\tCM_\n\tBA_\n\nBS_:\n\nBU_: A B\nVAL_TABLE_ T 0 "off" 1 "on" ;\n'
    'BO_ 2364540158 EEC1: 8 A\n SG_ P M : 0|4@1+ (1,0) [0|15] "" B\n SG_ Q m1M : 4|4@1+ (1,0) [0|15] "" B,A\n'
    ' SG_ R m2 : 8|32@1- (0.5,-40) [-40|1E+3] "°C" B\n SG_ D m3 : 15|16@0- (1,0) [0|0] "a;b" B\n'
    'BO_ 2 N: 8 B\n SG_ D : 0|64@1- (1,0) [0|0] "" A\n SG_ E : 7|8@0+ (1,0) [0|0] "" A\n'
    'BO_TX_BU_ 2 : A,B;\nCM_ SG_ 2 D "two\nlines; \\"quoted\\"";\nCM_ BO_ 2 "BO_ 9 GHOST: 8 A";\n'
    'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
    'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 100;\n'
    'BA_ "VFrameFormat" BO_ 2364540158 3;\nBA_ "E2EDataID" BO_ 2 7;\nBA_ "Baudrate" 500000;\n'
    'BA_ "SystemSignalLongSymbol" SG_ 2 E "A long name";\n'
    'VAL_ 2364540158 P -1 "minus" 2 "R" ;\nVAL_ 2 E T ;\nSIG_VALTYPE_ 2364540158 R : 1;\nSIG_VALTYPE_ 2 D : 2;\n'
    "SG_MUL_VAL_ 2364540158 Q P 1-1;\nSG_MUL_VAL_ 2364540158 R Q 2-2, 5-9;\nSG_MUL_VAL_ 2364540158 D P 3-7;\n"
)
PIECES = [
    '"',
    '\\"',
    ";",
    "\n",
    ":",
    "|",
    "@",
    "(",
    "-1",
    "99999999999999999999",
    "1e999",
    "nan",
    "BO_ ",
    " SG_ ",
    "m0 ",
    "m0M ",
    'CM_ "',
    "VAL_ 2 D ",
    "BA_ ",
    "//",
    "\0",
    "\x1b[31m",
    "\xff",
    "Ω",
    " ",
    "SG_MUL_VAL_ 2 D E 0-9999999999;",
]


def calls_of(work):
    """Run something; return what it returned and how many functions it called."""
    calls = 0

    def count(frame, event, arg):
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        return work(), calls
    finally:
        sys.setprofile(before)


def loaded(content):
    try:
        return parse_database(content, "x.dbc")
    except DatabaseError:
        return None


def assert_sound(database):
    """All that a decoder relies on."""
    assert database.messages
    assert len(database.warnings) <= MAX_WARNINGS + 4
    assert all(w.isprintable() and len(w) < 600 for w in database.warnings)
    assert len({m.name for m in database.messages.values()}) == len(database.messages)
    for message in database.messages.values():
        names = {s.name: s for s in message.signals}
        assert len(names) == len(message.signals)
        for s in message.signals:
            mask = s.mask()
            assert mask.bit_length() <= 8 * message.length
            assert mask.bit_count() == s.length <= 64
            assert (s.multiplexer is None) == (not s.mux_ranges)
            depth, above = 0, s.multiplexer
            while above is not None:
                assert not names[above].is_float
                depth, above = depth + 1, names[above].multiplexer
            assert depth <= 16
    assert database_from_json(database_to_json(database)) == database


def mutant(seed):
    rng = random.Random(seed)
    text = rng.choice([EVERYTHING, EVERYTHING, database_text(BusName.VEHICLE)[:4000]])
    for _ in range(rng.randint(1, 8)):
        a = rng.randrange(len(text) + 1)
        b = min(len(text), a + rng.choice([1, 1, 5, 40, 400]))
        kind = rng.randrange(5)
        if kind == 0:
            text = text[:a] + text[b:]
        elif kind == 1:
            text = text[:a] + rng.choice(PIECES) * rng.choice([1, 1, 1, 50]) + text[a:]
        elif kind == 2:
            text = text[:b] + text[a:b] * rng.randint(1, 3) + text[b:]
        elif kind == 3:
            lines = text.split("\n")
            rng.shuffle(lines)
            text = "\n".join(lines)
        else:
            text = text[:a] + "".join(chr(rng.randrange(256)) for _ in range(b - a)) + text[b:]
    return text.encode(rng.choice(["utf-8", "latin-1"]), errors="replace")


@pytest.mark.slow
def test_mutants_load_or_are_refused_with_bounded_work():
    read = 0
    for seed in range(MUTANTS):
        content = mutant(seed)
        database, calls = calls_of(lambda content=content: loaded(content))
        assert calls <= CALLS_PER_BYTE * len(content) + CALLS, seed
        if database is not None:
            read += 1
            assert_sound(database)
    assert read > MUTANTS / 2


def test_the_unharmed_texts_are_sound():
    assert_sound(loaded(EVERYTHING.encode()))
    assert loaded(EVERYTHING.encode()).warnings == ("line 17: signal N.A long name: overlaps N.D",)


HEAD = 'BO_ 2147483649 M: 1785 A\n SG_ P M : 0|32@1+ (1,0) [0|0] "" B\n'
REPEATED = [
    '"',
    ";",
    "\n",
    " ",
    "A",
    "1",
    "//\n",
    "\x01",
    "\\",
    '\\"\n',
    "BO_ ",
    "SG_ ",
    "SG_ a : ",
    "BO_ 1 ",
    "CM_ ",
    'CM_ "\n',
    'CM_ "\n\\"\\"\n',
    'CM_ "a";;',
    'CM_ SG_ 1 S "a "b" c";',
    "VAL_ 1 S ",
    "VAL_ 1 S 0 ",
    'VAL_ 1 S -1 "',
    'BA_ "x" BO_ 1 5\n',
    'BA_ "x" BO_ 1 5;\n',
    "VAL_TABLE_ x ;",
    "SG_MUL_VAL_ 1 S S 0-5;",
    "NS_ :\n CM_\n",
    "SG_ \t\t\t\t",
    "BO_ 1 M: 8 A\n",
    ' SG_ S : 0|8@1+ (1,0) [0|0] "\n',
    ' SG_ S : 0|8@1+ (1,0) [0|0] "" B\n',
    " SG_ S : 0|8@1+ ((((",
    " SG_ S m1M : 0|8@1+",
    'VAL_ 2147483649 P 5 "x";',
    "SG_MUL_VAL_ 2147483649 P Q 3-3;",
    "BO_ 4294967295 M: 8 A\n",
    "é",
    "SG_ S : 0|8@1+[",
]


def numbered(unit):
    return lambda n: "".join(unit.replace("#", str(i)) for i in range(n // len(unit)))


GROWING = {
    "overlapping signals": numbered('SG_ S# : 14000|64@1+ (1,0) [0|0] "" B\n'),
    "branches": numbered('SG_ S# m# : 14000|64@1+ (1,0) [0|0] "" B\n'),
    "one branch": numbered('SG_ S# m1 : 14000|64@1+ (1,0) [0|0] "" B\n'),
    "many multiplexers": numbered('SG_ S# m1M : 14000|64@1+ (1,0) [0|0] "" B\n'),
    "a chain": numbered('SG_ S# m1M : 9|8@1+ (1,0) [0|0] "" B\nSG_MUL_VAL_ 2147483649 S# S#0 1-1;\n'),
    "names alike": numbered('SG_ Ä#é : 9|8@1+ (1,0) [0|0] "" B\nSG_ Ö#é : 9|8@1+ (1,0) [0|0] "" B\n'),
    "value names": lambda n: "VAL_ 2147483649 P " + '1 "x" ' * (n // 6) + ";",
    "ranges": lambda n: "SG_MUL_VAL_ 2147483649 P Q " + ",".join(f"{2 * i}-{2 * i}" for i in range(n // 10)) + ";",
    "messages alike": numbered("BO_ # M: 8 A\n"),
    "a long name": lambda n: f"BO_ 1 {'M' * (n // 2)}: 8 A\n" + ' SG_ S : 0|8@1+ (1,0) [0|0] "" B\n' * (n // 70),
    "a long number": lambda n: f' SG_ S : 0|8@1+ ({"9" * n},0) [0|0] "" B\n',
    **{repr(unit): lambda n, unit=unit: unit * (n // len(unit)) for unit in REPEATED},
}


@pytest.mark.parametrize("name", GROWING)
def test_work_grows_no_faster_than_the_text(name):
    small, large = ((HEAD + GROWING[name](n)).encode() for n in (20_000, 40_000))
    (_, few), (database, many) = (calls_of(lambda content=content: loaded(content)) for content in (small, large))
    assert many <= 2.5 * few + CALLS
    assert database is None or len(database.warnings) <= MAX_WARNINGS + 4


@pytest.mark.slow
@pytest.mark.parametrize("name", GROWING)
def test_a_megabyte_ends(name):
    """What runs away inside a regular expression, where no calls are counted, is ended by the limit of the test."""
    database = loaded((HEAD + GROWING[name](1_000_000)).encode())
    assert database is None or len(database.warnings) <= MAX_WARNINGS + 4
