"""Pontech SV203 servo board: eight servos on a serial line; its analogue inputs are not used.

Commands are ASCII lines of at most 20 characters, ended by a carriage return. The board
acknowledges nothing and ignores what it does not understand. So this driver checks ranges itself,
selects the servo on every line, and offers ``verify`` to find out whether the board still has what
it was sent.

After a brown-out the board comes back deselected, with all servos at neutral, and acts upon nothing
until it is selected. Moves therefore never select it: those that are under way when it is reset
reach a board that ignores them, instead of making every servo leap back to where it was. Only a
query selects, and only one whose answer is waited for, when the driver begins and after it was told
to ``forget``. Otherwise a query that stays unanswered is how a reset is noticed. A second board on
the same line would have to be read back in the same way at each change of the selection. All this
holds for a board as it leaves the factory; one that was set up to be selected when it is switched
on would follow the moves after a reset.

Source: Pontech SV203 User Manual, revision 1.20. Three things are not in it, and want a look with
an oscilloscope on a new board: that count 0 stops the pulses (``release``), that a reply to ``RR``
ends with a carriage return as one to ``AD`` does, and whether the return counts among the 20
characters (lines here have at most 15 without it).
"""

from __future__ import annotations

import termios
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import ClassVar, Final

import serial

from robot.drivers.buses import Buses
from robot.errors import (
    CommandError,
    DeviceDataError,
    DeviceError,
    DeviceMissingError,
    DeviceTimeoutError,
)
from robot.host.clock import Clock
from robot.toml_sections import Section

OUTPUTS: Final = range(1, 9)
COUNTS: Final = range(1, 256)
LIMP: Final = 0
BAUDS: Final = (2400, 4800, 9600, 19200)

_SERVOS_PER_LINE: Final = 2
_BITS_PER_BYTE: Final = 10  # 8N1
_FIRST_POSITION: Final = 51  # RAM cell of servo 1's commanded count
_MAX_REPLY: Final = 16
_ATTEMPTS: Final = 3
_RESET: Final = "Check the servos' supply: it drops under load."
_PLUG: Final = "Check that the adapter is plugged in and the board has power."


@dataclass(frozen=True, kw_only=True)
class SV203Settings:
    """The serial line to the board, and the board's number on it."""

    name: ClassVar = "SV203"
    outputs: ClassVar = OUTPUTS
    counts: ClassVar = COUNTS
    per_update: ClassVar = _SERVOS_PER_LINE
    reads_back: ClassVar = True
    port: str = field(repr=False)  # a re-plugged adapter may have another name
    baud: int
    board: int
    line_gap: float

    @classmethod
    def read(cls, table: Section) -> SV203Settings:
        """``port``, ``baud``, ``board`` and ``line_gap_ms``."""
        return cls(
            port=table.text("port"),
            baud=table.one_of("baud", BAUDS, 9600),
            board=table.integer("board", 0, 255, 1),
            line_gap=table.number("line_gap_ms", 3, 100, 3) / 1000,
        )

    def open(self, buses: Buses) -> SV203:
        """Opens the line; the board is first heard of at the first query."""
        return SV203(
            lambda: buses.open_serial(self.port, self.baud),
            board=self.board,
            clock=buses.clock,
            line_gap=self.line_gap,
        )

    def __str__(self) -> str:
        return f"board {self.board} on {self.port}, {self.baud} baud"


