"""A terminal of which single keys are read, and which is restored at the end."""

from __future__ import annotations

import os
import re
import select
import shutil
import signal
import sys
import termios
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType, MappingProxyType
from typing import Final

from robot.errors import CommandError
from robot.trial.session import QUIT

KEYS: Final = MappingProxyType(
    {
        b"\x1b[A": "up",
        b"\x1bOA": "up",
        b"\x1b[B": "down",
        b"\x1bOB": "down",
        b"\x1b[C": "right",
        b"\x1bOC": "right",
        b"\x1b[D": "left",
        b"\x1bOD": "left",
        b"\x1b[5~": "page up",
        b"\x1b[6~": "page down",
        b" ": "space",
        b"q": QUIT,
        b"\x03": QUIT,  # Ctrl-C
        b"\x04": QUIT,  # Ctrl-D
        b"k": "up",
        b"j": "down",
        b"l": "right",
    }
)
"""Key by what a terminal sends for it."""

_BEGUN: Final = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|O)?")
"""An escape sequence that lacks its last byte, or Escape alone: a terminal sends both alike."""

_ONE_KEY: Final = re.compile(_BEGUN.pattern + rb"[^\x1b]|.", re.DOTALL)
_AT_ONCE: Final = (b" ", b"q", b"\x03", b"\x04")  # what ends a motion overtakes all before it
_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_OPEN: Final = "\x1b[?1049h\x1b[?25l"  # another screen, no cursor
_CLOSE: Final = "\x1b[?25h\x1b[?1049l"


class Keyboard:
    """Standard input and output as a ``View``; made by ``keyboard``."""

    def __init__(self, source: int):
        self._source = source
        self._bytes = b""
        self._has_left = False

    def key(self) -> str | None:
        """The next key, without waiting for one."""
        with suppress(OSError):
            while select.select([self._source], [], [], 0)[0]:
                data = os.read(self._source, 1024)
                self._bytes += data
                if not data:  # nobody will press a key any more
                    self.leave()
                    break
        if self._has_left:
            return QUIT
        self._bytes = self._bytes[max(0, *map(self._bytes.rfind, _AT_ONCE)) :]
        match = _ONE_KEY.match(self._bytes)
        if match is None or _BEGUN.fullmatch(self._bytes):
            return None
        sequence = match[0]
        self._bytes = self._bytes[len(sequence) :]
        return KEYS.get(sequence, sequence.decode("latin-1"))

    def show(self, text: Sequence[str], rows: Sequence[str], *, keep: int) -> None:
        """Shows lines, wrapped, and below them rows, cut to the terminal's width."""
        columns, height = shutil.get_terminal_size()
        head = [part for line in text for part in textwrap.wrap(line, columns - 1) or [""]]
        room = max(1, height - len(head))
        first_row = max(0, min(keep - room // 2, len(rows) - room))
        shown = [*head, *(row[: columns - 1] for row in rows[first_row : first_row + room])]
        self._write("\x1b[H" + "\r\n".join(f"{line}\x1b[K" for line in shown) + "\x1b[J")

    def leave(self, *_: int | FrameType | None) -> None:
        """Makes the next key ``QUIT``."""
        self._has_left = True

    def _write(self, text: str) -> None:
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except OSError:  # the terminal is gone
            self.leave()


@contextmanager
def keyboard() -> Iterator[Keyboard]:
    """Takes the terminal over; Ctrl-C is a key, and a signal to end is taken for ``QUIT``.

    Raises:
        CommandError: Standard input or output is no terminal.
    """
    if not (sys.stdin and sys.stdin.isatty() and sys.stdout.isatty()):
        raise CommandError("this takes single keys and shows sensors live: run it in a terminal")
    source = sys.stdin.fileno()
    old_settings = termios.tcgetattr(source)
    view = Keyboard(source)
    raw = termios.tcgetattr(source)
    raw[3] &= ~(termios.ICANON | termios.ECHO | termios.ISIG)
    old_handlers = {number: signal.signal(number, view.leave) for number in _SIGNALS}
    termios.tcsetattr(source, termios.TCSADRAIN, raw)
    try:
        view._write(_OPEN)
        yield view
    finally:
        view._write(_CLOSE)
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(source, termios.TCSADRAIN, old_settings)
        for number, handler in old_handlers.items():
            signal.signal(number, handler)
