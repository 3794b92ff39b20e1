"""Emulated Pontech SV203 servo boards on a serial line.

Source: Pontech SV203 User Manual, revision 1.20, and the command list of the SV200, its sister
board. Where these are silent the emulator assumes, and drivers should not rely on it: lower-case
letters, lines over 20 characters and whatever follows something unknown are ignored; ``M0`` stops
the pulses; neutral is count 128; the factory leaves the baud rate in EEPROM cell 9. Not modelled:
baud rate, the delay of ``D``, EEPROM programs, infra-red.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import count
from types import MappingProxyType
from typing import ClassVar, Final

from robot.errors import CommandError
from sim_robot.electronics.fault_switch import EVERY_NTH, Fault
from sim_robot.electronics.serial_device import SerialDevice

OUTPUTS: Final = 8
NEUTRAL: Final = 128
LIMP: Final = 0
MAX_LINE: Final = 20

_POSITIONS: Final = range(51, 51 + OUTPUTS)  # RAM cells of the servos' counts
_EEPROM_SIZE: Final = 8191
_MAX_BUFFER: Final = 256  # longer lines are long since void
_TOKEN: Final = re.compile(r"[ ,]*(?:(\?)|([A-Z]{1,2}) *(-?[0-9]{1,6})?(?: +(-?[0-9]{1,6}))?)")
_MOVED_COUNT: Final = 200  # where the fault "moved" sends an output

_COMMANDS: Final = MappingProxyType[str, tuple[tuple[int, int], ...]](
    {
        "BD": ((0, 255),),
        "SV": ((1, OUTPUTS),),
        "M": ((0, 255),),
        "I": ((-128, 127),),
        "D": ((1, 65535),),  # does nothing: the emulated processor has no time of its own
        "PS": ((1, OUTPUTS),),
        "PC": ((1, OUTPUTS),),
        "PT": ((1, OUTPUTS),),
        "AD": ((1, 5),),
        "SO": ((0, 255),),  # does nothing: no device is on the SPI port
        "SI": (),
        "WR": ((0, 255), (0, 255)),
        "RR": ((0, 255),),
        "WE": ((0, _EEPROM_SIZE - 1), (0, 255)),
        "RE": ((0, _EEPROM_SIZE - 1),),
        "?": (),
    }
)
"""Commands, and the limits of what each is given."""


class Board:
    """The processor of one board: bytes in, servo pulses and answers out; no I/O, no threads.

    Args:
        number: Number that the board answers to; 0 addresses every board.

    Attributes:
        pulses: Count at each output, 0 without pulses; replaced, never changed in place.
        analogue: Readings of the five analogue inputs, 0 to 255.
        on_move: Called with servo, count before and count after whenever a command changes one;
            what servos do by themselves when the supply comes back is no move, nor is ``place``.
    """

    pulses: tuple[int, ...]

    def __init__(self, number: int = 1):
        self.analogue = [0] * 5
        self.on_move: Callable[[int, int, int], None] = lambda servo, before, after: None
        self._number = number
        self._eeprom = bytearray(b"\xff" * _EEPROM_SIZE)
        self._eeprom[9] = 50
        self.power_up()

    def power_up(self) -> None:
        """Does what happens when the supply comes (back): deselected, all servos to neutral."""
        self._enabled = False
        self._servo: int | None = None
        self._line = bytearray()
        self._ram = bytearray(256)
        self._ram[_POSITIONS[0] : _POSITIONS[-1] + 1] = bytes((NEUTRAL,)) * OUTPUTS
        self._pins = [False] * OUTPUTS
        self.pulses = (NEUTRAL,) * OUTPUTS

    def receive(self, data: bytes) -> bytes:
        """Takes bytes from the line and returns the answers."""
        replies = []
        for byte in data:
            if byte == 0x0D:
                if len(self._line) <= MAX_LINE:
                    replies.append(self._execute(self._line.decode("latin-1")))
                self._line.clear()
            elif byte != 0x0A and len(self._line) < _MAX_BUFFER:
                self._line.append(byte)
        return b"".join(replies)

    def _execute(self, line: str) -> bytes:
        replies = []
        start = 0
        while (token := _TOKEN.match(line, start)) is not None:
            start = token.end()
            name = token[1] or token[2]
            if name not in _COMMANDS:
                break
            arguments = [int(text) for text in token.groups()[2:] if text is not None]
            limits = _COMMANDS[name]
            if len(arguments) != len(limits) or not (name == "BD" or self._enabled):
                continue
            if all(
                low <= value <= high for value, (low, high) in zip(arguments, limits, strict=True)
            ):
                self._obey(name, arguments)
                reply = self._answer(name, arguments)
                if reply is not None:
                    replies.append(f"{reply}\r")
        return "".join(replies).encode("ascii")

    def _obey(self, name: str, arguments: Sequence[int]) -> None:
        match name, arguments:
            case "BD", [number]:
                self._enabled = number in (0, self._number)
            case "SV", [number]:
                self._servo = number
            case "M", [count] if self._servo is not None:
                self._set(self._servo, count)
            case "I", [change] if self._servo is not None:
                count = self.pulses[self._servo - 1] + change
                if 0 <= count <= 255:
                    self._set(self._servo, count)
            case "PS" | "PC" | "PT", [pin]:
                self._pins[pin - 1] = name == "PS" or (name == "PT" and not self._pins[pin - 1])
                self._set(pin, LIMP)  # a steady level carries no pulses
            case "WR", [cell, value] if cell in _POSITIONS:
                self._set(_POSITIONS.index(cell) + 1, value)
            case "WR", [cell, value]:
                self._ram[cell] = value
            case "WE", [cell, value]:
                self._eeprom[cell] = value

    def _answer(self, name: str, arguments: Sequence[int]) -> int | str | None:
        """The answer to a query; ``None`` to what is none."""
        match name, arguments:
            case "AD", [channel]:
                return self.analogue[channel - 1]
            case "SI", _:
                return 0
            case "RR", [cell]:
                return self._ram[cell]
            case "RE", [cell]:
                return self._eeprom[cell]
            case "?", _:
                return f"SV203 emulator: {' '.join(_COMMANDS).removesuffix(' ?')}"
        return None

    def place(self, servo: int, count: int) -> None:
        """Moves a servo as another program on the line would; ``on_move`` is not called."""
        self._ram[_POSITIONS[servo - 1]] = count
        self.pulses = tuple(self._ram[cell] for cell in _POSITIONS)

    def _set(self, servo: int, count: int) -> None:
        old_count = self.pulses[servo - 1]
        self.place(servo, count)
        if count != old_count:
            self.on_move(servo, old_count, count)


class SV203Emulator(SerialDevice):
    """Boards on a serial line.

    Args:
        boards: Numbers that the boards answer to.
    """

    FAULTS: ClassVar[Mapping[str, Fault]] = {
        **SerialDevice.FAULTS,
        "mute": Fault("the board answers no queries"),
        "garbage": Fault("every n-th answer has its first digit replaced by '~'", EVERY_NTH),
        "brown_out": Fault(
            "the supply of board n dips, of all without a number: servos jump to neutral, the "
            "board is deselected",
            once=True,
        ),
        "moved": Fault(
            f"another program on the line sends output n to count {_MOVED_COUNT}", once=True
        ),
    }

    def __init__(self, *, boards: Sequence[int] = (1,)):
        self._boards = {number: Board(number) for number in boards}
        self._replies = 0
        super().__init__()

    def pulses(self) -> tuple[int, ...]:
        """Count 1 to 255 at each output, or 0 where there are no pulses; eight a board."""
        return tuple(pulse for board in self._boards.values() for pulse in board.pulses)

    def watch_moves(self, on_move: Callable[[int, int, int], None]) -> None:
        """Has every move that the host commands reported, by the thread that reads the line.

        Args:
            on_move: Called with output, count before and count after.
        """
        for offset, board in zip(count(0, OUTPUTS), self._boards.values(), strict=False):
            board.on_move = partial(_report_move, on_move, offset)

    def numbers(self, fault: str) -> Sequence[int]:
        """Numbers of a fault: of a brown-out a board's, or 0 for all; of a move an output's."""
        match fault:
            case "brown_out":
                return (0, *self._boards)
            case "moved":
                return range(1, OUTPUTS * len(self._boards) + 1)
        return super().numbers(fault)

    def power_cycle(self, number: int = 0) -> None:
        """Browns one board or all out: it is deselected, and its servos jump to neutral.

        Raises:
            CommandError: There is no board of this number.
        """
        if number and number not in self._boards:
            raise CommandError(f"the boards here are {', '.join(map(str, self._boards))}")
        with self._changed:
            for board in [self._boards[number]] if number else self._boards.values():
                board.power_up()

    def receive(self, data: bytes) -> bytes:
        """Gives bytes to every board; returns what they answer."""
        reply = b"".join(board.receive(data) for board in self._boards.values())
        return self._damage_reply(reply) if reply and self._faults else reply

    def _happen(self, event: str, value: int) -> None:
        if event == "brown_out":
            self.power_cycle(value)
            return
        board_index, servo = divmod(value - 1, OUTPUTS)
        with self._changed:
            tuple(self._boards.values())[board_index].place(servo + 1, _MOVED_COUNT)

    def _damage_reply(self, reply: bytes) -> bytes:
        if "mute" in self._faults:
            return b""
        self._replies += 1
        return b"~" + reply[1:] if self._strikes("garbage", self._replies) else reply


def _report_move(
    on_move: Callable[[int, int, int], None], first: int, servo: int, before: int, after: int
) -> None:
    """Reports the move of a servo by its output."""
    on_move(first + servo, before, after)