class SV203:
    """One servo board.

    The driver remembers what it sent and sends only what changes. It is not thread-safe.

    Args:
        open_port: Opens the line, which the driver closes.
        board: The board's number, 0 to 255; factory setting 1, and 0 addresses every board.
        clock: Paces the lines.
        line_gap: Pause after each line, s; the manual asks for about 3 ms.
        reply_timeout: Longest wait for the answer to a query, s.

    Attributes:
        name: What it is called in sentences.
        bytes_written: Bytes handed to the serial line by this object, for a clock that must
            know when an emulated board has seen them all.
        repeats: Queries that had to be asked again, because the answer was damaged or did not come.
    """

    name = SV203Settings.name

    def __init__(
        self,
        open_port: Callable[[], serial.Serial],
        *,
        board: int = 1,
        clock: Clock,
        line_gap: float = 0.003,
        reply_timeout: float = 0.2,
    ):
        self.bytes_written = 0
        self._select = f"BD{board}"
        self._clock = clock
        self._line_gap = line_gap
        self._reply_timeout = reply_timeout
        self._sent: dict[int, int] = {}
        self._selected = False
        self.repeats = 0
        self._open_port = open_port
        self._open()

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Sends the counts that differ from the last ones sent, and waits out the line.

        Args:
            counts: Count 1 to 255 by servo output 1 to 8; one count is about 0.7°.

        Raises:
            CommandError: An output or count out of range, or the board was not read since the
                driver began, forgot or noticed a reset; nothing was sent.
            DeviceError: The line failed; counts not known to have arrived are forgotten.
        """
        if not self._selected:
            raise CommandError("read the servo board's counts before moving its servos")
        for output, count in counts.items():
            _check_output(output)
            if count not in COUNTS:
                raise CommandError(f"servo {output}: the count must lie in 1 to 255, not {count}")
        self._send(counts)

    def release(self, outputs: Iterable[int] = OUTPUTS) -> None:
        """Stops the pulses of some servos, so that they go limp, also on a board that was reset.

        Raises:
            CommandError: An output out of range; nothing was sent.
            DeviceError: The line failed.
        """
        counts = dict.fromkeys(outputs, LIMP)
        for output in counts:
            _check_output(output)
            self._sent.pop(output, None)  # a limp servo is worth the bytes of a repeat
        self._send(counts, select=self._select)

    def read_counts(self, outputs: Iterable[int] = OUTPUTS) -> dict[int, int]:
        """Asks the board which counts it has been sent; no servo reports where it really is.

        Returns:
            Count 0 (limp) to 255 by output.

        Raises:
            CommandError: An output out of range.
            DeviceError: The line failed, no reply came, or only garbage did.
        """
        wanted = list(outputs)
        for output in wanted:
            _check_output(output)
        return {output: self._query(f"RR{_FIRST_POSITION + output - 1}") for output in wanted}

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """Compares the board with what it should have; a difference means a damaged line.

        A difference is read twice, so that it is not the reply that was damaged.

        Returns:
            The outputs that differ, ascending; these are forgotten and will be sent again.

        Raises:
            DeviceDataError: The board was reset.
            DeviceError: As ``read_counts``.
        """
        suspects = [n for n, count in self.read_counts(expected).items() if count != expected[n]]
        differing = [n for n, count in self.read_counts(suspects).items() if count != expected[n]]
        for output in differing:
            self._sent.pop(output, None)
        return sorted(differing)

    def forget(self) -> None:
        """Forgets what is known of the board: the next query selects it, all counts are sent."""
        self._sent.clear()
        self._selected = False

    def reopen(self) -> None:
        """Closes the line and opens it anew: an adapter that was re-plugged is another device.

        Raises:
            DeviceMissingError: It cannot be opened.
        """
        self.close()
        self.forget()
        self._open()

    def seconds_for(self, changed: int) -> float:
        """How long ``set_counts`` takes at most when so many counts changed, s."""
        pairs, single = divmod(changed, _SERVOS_PER_LINE)
        one = len("SV8M255")
        return pairs * self._line_time(2 * one) + single * self._line_time(one)

    def close(self) -> None:
        """Closes the line; the board keeps the servos where they are."""
        with suppress(OSError, termios.error):  # the adapter may be gone, and with it the line
            self._port.close()

    def _open(self) -> None:
        self._port = self._open_port()
        self._byte_time = _BITS_PER_BYTE / self._port.baudrate
        with self._link("setting it up"):
            self._port.timeout = self._reply_timeout

    def _send(self, counts: Mapping[int, int], *, select: str = "") -> None:
        changed = sorted(n for n, count in counts.items() if self._sent.get(n) != count)
        for start in range(0, len(changed), _SERVOS_PER_LINE):
            group = changed[start : start + _SERVOS_PER_LINE]
            for output in group:
                self._sent.pop(output, None)
            self._write(select + "".join(f"SV{n}M{counts[n]}" for n in group))
            self._sent.update((n, counts[n]) for n in group)

    def _write(self, line: str) -> None:
        with self._link("writing to it"):
            self._port.write(line.encode("ascii") + b"\r")
        self.bytes_written += len(line) + 1
        self._clock.sleep(self._line_time(len(line)))

    def _line_time(self, characters: int) -> float:
        return (characters + 1) * self._byte_time + self._line_gap

    def _query(self, command: str) -> int:
        """Repeats a query, which changes nothing, until a sound reply comes.

        Raises:
            DeviceDataError: The board was reset, or answers only garbage.
            DeviceError: It does not answer, or the line failed.
        """
        for _ in range(_ATTEMPTS - 1):
            with suppress(DeviceTimeoutError, DeviceDataError):
                return self._ask(command)
            self.repeats += 1
        try:
            return self._ask(command)
        except DeviceTimeoutError:
            if self._selected:
                self._look_for_reset(command)
            raise

    def _ask(self, command: str) -> int:
        """Asks once, and selects the board with the question where that was not yet done."""
        answer = self._query_once(command, select="" if self._selected else self._select)
        self._selected = True
        return answer

    def _look_for_reset(self, command: str) -> None:
        """A board that answers only when it is selected anew was reset since it last was."""
        try:
            self._query_once(command, select=self._select)
        except DeviceError:
            return
        self.forget()
        raise DeviceDataError(
            "The servo board (SV203) is not selected any more: it was reset, and its servos went "
            "to neutral.",
            _RESET,
        )

    def _query_once(self, command: str, *, select: str) -> int:
        with self._link("emptying its input"):
            self._port.reset_input_buffer()
        self._write(select + command)
        with self._link("reading from it"):
            reply = self._port.read_until(b"\r", _MAX_REPLY)
            if not reply.endswith(b"\r"):  # it may have come while we had no processor
                reply += self._port.read(min(self._port.in_waiting, _MAX_REPLY - len(reply)))
        if not reply.endswith(b"\r") and len(reply) < _MAX_REPLY:
            self._clock.charge(self._reply_timeout)
            raise DeviceTimeoutError(
                f"The servo board (SV203) did not answer {command} within {self._reply_timeout:g} s"
                f"{f' (only {reply!r})' if reply else ''}.",
                "Check its power, the cable, the baud rate and the board number.",
            )
        self._clock.charge(len(reply) * self._byte_time)
        digits = reply.strip(b"\r\n ")
        if not (digits.isdigit() and int(digits) <= 255):
            raise DeviceDataError(
                f"The servo board (SV203) answered {reply!r} to {command} instead of a number 0 "
                "to 255.",
                "Check the cable, the ground and the baud rate.",
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


def _check_output(output: int) -> None:
    if output not in OUTPUTS:
        raise CommandError(f"the servo board has outputs 1 to 8, not {output}")
