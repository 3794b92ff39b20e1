"""Emulated Pontech SV203 servo boards behind a pseudo-terminal.

A thread waits for bytes as a board's processor does; nothing happens before a carriage return.
"""

from __future__ import annotations

import fcntl
import glob
import os
import select
import shutil
import tempfile
import termios
import threading
import tty
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import count
from types import MappingProxyType
from typing import ClassVar, Final

from robot.errors import CommandError
from sim_robot.electronics.fault_switch import EVERY_NTH, FaultSwitch
from sim_robot.electronics.sv203_board import OUTPUTS, Board

_CHUNK: Final = 4096
_PREFIX: Final = "emulated-sv203-"
_LINK: Final = "port"
_OTHERS_COUNT: Final = 200


class SV203Emulator(FaultSwitch):
    """Boards on a serial line; ``port`` is the name to open with pyserial.

    The line can be unplugged and plugged in again, as a USB adapter can: the name is a link that
    vanishes and comes back, while the device behind it may be another one. The boards have their
    own supply and do not notice.

    Args:
        boards: The numbers that they answer to.

    Attributes:
        port: Name of the serial port.
        bytes_read: Bytes consumed and acted upon, or swallowed by a cable that was pulled.
    """

    FAULTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "unplugged": "the serial cable is out of the host, and the port is gone",
            "drop": "every n-th byte from the host is lost",
            "corrupt": "every n-th byte from the host arrives with bit 0 flipped",
            "mute": "the board answers no queries",
            "garbage": "every n-th answer has its first digit replaced by '~'",
        }
    )
    NUMBERS: ClassVar[Mapping[str, range]] = MappingProxyType(
        dict.fromkeys(("drop", "corrupt", "garbage"), EVERY_NTH)
    )
    EVENTS: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "brown_out": "the supply of board n dips, of all without a number: servos jump to "
            "neutral, the board is deselected",
            "moved": f"another program on the line sends output n to count {_OTHERS_COUNT}",
        }
    )

    def __init__(self, *, boards: Sequence[int] = (1,)):
        super().__init__()
        _sweep()
        self._folder = tempfile.mkdtemp(prefix=_PREFIX)
        self._lock: int | None = os.open(self._folder, os.O_RDONLY)
        fcntl.flock(self._lock, fcntl.LOCK_EX)  # as long as we live: see _sweep
        self.port = os.path.join(self._folder, _LINK)
        self.bytes_read = 0
        self._boards = {number: Board(number) for number in boards}
        self._changed = threading.Condition()
        self._link: _Link | None = None
        self._bytes_seen = 0
        self._replies = 0
        self.replug()

    def pulses(self) -> tuple[int, ...]:
        """Count 1 to 255 at each output, or 0 where there are no pulses; eight a board."""
        return tuple(pulse for board in self._boards.values() for pulse in board.pulses)

    def watch_moves(self, on_move: Callable[[int, int, int], None]) -> None:
        """Has every move that the host commands reported, by the thread that reads the line.

        Args:
            on_move: Called with output, count before and count after.
        """
        for first, board in zip(count(0, OUTPUTS), self._boards.values(), strict=False):
            board.on_move = partial(_shifted, on_move, first)

    def wait_until_read(self, count: int, timeout: float) -> bool:
        """Waits until ``bytes_read`` has reached ``count``.

        Args:
            count: Bytes written by the driver.
            timeout: Longest wait, s of real time.

        Returns:
            Whether they were all consumed; at once ``True`` while unplugged, for then there is
            nothing to wait for.
        """
        if self.bytes_read >= count:
            return True
        with self._changed:
            return self._changed.wait_for(
                lambda: self.bytes_read >= count or self._link is None, timeout
            )

    def inject(self, fault: str, value: int = 0) -> None:
        """Switches a fault on, or makes an event happen; may be called from any thread."""
        super().inject(fault, value)
        if fault == "unplugged":
            self.unplug()

    def mend(self, fault: str | None = None) -> None:
        """Switches a fault off, or all of them; the cable comes back."""
        super().mend(fault)
        if fault in (None, "unplugged"):
            self.replug()

    def numbers(self, fault: str) -> Sequence[int]:
        """Of a brown-out the boards', or 0 for all of them; of a move the outputs'."""
        match fault:
            case "brown_out":
                return (0, *self._boards)
            case "moved":
                return range(1, OUTPUTS * len(self._boards) + 1)
        return super().numbers(fault)

    def power_cycle(self, number: int = 0) -> None:
        """A brown-out of one board or of all: it is deselected, and its servos jump to neutral.

        Raises:
            CommandError: There is no board of this number.
        """
        if number and number not in self._boards:
            raise CommandError(f"the boards here are {', '.join(map(str, self._boards))}")
        with self._changed:
            for board in [self._boards[number]] if number else self._boards.values():
                board.power_up()

    def unplug(self) -> None:
        """Pulls the serial cable out of the host."""
        with self._changed:
            link, self._link = self._link, None
            self._changed.notify_all()
        if link is not None:
            self.bytes_read += link.close()
            os.unlink(self.port)

    def replug(self) -> None:
        """Plugs the cable in again."""
        if self._link is None:
            self._link = _Link(self._consume)
            os.symlink(self._link.name, self.port)

    def close(self) -> None:
        """Ends the thread and removes the port."""
        self.unplug()
        if self._lock is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            os.close(self._lock)
            self._lock = None

    def _happen(self, event: str, value: int) -> None:
        if event == "brown_out":
            self.power_cycle(value)
            return
        row, servo = divmod(value - 1, OUTPUTS)
        with self._changed:
            tuple(self._boards.values())[row].place(servo + 1, _OTHERS_COUNT)

    def _consume(self, data: bytes) -> bytes:
        """Acts on bytes from the host and returns the answer."""
        received = len(data)
        if self._faults:
            data = self._damage(data)
        with self._changed:
            reply = b"".join(board.receive(data) for board in self._boards.values())
            self.bytes_read += received
            self._changed.notify_all()
        if reply and self._faults:
            reply = self._damage_reply(reply)
        return reply

    def _damage(self, data: bytes) -> bytes:
        drop, corrupt = self._faults.get("drop"), self._faults.get("corrupt")
        kept = bytearray()
        for byte in data:
            self._bytes_seen += 1
            if drop is not None and self._bytes_seen % max(drop, 1) == 0:
                continue
            flip = corrupt is not None and self._bytes_seen % max(corrupt, 1) == 0
            kept.append(byte ^ flip)
        return bytes(kept)

    def _damage_reply(self, reply: bytes) -> bytes:
        if "mute" in self._faults:
            return b""
        every = self._faults.get("garbage")
        if every is None:
            return reply
        self._replies += 1
        return reply if self._replies % max(every, 1) else b"~" + reply[1:]


