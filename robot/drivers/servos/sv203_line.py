"""The serial line to one or more SV203 servo boards: lines of text, paced, and answers to queries.

A line has at most 20 characters and is ended by a carriage return. The boards acknowledge nothing,
and an answer is a decimal number with a carriage return.

Source: Pontech SV203 User Manual, revision 1.20. Two things are not in it, and want a look with an
oscilloscope on a new board: that a reply to ``RR`` ends with a carriage return as one to ``AD``
does, and whether the return counts among the 20 characters (lines here have at most 17 without it).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import serial

from robot.drivers.links.device_files import readers
from robot.drivers.links.serial_line import SerialLine
from robot.errors import DeviceDataError, DeviceTimeoutError
from robot.host.clock import Clock

LONGEST_REPLY: Final = len("255\r")

_MAX_REPLY: Final = 16  # bytes; whatever is longer is no count, and not waited for


class SV203Line:
    """An open serial line; not thread-safe.

    Args:
        open_port: Opens the port, which this object closes.
        clock: Paces the lines.
        gap: Pause after each line, s; the manual asks for about 3 ms.
        reply_timeout: Longest wait for the answer to a query, s.
    """

    def __init__(
        self,
        open_port: Callable[[], serial.Serial],
        *,
        clock: Clock,
        gap: float,
        reply_timeout: float,
    ):
        self._gap = gap
        self._reply_timeout = reply_timeout
        self._line = SerialLine(open_port, clock=clock, reply_timeout=reply_timeout)
        self.open = self._line.open
        self.close = self._line.close

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the port so far."""
        return self._line.bytes_written

    def seconds_for(self, characters: int) -> float:
        """Time that a line of so many characters takes, with the pause after it, s."""
        return self._line.seconds_for(characters + 1) + self._gap

    def seconds_to_ask(self, characters: int) -> float:
        """Time that a query of so many characters takes, with its answer, s."""
        return self.seconds_for(characters) + self._line.seconds_for(LONGEST_REPLY)

    def write(self, line: str) -> None:
        """Sends a line, and waits as long as it takes, with the pause after it.

        Raises:
            DeviceError: The line failed.
        """
        self._line.write(line.encode("ascii") + b"\r", gap=self._gap)

    def ask(self, query: str, *, select: str, board: str) -> int:
        """Sends a query once; returns the answer, a number from 0 to 255.

        Args:
            query: Query to send.
            select: Command before the query that selects the board; empty for none.
            board: Name of the board that shall answer, for messages.

        Raises:
            DeviceTimeoutError: No answer came.
            DeviceDataError: What came is no such number.
            DeviceMissingError: The line failed.
        """
        self._line.clear()
        self.write(select + query)
        reply = self._line.read_until(b"\r", _MAX_REPLY)
        if not reply.endswith(b"\r") and len(reply) < _MAX_REPLY:
            raise DeviceTimeoutError(
                f"The {board} did not answer {query} within {self._reply_timeout:g} s"
                f"{f' (only {reply!r})' if reply else ''}.",
                "Check its power, the cable, the baud rate and the board number, and "
                + readers(self._line.port),
            )
        digits = reply.strip(b"\r\n ")
        if not (digits.isdigit() and int(digits) <= 255):
            raise DeviceDataError(
                f"The {board} answered {reply!r} to {query} instead of a number 0 to 255.",
                "Check the cable, the ground and the baud rate, and " + readers(self._line.port),
            )
        return int(digits)
