"""cantools reads what it reads: on sound DBCs our parser says the same, signal by signal."""

import logging
import os
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbc.contract import database_text
from dbc.database import parse_database
from dbc.database_checks import merged
from dbc.frame import BusName
from dbc.lean_cantools import cantools

DATA = Path(os.environ.get("BRAKEBENCH_DATA", Path(__file__).parents[4] / "shared" / "data"))


def by_cantools(text):
    logging.getLogger("cantools").setLevel(logging.CRITICAL)
    return cantools.database.load_string(text, database_format="dbc", strict=False)


def assert_equal_to_cantools(text):
    database, theirs = parse_database(text), by_cantools(text)
    expected = {(m.frame_id, m.is_extended_frame): m for m in theirs.messages}
    assert set(database.messages) == set(expected)
    for key, message in database.messages.items():
        other = expected[key]
        sender = (other.senders or [""])[0]
        assert (message.name, message.length, message.sender) == (other.name, other.length, sender)
        assert message.cycle_time_ms == other.cycle_time
        assert message.comment == (other.comment or "")
        assert (message.is_fd, message.pgn_match) == (other.is_fd, key[1] and other.protocol == "j1939")
        assert [s.name for s in sorted(message.signals, key=lambda s: s.name)] == sorted(s.name for s in other.signals)
        by_name = {s.name: s for s in other.signals}
        for signal in message.signals:
            assert said(signal) == said_by_cantools(by_name[signal.name]), f"{message.name}.{signal.name}"
    return database


def said(s):
    layout = (s.start, s.length, s.big_endian, s.signed, s.is_float)
    scale = (s.factor, s.offset, s.minimum, s.maximum, s.unit)
    return layout, scale, s.choices, s.multiplexer, s.mux_ranges, s.comment


def said_by_cantools(s):
    layout = (s.start, s.length, s.byte_order == "big_endian", s.is_signed and not s.is_float, s.is_float)
    no_range = s.minimum == s.maximum == 0
    scale = (s.scale, s.offset, None if no_range else s.minimum, None if no_range else s.maximum, s.unit or "")
    choices = {int(raw): str(name) for raw, name in (s.choices or {}).items()}
    ranges = merged((i, i) for i in s.multiplexer_ids or ()) if s.multiplexer_signal else ()
    return layout, scale, choices, s.multiplexer_signal, ranges, s.comment or ""


numbers = st.one_of(
    st.integers(-300, 300).map(str),
    st.floats(-1e6, 1e6, allow_nan=False).map(repr),
    st.sampled_from(["0.1", "1E-05", "-2.5e+3", "18446744073709551615", "-9223372036854775808", "007", "1.", "+3"]),
)
factors = numbers.filter(lambda text: float(text) != 0)
texts = st.text(st.sampled_from("aB 1;:,|@()[]{}+-/\n'é°%_BO_SG_"), max_size=12)
white = st.sampled_from([" ", "  ", "\t", "\n  ", " \r\n "])


@dataclass
class Message:
    key: int
    signals: list = field(default_factory=list)  # name, multiplexer mark


