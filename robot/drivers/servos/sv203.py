"""Pontech SV203 servo boards: eight servos each, one or more boards on a serial line.

The analogue inputs are not used. Commands are lines of text, of at most 20 characters and with a
carriage return at the end; an answer is a decimal number with a carriage return. The boards
acknowledge nothing and ignore what they do not understand. So this driver checks ranges itself,
selects the servo on every line, and offers ``verify`` to find out whether a board still has what it
was sent.

After a brown-out a board comes back deselected, with all servos at neutral, and acts upon nothing
until it is selected. Moves therefore never select it: those that are under way when it is reset
reach a board that ignores them, instead of making every servo leap back to where it was. A query
selects, whose answer is waited for, when the driver begins and after it was told to ``forget``; and
a release does, which a board that was reset must obey, too. Otherwise a query that stays unanswered
is how a reset is noticed.

Where several boards share the line, selecting one deselects the others, so each must be selected
again and again. Then, and before the first move after a release, it is selected with a question for
the servo that it holds furthest from neutral: one that does not have that count any more was reset,
and gets no move. (A reset of a board whose driven servos all stand at neutral may not be found out
in this way, and has thrown none of them.) All this holds for boards as they leave the factory; one
that was set up to be selected when it is switched on would follow the moves after a reset.

Source: Pontech SV203 User Manual, revision 1.20. Three things are not in it, and want a look with
an oscilloscope on a new board: that count 0 stops the pulses (``release``), that a reply to ``RR``
ends with a carriage return as one to ``AD`` does, and whether the return counts among the 20
characters (lines here have at most 17 without it).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar, Final

import serial

from robot.drivers.buses import Buses
from robot.drivers.links.device_files import readers
from robot.drivers.links.serial_line import SerialLine
from robot.drivers.servos.servo_bus import check_counts, check_outputs
from robot.errors import CommandError, DeviceDataError, DeviceTimeoutError
from robot.host.clock import Clock
from robot.toml_sections import Section

SERVOS: Final = 8  # of one board
COUNTS: Final = range(1, 256)
NEUTRAL: Final = 128
LIMP: Final = 0
BAUDS: Final = (2400, 4800, 9600, 19200)
MAX_BOARDS: Final = 8

_SERVOS_PER_LINE: Final = 2
_FIRST_POSITION: Final = 51  # RAM cell of servo 1's commanded count
_ATTEMPTS: Final = 3  # of a query; a sound line needs one, and the doctor counts the others
_LONGEST_REPLY: Final = len("255\r")
_MAX_REPLY: Final = 16  # bytes; whatever is longer is no count, and not waited for
_RESET_ADVICE: Final = "Check the servos' supply: it drops under load."


@dataclass(frozen=True, kw_only=True)
class SV203Settings:
    """The serial line to the boards, and their numbers on it."""

    name: ClassVar = "SV203"
    counts: ClassVar = COUNTS
    known_counts: ClassVar = COUNTS
    per_update: ClassVar = _SERVOS_PER_LINE
    reads_back: ClassVar = True
    port: str = field(repr=False)  # a re-plugged adapter may have another name
    baud: int
    boards: tuple[int, ...]
    line_gap: float

    @property
    def outputs(self) -> range:
        """Numbers of the outputs: 1 to 8 for the first board's servos, 9 to 16 for the second's."""
        return range(1, SERVOS * len(self.boards) + 1)

    @classmethod
    def read(cls, table: Section) -> SV203Settings:
        """Reads the keys ``port``, ``baud``, ``board`` and ``line_gap_ms``."""
        boards = table.integers("board", 0, 255, (1,))
        if len(boards) > MAX_BOARDS or (0 in boards and len(boards) > 1):
            raise table.refuse(
                "board",
                f"must be a number, or up to {MAX_BOARDS} numbers from 1, not {list(boards)}; 0 "
                "addresses every board.",
            )
        return cls(
            port=table.text("port"),
            baud=table.one_of("baud", BAUDS, 9600),
            boards=boards,
            line_gap=table.number("line_gap_ms", 3, 100, 3) / 1000,
        )

    def open(self, buses: Buses) -> SV203:
        """Opens the line; a board is first heard of at its first query."""
        return SV203(
            lambda: buses.open_serial(self.port, self.baud),
            boards=self.boards,
            clock=buses.clock,
            line_gap=self.line_gap,
        )

    def __str__(self) -> str:
        numbers = " and ".join(map(str, self.boards))
        plural = "s" if len(self.boards) > 1 else ""
        return f"board{plural} {numbers} on {self.port}, {self.baud} baud"


class SV203:
    """The servo boards of one line.

    The driver remembers what it sent and sends only what changes. It is not thread-safe. Methods
    raise ``CommandError`` for an output or count out of range, and send nothing then;
    ``DeviceDataError`` where a board was reset; ``DeviceError`` where the line failed, or no sound
    reply came.

    Args:
        open_port: Opens the line, which the driver closes.
        boards: The boards' numbers, 1 to 255; factory setting 1. A 0 addresses every board.
        clock: Paces the lines.
        line_gap: Pause after each line, s; the manual asks for about 3 ms.
        reply_timeout: Longest wait for the answer to a query, s.

    Attributes:
        name: Name of the boards, for messages.
        repeats: Number of queries asked again, because the answer was damaged or did not come.
    """

    name = SV203Settings.name

    def __init__(
        self,
        open_port: Callable[[], serial.Serial],
        *,
        boards: Sequence[int] = (1,),
        clock: Clock,
        line_gap: float = 0.003,
        reply_timeout: float = 0.2,
    ):
        self.repeats = 0
        self._boards = tuple(boards)
        self._outputs = range(1, SERVOS * len(boards) + 1)
        self._sent: dict[int, int] = {}  # counts by output that need not be sent again
        self._held: dict[int, int] = {}  # counts that boards that were read should hold
        self._selected: int | None = None
        self._gap = line_gap
        self._reply_timeout = reply_timeout
        self._line = SerialLine(open_port, clock=clock, reply_timeout=reply_timeout)

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the line, for a clock that must know when emulated boards have them."""
        return self._line.bytes_written

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Sends the counts that differ from the last ones sent, and waits out the line.

        Args:
            counts: Count 1 to 255 by output; one count is about 0.7°.

        Raises:
            CommandError: A board was not read since the driver began, forgot or noticed a reset;
                nothing was sent.
            DeviceDataError: A board was reset; it got nothing.
            DeviceError: The line failed; counts not known to have arrived are forgotten.
        """
        check_counts(counts, COUNTS, self._outputs)
        if not all(self._held_by(self._board_of(output)) for output in counts):
            raise CommandError("read the servo board's counts before moving its servos")
        changed = sorted(n for n, count in counts.items() if self._sent.get(n) != count)
        for board, outputs in self._by_board(changed):
            self._select(board)
            self._send(board, {n: counts[n] for n in outputs})

    def release(self, outputs: Iterable[int] | None = None) -> None:
        """Stops the pulses of some servos, so that they go limp, also on a board that was reset."""
        limp = dict.fromkeys(self._outputs if outputs is None else outputs, LIMP)
        check_outputs(limp, self._outputs)
        for output in limp:
            self._sent.pop(output, None)  # a limp servo is worth the bytes of a repeat
        self._selected = None  # a board that was reset is selected, too: whoever moves it next asks
        for board, group in self._by_board(sorted(limp)):
            self._send(board, dict.fromkeys(group, LIMP), select=f"BD{board}")

    def read_counts(self, outputs: Iterable[int] | None = None) -> dict[int, int]:
        """Asks the boards which counts they have been sent; no servo reports where it really is.

        Returns:
            Count 0 (limp) to 255 by output.
        """
        asked_outputs = list(self._outputs if outputs is None else outputs)
        check_outputs(asked_outputs, self._outputs)
        counts = {}
        for output in asked_outputs:
            self._select(self._board_of(output))
            counts[output] = self._held[output] = self._query(output)
        return counts

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """Compares the boards with the counts they should have; they differ by damaged commands.

        A difference is read twice, so that it is not the reply that was damaged.

        Returns:
            The outputs that differ, ascending; these are forgotten and will be sent again.
        """
        suspects = [n for n, count in self.read_counts(expected).items() if count != expected[n]]
        differing = [n for n, count in self.read_counts(suspects).items() if count != expected[n]]
        for output in differing:
            self._sent.pop(output, None)
        return sorted(differing)

    def forget(self) -> None:
        """Forgets what is known of the boards: the next queries select them, all is sent again."""
        self._sent.clear()
        self._held.clear()
        self._selected = None

    def reopen(self) -> None:
        """Closes the line and opens it anew: an adapter that was re-plugged is another device."""
        self._line.close()
        self.forget()
        self._line.open()

    def seconds_for(self, changed: int) -> float:
        """Longest time that ``set_counts`` takes when ``changed`` counts changed, s.

        The question after a release, for the one board of a line, comes on top of it.
        """
        used = min(len(self._boards), changed) if len(self._boards) > 1 else 0
        pairs, single = divmod(changed - used, _SERVOS_PER_LINE)
        size = len("SV8M255")
        return (
            pairs * self._line_time(2 * size)
            + (single + used) * self._line_time(size)  # a board's last line may have but one
            + used * (self._line_time(len("BD255RR58")) + self._line.seconds_for(_LONGEST_REPLY))
        )

    def close(self) -> None:
        """Closes the line; the boards keep the servos where they are."""
        self._line.close()

    def _board_of(self, output: int) -> int:
        return self._boards[(output - 1) // SERVOS]

    def _held_by(self, board: int) -> dict[int, int]:
        """Counts that a board should hold, by output; none if it was not read."""
        return {n: count for n, count in self._held.items() if self._board_of(n) == board}

    def _by_board(self, outputs: Sequence[int]) -> list[tuple[int, list[int]]]:
        """Groups outputs by board, the selected board first; leaves out boards without any."""
        boards = sorted(self._boards, key=lambda board: board != self._selected)
        groups = ((board, [n for n in outputs if self._board_of(n) == board]) for board in boards)
        return [(board, group) for board, group in groups if group]

    def _board_name(self, board: int) -> str:
        number = f", board {board}" if len(self._boards) > 1 else ""
        return f"servo board ({self.name}{number})"

    def _send(self, board: int, counts: Mapping[int, int], *, select: str = "") -> None:
        outputs = list(counts)
        for start in range(0, len(outputs), _SERVOS_PER_LINE):
            group = {n: counts[n] for n in outputs[start : start + _SERVOS_PER_LINE]}
            for output in group:
                self._sent.pop(output, None)
            self._write(select + "".join(f"SV{_servo(n)}M{count}" for n, count in group.items()))
            self._sent |= group
            if self._held_by(board):
                self._held |= group

    def _select(self, board: int) -> None:
        """Selects a board that was read before, unless reset; a first query selects the others."""
        held = self._held_by(board)
        if board == self._selected or not held:
            return
        # A limp servo says least: a release after the reset has made it limp again.
        probe = max(held, key=lambda n: (held[n] not in (LIMP, NEUTRAL), abs(held[n] - NEUTRAL)))
        for _ in range(2):  # it may be the answer that was damaged
            count = self._query(probe)
            if count == held[probe]:
                return
        self.forget()
        raise DeviceDataError(
            f"The {self._board_name(board)} has count {count} at output {probe} instead of "
            f"{held[probe]}: it was reset, or bytes were lost on the line.",
            _RESET_ADVICE,
        )

    def _query(self, output: int) -> int:
        """Repeats a query, which changes nothing, until a sound reply comes."""
        for _ in range(_ATTEMPTS - 1):
            with suppress(DeviceTimeoutError, DeviceDataError):
                return self._ask(output)
            self.repeats += 1
        try:
            return self._ask(output)
        except DeviceTimeoutError:
            if self._board_of(output) == self._selected:
                self._look_for_reset(output)
            raise

    def _ask(self, output: int) -> int:
        """Asks once, and selects the board with the question where that is not yet done."""
        board = self._board_of(output)
        select = ""
        if board != self._selected:
            self._selected, select = None, f"BD{board}"
        answer = self._ask_line(output, select=select)
        self._selected = board
        return answer

    def _look_for_reset(self, output: int) -> None:
        """Raises if a board answers only when it is selected anew: then it was reset."""
        board = self._board_of(output)
        for _ in range(_ATTEMPTS):
            with suppress(DeviceTimeoutError, DeviceDataError):
                self._ask_line(output, select=f"BD{board}")
                break
        else:
            return
        self.forget()
        raise DeviceDataError(
            f"The {self._board_name(board)} is not selected any more: it was reset, and its servos "
            "went to neutral.",
            _RESET_ADVICE,
        )

    def _line_time(self, characters: int) -> float:
        """Time that a line of so many characters takes, with the pause after it, s."""
        return self._line.seconds_for(characters + 1) + self._gap

    def _write(self, line: str) -> None:
        """Sends a line, and waits as long as it takes, with the pause after it."""
        self._line.write(line.encode("ascii") + b"\r", gap=self._gap)

    def _ask_line(self, output: int, *, select: str) -> int:
        """Sends a query behind what selects its board, once; returns the answer, 0 to 255."""
        query = f"RR{_FIRST_POSITION + _servo(output) - 1}"
        board = self._board_name(self._board_of(output))
        self._line.clear()
        self._write(select + query)
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


def _servo(output: int) -> int:
    """The number of a servo on its own board."""
    return (output - 1) % SERVOS + 1
