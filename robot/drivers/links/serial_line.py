"""A serial line to devices that speak in turns: bytes out, paced by the robot clock, an answer in.

A time-out costs real time and as much robot time, which the wall clock of a robot has seen go by.
"""

from __future__ import annotations

import select
import termios
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

import serial

from robot.errors import DeviceMissingError, DeviceTimeoutError
from robot.host.clock import Clock

_BITS_PER_BYTE: Final = 10  # 8N1
_PLUG: Final = "Check that the adapter is plugged in and the board has power."


class SerialLine:
    """An open serial line; not thread-safe.

    Methods raise ``DeviceMissingError`` where the line failed, or cannot be opened.

    Args:
        open_port: Opens the port, which this object closes.
        clock: Paces what is sent.
        reply_timeout: Longest wait for an answer, s.

    Attributes:
        bytes_written: Bytes handed to the port so far.
    """

    def __init__(
        self, open_port: Callable[[], serial.Serial], *, clock: Clock, reply_timeout: float
    ):
        self.bytes_written = 0
        self._open_port = open_port
        self._clock = clock
        self._reply_timeout = reply_timeout
        self.open()

    @property
    def port(self) -> str:
        """Device file of the line."""
        return str(self._port.port)

    def open(self) -> None:
        """Opens the port."""
        self._port = self._open_port()
        self._byte_time = _BITS_PER_BYTE / self._port.baudrate
        with self._link("setting it up"):
            self._port.timeout = self._reply_timeout

    def close(self) -> None:
        """Closes the port; what is behind it keeps its state."""
        with suppress(OSError, termios.error):  # the adapter may be gone, and with it the line
            self._port.close()

    def seconds_for(self, count: int) -> float:
        """Time that ``count`` bytes take on the line, s."""
        return count * self._byte_time

    def write(self, data: bytes, *, gap: float = 0.0) -> None:
        """Sends bytes, and waits as long as the line takes to carry them.

        Args:
            data: Bytes to send.
            gap: Pause after the bytes, s.

        Raises:
            DeviceTimeoutError: The port took no more bytes.
        """
        with self._link("writing to it"):
            try:
                self._port.write(data)
            except serial.SerialTimeoutException:
                # pyserial says so, too, where this process stood still after it had written
                if not select.select([], [self._port.fileno()], [], 0)[1]:
                    raise
        self.bytes_written += len(data)
        self._clock.sleep(self.seconds_for(len(data)) + gap)

    def clear(self) -> None:
        """Discards the bytes that came in."""
        with self._link("emptying its input"):
            self._port.reset_input_buffer()

    def read(self, count: int) -> bytes:
        """Reads ``count`` bytes; fewer after a time-out, whose whole wait the clock is charged."""
        with self._link("reading from it"):
            data: bytes = self._port.read(count)
            if len(data) < count:  # it may have come while we had no processor
                data += self._port.read(min(self._port.in_waiting, count - len(data)))
        self._charge(data, in_time=len(data) == count)
        return data

    def read_until(self, end: bytes, at_most: int) -> bytes:
        """Reads up to and including ``end``, or ``at_most`` bytes; fewer after a time-out."""
        with self._link("reading from it"):
            data: bytes = self._port.read_until(end, at_most)
            if not data.endswith(end):  # as in ``read``
                data += self._port.read(min(self._port.in_waiting, at_most - len(data)))
        self._charge(data, in_time=data.endswith(end) or len(data) >= at_most)
        return data

    def _charge(self, found: bytes, *, in_time: bool) -> None:
        self._clock.charge(self.seconds_for(len(found)) if in_time else self._reply_timeout)

    @contextmanager
    def _link(self, doing: str) -> Iterator[None]:
        # A hung-up line raises SerialException or OSError, and termios.error, which is neither.
        try:
            yield
        except serial.SerialTimeoutException as error:
            raise DeviceTimeoutError(
                f"The serial port {self.port} took no more bytes.", _PLUG
            ) from error
        except (OSError, termios.error) as error:
            raise DeviceMissingError(
                f"The serial port {self.port} failed while {doing}: {error}.", _PLUG
            ) from error
