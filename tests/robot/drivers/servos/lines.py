"""Serial lines without a board: one that shows what was written, one that answers anything."""

from __future__ import annotations

import os
import tty
from collections.abc import Callable
from typing import cast

import serial

from robot.drivers.servos.sv203 import SV203
from tests.robot.clocks import InstantClock


class Wire:
    """A bare pty that nobody empties."""

    def __init__(self) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.name = os.ttyname(self.slave)

    def close(self) -> None:
        os.close(self.master)
        os.close(self.slave)


class Line:
    """Stands in for pyserial, to be fed any answer and to fail in any way."""

    port = "/dev/ttyS0"
    baudrate = 9600
    timeout = 0.2
    in_waiting = 0

    def __init__(self, reply: Callable[[], bytes], failure: dict[str, Exception] | None = None):
        self._reply = reply
        self._failure = {} if failure is None else failure
        self.written = b""

    def _maybe_fail(self, name: str) -> None:
        if name in self._failure:
            raise self._failure[name]

    def reset_input_buffer(self) -> None:
        self._maybe_fail("reset_input_buffer")

    def write(self, data: bytes) -> int:
        self._maybe_fail("write")
        self.written += data
        return len(data)

    def read_until(self, expected: bytes, size: int) -> bytes:
        self._maybe_fail("read_until")
        reply = self._reply()
        end = reply.find(expected)
        return reply[: end + 1 if end >= 0 else size][:size]

    def read(self, size: int) -> bytes:
        return b""

    def close(self) -> None:
        self._maybe_fail("close")


def on_line(line: Line, clock: InstantClock) -> SV203:
    return SV203(lambda: cast(serial.Serial, line), clock=clock)
