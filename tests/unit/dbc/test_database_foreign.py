"""ARXML, KCD and SYM: told by content, read as the same values, carried over as JSON."""

import logging
from dataclasses import replace

import pytest

from dbc.contract import database_text
from dbc.database import DatabaseError, parse_database, sniff_database
from dbc.database_json import database_from_json, database_to_json
from dbc.database_values import Database
from dbc.foreign_database import parse_foreign
from dbc.frame import BusName
from dbc.lean_cantools import cantools

KCD = """<?xml version="1.0" encoding="ISO-8859-1"?>
<!-- a comment with <Other> in it -->
<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">
  <Document name="d" version="1"/>
  <Node id="1" name="ECU"/>
  <Bus name="Motor" baudrate="250000">
    <Message id="0x7F" length="8" name="ABS" interval="20">
      <Notes>about ABS</Notes>
      <Producer><NodeRef id="1"/></Producer>
      <Multiplex name="Sel" offset="0" length="8">
        <MuxGroup count="1"><Signal name="A" offset="8" length="16"><Value slope="0.5" intercept="-40" unit="°C"
          min="-40" max="100"/></Signal></MuxGroup>
        <MuxGroup count="2"><Signal name="B" offset="8" length="8"/></MuxGroup>
      </Multiplex>
      <Signal name="F" offset="32" length="32"><Value type="single"/></Signal>
    </Message>
    <Message id="0x12345" length="2" name="EXT" format="extended">
      <Signal name="S" offset="0" length="12" endianess="big"><Value type="signed"/>
        <LabelSet><Label name="off" value="0"/><Label name="on" value="1"/></LabelSet></Signal>
      <Signal name="TooFar" offset="60" length="12"/>
    </Message>
  </Bus>
</NetworkDefinition>
"""

SYM = """FormatVersion=6.0 // Do not edit this line!
Title="t"

{ENUMS}
Enum=Gears(0="P", 1="R")

{SIGNALS}
Sig=Speed unsigned 16 /u:"km/h" /f:0.01 /o:-5 /max:600
Sig=Gear unsigned 8 /e:Gears

{SENDRECEIVE}

[Motor]
ID=123h
Type=Standard
Len=8
CycleTime=100
Sig=Speed 0
Sig=Gear 16
"""

ARXML = """<?xml version="1.0" encoding="UTF-8"?>
<AUTOSAR xmlns="http://autosar.org/schema/r4.0" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:schemaLocation="http://autosar.org/schema/r4.0 AUTOSAR_4-2-2.xsd"><AR-PACKAGES><AR-PACKAGE>
<SHORT-NAME>P</SHORT-NAME><ELEMENTS>
<CAN-CLUSTER><SHORT-NAME>Cluster</SHORT-NAME><CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL>
 <BAUDRATE>500000</BAUDRATE><PHYSICAL-CHANNELS><CAN-PHYSICAL-CHANNEL><SHORT-NAME>Channel</SHORT-NAME>
 <FRAME-TRIGGERINGS><CAN-FRAME-TRIGGERING><SHORT-NAME>T</SHORT-NAME>
 <FRAME-REF DEST="CAN-FRAME">/P/Frame</FRAME-REF><CAN-ADDRESSING-MODE>EXTENDED</CAN-ADDRESSING-MODE>
 <IDENTIFIER>419361024</IDENTIFIER></CAN-FRAME-TRIGGERING></FRAME-TRIGGERINGS>
 </CAN-PHYSICAL-CHANNEL></PHYSICAL-CHANNELS></CAN-CLUSTER-CONDITIONAL></CAN-CLUSTER-VARIANTS></CAN-CLUSTER>
<CAN-FRAME><SHORT-NAME>Frame</SHORT-NAME><FRAME-LENGTH>8</FRAME-LENGTH><PDU-TO-FRAME-MAPPINGS>
 <PDU-TO-FRAME-MAPPING><SHORT-NAME>M</SHORT-NAME><PDU-REF DEST="I-SIGNAL-I-PDU">/P/Pdu</PDU-REF>
 <PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER><START-POSITION>0</START-POSITION>
 </PDU-TO-FRAME-MAPPING></PDU-TO-FRAME-MAPPINGS></CAN-FRAME>
<I-SIGNAL-I-PDU><SHORT-NAME>Pdu</SHORT-NAME><LENGTH>8</LENGTH><I-SIGNAL-TO-PDU-MAPPINGS>
 <I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>S</SHORT-NAME><I-SIGNAL-REF DEST="I-SIGNAL">/P/Speed</I-SIGNAL-REF>
 <PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-FIRST</PACKING-BYTE-ORDER><START-POSITION>7</START-POSITION>
 </I-SIGNAL-TO-I-PDU-MAPPING></I-SIGNAL-TO-PDU-MAPPINGS></I-SIGNAL-I-PDU>
<I-SIGNAL><SHORT-NAME>Speed</SHORT-NAME><LENGTH>12</LENGTH>
 <SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/SpeedSystem</SYSTEM-SIGNAL-REF></I-SIGNAL>
<SYSTEM-SIGNAL><SHORT-NAME>SpeedSystem</SHORT-NAME><PHYSICAL-PROPS><SW-DATA-DEF-PROPS-VARIANTS>
 <SW-DATA-DEF-PROPS-CONDITIONAL><COMPU-METHOD-REF DEST="COMPU-METHOD">/P/Compu</COMPU-METHOD-REF>
 <UNIT-REF DEST="UNIT">/P/Kmh</UNIT-REF></SW-DATA-DEF-PROPS-CONDITIONAL></SW-DATA-DEF-PROPS-VARIANTS>
 </PHYSICAL-PROPS></SYSTEM-SIGNAL>
<COMPU-METHOD><SHORT-NAME>Compu</SHORT-NAME><CATEGORY>LINEAR</CATEGORY><COMPU-INTERNAL-TO-PHYS><COMPU-SCALES>
 <COMPU-SCALE><COMPU-RATIONAL-COEFFS><COMPU-NUMERATOR><V>-10</V><V>0.25</V></COMPU-NUMERATOR>
 <COMPU-DENOMINATOR><V>1</V></COMPU-DENOMINATOR></COMPU-RATIONAL-COEFFS></COMPU-SCALE></COMPU-SCALES>
 </COMPU-INTERNAL-TO-PHYS></COMPU-METHOD>
<UNIT><SHORT-NAME>Kmh</SHORT-NAME><DISPLAY-NAME>km/h</DISPLAY-NAME></UNIT>
</ELEMENTS></AR-PACKAGE></AR-PACKAGES></AUTOSAR>
"""