def _shifted(
    on_move: Callable[[int, int, int], None], first: int, servo: int, before: int, after: int
) -> None:
    """Reports the move of a servo by its output."""
    on_move(first + servo, before, after)


def _sweep() -> None:
    """Removes the ports of emulators that were killed: nobody locks their folders any more."""
    for folder in glob.glob(os.path.join(tempfile.gettempdir(), f"{_PREFIX}*")):
        with suppress(OSError):  # somebody else's, or alive
            lock = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.islink(os.path.join(folder, _LINK)):  # else it is just being made
                    shutil.rmtree(folder)
            finally:
                os.close(lock)


class _Link:
    """One pty and the thread that reads it; asleep in ``poll`` while the line is silent."""

    def __init__(self, consume: Callable[[bytes], bytes]):
        self._consume = consume
        # The slave stays open here: after its last close the master would only read errors.
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._run, name="sv203-emulator", daemon=True)
        self._thread.start()

    def close(self) -> int:
        """Ends the thread; returns how many bytes were still on their way."""
        os.write(self._wake_write, b"x")
        self._thread.join()
        swallowed = 0
        with suppress(BlockingIOError):
            while data := os.read(self._master, _CHUNK):
                swallowed += len(data)
        for fd in (self._master, self._slave, self._wake_read, self._wake_write):
            os.close(fd)
        return swallowed

    def _run(self) -> None:
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        poll.register(self._wake_read, select.POLLIN)
        while True:
            ready = poll.poll()
            if any(fd == self._wake_read for fd, _ in ready):
                return
            # Held open here, the line would stay exclusive after a daemon that was killed.
            fcntl.ioctl(self._slave, termios.TIOCNXCL)
            with suppress(BlockingIOError):
                reply = self._consume(os.read(self._master, _CHUNK))
                if reply:
                    os.write(self._master, reply)  # a full line loses bytes, as a real one does