@st.composite
def databases(draw):
    lines = ['VERSION "1"', "NS_ :", "\tCM_", "\tBA_DEF_", "\tVAL_", "", "BS_:", "", "BU_: A B"]
    messages = []
    key = st.one_of(st.integers(0, 0x7FF), st.integers(0x8000_0000, 0x9FFF_FFFF))
    keys = draw(st.lists(key, min_size=1, max_size=4, unique=True))
    for i, key in enumerate(keys):
        message = Message(key)
        sender = draw(st.sampled_from(["A", "B", "Vector__XXX"]))
        lines.append(f"BO_ {key}{draw(white)}M{i}{draw(st.sampled_from([':', ' :']))} 8{draw(white)}{sender}")
        multiplexed = draw(st.booleans())
        for k in range(draw(st.integers(0, 5))):
            mark = "" if not multiplexed else "M" if k == 0 else draw(st.sampled_from(["", f"m{k}", "m0", "m200"]))
            length = draw(st.integers(1, 32))
            start = draw(st.integers(0, 63))
            big = draw(st.booleans())
            first = 8 * (start // 8) + 7 - start % 8 if big else start
            length = min(length, 64 - first)
            unit = draw(texts).replace("\n", "")
            bits = f"{start}|{length}@{int(not big)}{draw(st.sampled_from('+-'))}"
            low, high = sorted((draw(numbers), draw(numbers)), key=float)
            scale = f"({draw(factors)},{draw(numbers)}) [{low}|{high}]"
            receivers = draw(st.sampled_from(["A", "A,B", "Vector__XXX", " A, B"]))
            lines.append(f' SG_ S{k} {mark}{draw(white)}: {bits} {scale} "{unit}" {receivers}')
            message.signals.append((f"S{k}", mark, length))
        messages.append(message)
    lines += ['BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;',
              'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG","StandardCAN_FD";',
              f'BA_DEF_DEF_ "GenMsgCycleTime" {draw(st.sampled_from([0, 100]))};',
              'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";']  # fmt: skip
    for message in messages:
        lines += draw(st.lists(details(message), max_size=3))
        for name, mark, _ in message.signals:
            lines += draw(st.lists(signal_details(message.key, name, mark), max_size=2))
    return "\n".join(lines) + "\n"


def details(message):
    return st.one_of(
        st.integers(0, 500).map(lambda ms: f'BA_ "GenMsgCycleTime" BO_ {message.key} {ms};'),
        st.integers(0, 4).map(lambda i: f'BA_ "VFrameFormat" BO_ {message.key} {i};'),
        texts.map(lambda text: f'CM_ BO_ {message.key} "{text}";'),
    )


def signal_details(key, name, mark):
    choices = st.lists(st.tuples(st.integers(-5, 5), texts), max_size=3)
    kinds = [
        choices.map(lambda pairs: f"VAL_ {key} {name} " + " ".join(f'{raw} "{text}"' for raw, text in pairs) + ";"),
        texts.map(lambda text: f'CM_ SG_ {key} {name}\n "{text}";'),
        texts.map(lambda text: f'CM_ SG_ {key} {name} "say \\"{text}\\"";'),
    ]
    if mark.startswith("m"):
        kinds.append(st.integers(0, 9).map(lambda n: f"SG_MUL_VAL_ {key} {name} S0 {n}-{n + 3}, 20-20;"))
    return st.one_of(kinds)


@settings(max_examples=150)
@given(databases())
def test_a_generated_database_is_read_as_cantools_reads_it(text):
    assert_equal_to_cantools(text)


@pytest.mark.parametrize("file", ["rav4/toyota_new_mc_pt.dbc", "motec/sample_can_spec.dbc", "mustang/mustang.dbc"])
def test_a_real_database_is_read_as_cantools_reads_it(file):
    path = DATA / file
    if not path.exists():
        pytest.skip(f"measured data not found: {path} (set BRAKEBENCH_DATA)")
    assert assert_equal_to_cantools(path.read_text("cp1252")).messages


@pytest.mark.parametrize("bus", list(BusName))
def test_our_own_databases_are_read_as_cantools_reads_them(bus):
    database = assert_equal_to_cantools(database_text(bus))
    assert database.warnings == ()
    assert database.bit_rate == by_cantools(database_text(bus)).buses[0].baudrate


def test_floats_and_nested_multiplexers_are_read_as_cantools_reads_them():
    assert_equal_to_cantools(
        'BO_ 1 M: 8 A\n SG_ P M : 0|4@1+ (1,0) [0|0] "" A\n SG_ Q m1M : 4|4@1+ (1,0) [0|0] "" A\n'
        ' SG_ R m2 : 8|32@1- (1,0) [0|0] "" A\n SG_ D m3 : 8|8@1- (1,0) [0|0] "" A\n'
        "SIG_VALTYPE_ 1 R : 1;\nSG_MUL_VAL_ 1 Q P 1-1;\nSG_MUL_VAL_ 1 R Q 2-2, 5-9;\nSG_MUL_VAL_ 1 D P 3-3, 4-7;\n"
        'BO_ 2 N: 8 A\n SG_ D : 0|64@1- (1,0) [0|0] "" A\nSIG_VALTYPE_ 2 D : 2;\n'
    )


def test_long_names_are_read_as_cantools_reads_them():
    assert_equal_to_cantools(
        'BO_ 1 Short: 8 A\n SG_ S : 0|4@1+ (1,0) [0|0] "" A\n'
        'BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;\nBA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;\n'
        'BA_DEF_ BU_ "SystemNodeLongSymbol" STRING ;\n'
        'BA_ "SystemMessageLongSymbol" BO_ 1 "A_message_with_a_name_of_more_than_32_letters";\n'
        'BA_ "SystemSignalLongSymbol" SG_ 1 S "A signal with spaces in its name";\n'
        'BA_ "SystemNodeLongSymbol" BU_ A "A_node_with_a_name_of_more_than_32_letters";\n'
    )
