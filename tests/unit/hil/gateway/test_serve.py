"""What the processes read beside their buses."""

import os

from hil.gateway.serve import Lines


def test_lines_come_whole_and_without_waiting():
    reader, writer = os.pipe()
    lines = Lines(reader)
    assert list(lines.read()) == []
    os.write(writer, b"A.B=1\n\n  C.D=2 \nE.F")
    assert list(lines.read()) == ["A.B=1", "C.D=2"]
    assert list(lines.read()) == []
    os.write(writer, b"=3\n\xff\n")
    assert list(lines.read()) == ["E.F=3", "\ufffd"]
    os.write(writer, b"G=off")
    assert list(lines.read()) == []
    os.close(writer)
    assert list(lines.read()) == ["G=off"]
    assert list(lines.read()) == []
    os.close(reader)