def test_kcd():
    database = parse_foreign(KCD.encode("iso-8859-1"), "x.kcd", "kcd")
    abs_, ext = database.messages[0x7F, False], database.messages[0x12345, True]
    assert (abs_.name, abs_.cycle_time_ms, abs_.sender, abs_.comment) == ("ABS", 20, "ECU", "about ABS")
    signals = {s.name: s for s in abs_.signals}
    assert set(signals) == {"Sel", "A", "B", "F"}
    a = signals["A"]
    assert (a.start, a.length, a.factor, a.offset, a.minimum, a.maximum) == (8, 16, 0.5, -40, -40, 100)
    assert (a.unit, a.multiplexer, a.mux_ranges) == ("°C", "Sel", ((1, 1),))
    assert signals["F"].is_float
    (s,) = ext.signals
    assert (s.start, s.big_endian, s.signed, s.choices) == (7, True, True, {0: "off", 1: "on"})
    assert database.bit_rate == 250_000
    assert database.warnings == ("signal EXT.TooFar: bits 60|12 do not fit into 2 bytes; left out",)


def test_sym():
    database = parse_foreign(SYM.encode("cp1252"), "x.sym", "sym")
    motor = database.messages[0x123, False]
    speed, gear = motor.signals
    assert (motor.name, motor.length, motor.cycle_time_ms) == ("Motor", 8, 100)
    assert (speed.factor, speed.offset, speed.unit, speed.maximum) == (0.01, -5, "km/h", 600)
    assert (gear.start, gear.choices) == (16, {0: "P", 1: "R"})
    assert database.warnings == ()


def test_arxml():
    database = parse_foreign(ARXML.encode(), "x.arxml", "arxml")
    message = database.messages[419361024, True]
    (speed,) = message.signals
    assert (message.name, message.length, database.bit_rate) == ("Frame", 8, 500_000)
    assert (speed.start, speed.length, speed.big_endian, speed.factor, speed.offset) == (7, 12, True, 0.25, -10)
    assert speed.unit == "km/h"


@pytest.mark.parametrize("format", ["kcd", "sym"])
@pytest.mark.parametrize("bus", list(BusName))
def test_our_own_databases_say_the_same_as_a_kcd_and_a_sym(bus, format):
    logging.getLogger("cantools").setLevel(logging.CRITICAL)
    theirs = cantools.database.load_string(database_text(bus), database_format="dbc", strict=False)
    text = theirs.as_kcd_string() if format == "kcd" else theirs.as_sym_string()
    database = parse_foreign(text.encode("utf-8"), "x", format)
    expected = parse_database(database_text(bus))
    assert set(database.messages) == set(expected.messages)
    for key, message in database.messages.items():
        other = expected.messages[key]
        assert (message.name, message.length) == (other.name, other.length)
        assert [bare(s) for s in message.signals] == [bare(s) for s in other.signals]


def bare(signal):
    """What all formats can hold."""
    return replace(signal, comment="", choices={}, minimum=None, maximum=None)


