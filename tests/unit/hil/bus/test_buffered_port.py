"""A serial port that is read in pieces gives the bytes of the port."""

import os
import tty

import pytest

from hil.bus.buffered_port import BufferedPort

serial = pytest.importorskip("serial", reason="it is pyserial's port")


def test_bytes_come_in_order_and_with_few_readings():
    line, port_fd = os.openpty()
    tty.setraw(port_fd)
    with serial.Serial(os.ttyname(port_fd), timeout=0) as plain:
        port = BufferedPort(plain)
        assert (port.read(), port.in_waiting, port.buffered) == (b"", 0, 0)
        os.write(line, b"t1230\rz\r")
        while port.in_waiting < 8:
            pass
        assert port.read(1) == b"t"
        assert (port.buffered, port.in_waiting, plain.in_waiting) == (7, 7, 0)
        os.write(line, b"more")
        assert port.read(100) == b"1230\rz\r"
        while port.in_waiting < 4:
            pass
        assert port.read(1) == b"m"
        port.reset_input_buffer()
        assert (port.read(1), port.buffered) == (b"", 0)
        assert port.fileno() == plain.fileno()
        port.write_timeout = 0.05
        assert plain.write_timeout == 0.05
    os.close(line)
    os.close(port_fd)
