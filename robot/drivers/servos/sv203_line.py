"""The serial line to one or more SV203 servo boards: lines of text, paced, and answers to queries.

A line has at most 20 characters and is ended by a carriage return. The boards acknowledge nothing,
and an answer is a decimal number with a carriage return.

Source: Pontech SV203 User Manual, revision 1.20. Two things are not in it, and want a look with an
oscilloscope on a new board: that a reply to ``RR`` ends with a carriage return as one to ``AD``
does, and whether the return counts among the 20 characters (lines here have at most 17 without it).
"""

from __future__ import annotations

import select
import termios
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

import serial

from robot.drivers.links.device_files import readers
from robot.errors import DeviceDataError, DeviceMissingError, DeviceTimeoutError
from robot.host.clock import Clock

LONGEST_REPLY: Final = len("255\r")

_BITS_PER_BYTE: Final = 10  # 8N1
_MAX_REPLY: Final = 16  # bytes; whatever is longer is no count, and not waited for
_PLUG: Final = "Check that the adapter is plugged in and the board has power."


class SV203Line:
    """An open serial line; not thread-safe.

    Args:
        open_port: Opens the port, which this object closes.
        clock: Paces the lines.
        gap: Pause after each line, s; the manual asks for about 3 ms.
        reply_timeout: Longest wait for the answer to a query, s.

    Attributes:
        bytes_written: Bytes handed to the port so far.
    """

    def __init__(
        self,
        open_port: Callable[[], serial.Serial],
        *,
        clock: Clock,
        gap: float,
        reply_timeout: float,
    ):
        self.bytes_written = 0
        self._open_port = open_port
        self._clock = clock
        self._gap = gap
        self._reply_timeout = reply_timeout
        self.open()

    def open(self) -> None:
        """Opens the port.

        Raises:
            DeviceMissingError: It cannot be opened.
        """
        self._port = self._open_port()
        self._byte_time = _BITS_PER_BYTE / self._port.baudrate
        with self._link("setting it up"):
            self._port.timeout = self._reply_timeout

    def close(self) -> None:
        """Closes the port; the boards keep the servos where they are."""
        with suppress(OSError, termios.error):  # the adapter may be gone, and with it the line
            self._port.close()

    def seconds_for(self, characters: int) -> float:
        """How long a line of so many characters takes, with the pause after it, s."""
        return (characters + 1) * self._byte_time + self._gap

    def seconds_to_ask(self, characters: int) -> float:
        """How long a query of so many characters takes, with its answer, s."""
        return self.seconds_for(characters) + LONGEST_REPLY * self._byte_time

    def write(self, line: str) -> None:
        """Sends a line, and waits it out.

        Raises:
            DeviceError: The line failed.
        """
        with self._link("writing to it"):
            try:
                self._port.write(line.encode("ascii") + b"\r")
            except serial.SerialTimeoutException:
                # pyserial says so, too, where this process stood still after it had written
                if not select.select([], [self._port.fileno()], [], 0)[1]:
                    raise
        self.bytes_written += len(line) + 1
        self._clock.sleep(self.seconds_for(len(line)))

    def ask(self, query: str, *, select: str, board: str) -> int:
        """Sends a query once; a number from 0 to 255 answers it.

        Args:
            query: What is asked.
            select: What stands before it on the line, to select the board; or nothing.
            board: What the board that shall answer is called in sentences.

        Raises:
            DeviceTimeoutError: No answer came.
            DeviceDataError: What came is no such number.
            DeviceMissingError: The line failed.
        """
        with self._link("emptying its input"):
            self._port.reset_input_buffer()
        self.write(select + query)
        with self._link("reading from it"):
            reply = self._port.read_until(b"\r", _MAX_REPLY)
            if not reply.endswith(b"\r"):  # it may have come while we had no processor
                reply += self._port.read(min(self._port.in_waiting, _MAX_REPLY - len(reply)))
        if not reply.endswith(b"\r") and len(reply) < _MAX_REPLY:
            self._clock.charge(self._reply_timeout)
            raise DeviceTimeoutError(
                f"The {board} did not answer {query} within {self._reply_timeout:g} s"
                f"{f' (only {reply!r})' if reply else ''}.",
                "Check its power, the cable, the baud rate and the board number, and "
                + readers(str(self._port.port)),
            )
        self._clock.charge(len(reply) * self._byte_time)
        digits = reply.strip(b"\r\n ")
        if not (digits.isdigit() and int(digits) <= 255):
            raise DeviceDataError(
                f"The {board} answered {reply!r} to {query} instead of a number 0 to 255.",
                "Check the cable, the ground and the baud rate, and "
                + readers(str(self._port.port)),
            )
        return int(digits)

    @contextmanager
    def _link(self, doing: str) -> Iterator[None]:
        # A hung-up line raises SerialException or OSError, and termios.error, which is neither.
        try:
            yield
        except serial.SerialTimeoutException as error:
            raise DeviceTimeoutError(
                f"The serial port {self._port.port} took no more bytes.", _PLUG
            ) from error
        except (OSError, termios.error) as error:
            raise DeviceMissingError(
                f"The serial port {self._port.port} failed while {doing}: {error}.", _PLUG
            ) from error