def test_what_cantools_refuses_is_read_by_canmatrix_where_it_is_installed():
    pytest.importorskip("canmatrix.formats")
    old = 'FormatVersion=5.0\nTitle="t"\n\n{SEND}\n\n[Motor]\nID=123h\nType=Standard\nDLC=8\n'
    old += 'Var=Speed unsigned 0,16 /u:"km/h" /f:0.01 /o:-5\n\n[Empty]\nID=124h\nDLC=8\n'
    database = parse_foreign(old.encode(), "x.sym", "sym")
    (speed,) = database.messages[0x123, False].signals
    assert (speed.start, speed.length, speed.factor, speed.offset, speed.unit) == (0, 16, 0.01, -5, "km/h")
    assert "read by canmatrix" in database.warnings[0]
    assert "1 of its 2 messages come without signals" in database.warnings[0]


@pytest.mark.parametrize(
    ("content", "format"),
    [
        (b"<NetworkDefinition><Bus", "kcd"),
        (b'<!DOCTYPE x [<!ENTITY a "a">]><NetworkDefinition>&a;</NetworkDefinition>', "kcd"),
        (b"<NetworkDefinition/>", "kcd"),
        (b"FormatVersion=6.0\n{ENUMS", "sym"),
        (b"<AUTOSAR/>", "arxml"),
        (b"\xff\xfe\x00", "sym"),
        (b"", "arxml"),
        (b"BO_ 1 M: 8 A", "xls"),
    ],
)
def test_what_cannot_be_read_is_refused_with_the_file(content, format):
    with pytest.raises(DatabaseError, match=r"^x\.y: "):
        parse_foreign(content, "x.y", format)


@pytest.mark.parametrize(
    ("content", "format"),
    [
        (database_text(BusName.VEHICLE).encode(), "dbc"),
        (b"\xef\xbb\xbf\r\n BO_ 1 M: 8 A", "dbc"),
        (b'CM_ "it may begin with a comment";', "dbc"),
        (KCD.encode("iso-8859-1"), "kcd"),
        (ARXML.encode(), "arxml"),
        (b"\xef\xbb\xbf" + ARXML.encode(), "arxml"),
        (ARXML.encode("utf-16"), "arxml"),
        (SYM.encode(), "sym"),
        (SYM, "sym"),
    ],
)
def test_the_format_is_told_by_content(content, format):
    assert sniff_database(content) == format


@pytest.mark.parametrize(
    ("content", "seen"),
    [
        (b"", "nothing"),
        (b"hello\nworld", "'hello'"),
        (b"\0\0\0", "begins with"),
        (b"<?xml version='1.0'?><fibex:FIBEX/>", "'FIBEX'"),
        (b"<", "without a root element"),
        (b"(1.0) can0 123#00\n", "can0"),
        (b"\x1b[2J evil", "begins with"),
    ],
)
def test_what_is_none_of_them_is_said(content, seen):
    with pytest.raises(DatabaseError, match=r"expected") as caught:
        sniff_database(content)
    assert seen in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", [database_text(bus) for bus in BusName])
def test_json_carries_a_database_exactly(text):
    database = parse_database(text)
    assert database_from_json(database_to_json(database)) == database


def test_json_carries_all_that_a_database_can_hold():
    database = parse_database(
        'BO_ 2364540158 M: 8 A\n SG_ P M : 0|8@1+ (0.1,1e-300) [0|0] "°C" B\n'
        ' SG_ S m0 : 8|32@1- (18446744073709551615,-3) [0|1] "" B\n SG_MUL 5\nSIG_VALTYPE_ 2364540158 S : 1;\n'
        'SG_MUL_VAL_ 2364540158 S P 3-18446744073709551615;\nVAL_ 2364540158 P -1 "minus" 3 "\\"drei\\"\n";\n'
        'CM_ SG_ 2364540158 P "c";\nCM_ BO_ 2364540158 "d";\nBA_ "E2EDataID" BO_ 2364540158 7;\nVAL_ 9 X 1 "x";\n'
        'BA_DEF_DEF_ "GenMsgCycleTime" 2.5;\nBA_DEF_DEF_ "Baudrate" 500000;\nBA_ "ProtocolType" "J1939";\n'
    )
    assert database.warnings
    again = database_from_json(database_to_json(database))
    assert again == database
    assert [type(s.factor) for m in again.messages.values() for s in m.signals] == [float, int]
    assert database_from_json(database_to_json(Database("x", {}, ()))) == Database("x", {}, ())


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"messages": [{}]}', '{"messages": 5}', "[" * 100_000])
def test_what_is_no_database_as_json_is_refused(text):
    with pytest.raises(DatabaseError, match=r"^no database written as JSON: "):
        database_from_json(text)
