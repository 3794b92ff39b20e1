"""A program in a pseudo-terminal, as a person sees it."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import termios
import time
from collections.abc import Mapping, Sequence


class TerminalWindow:
    """A pseudo-terminal of 40 by 120 characters with a program in it.

    Args:
        command: The program and its arguments.
        environment: Variables on top of ours.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] | None = None):
        self._near, self._far = pty.openpty()
        self._before = termios.tcgetattr(self._far)
        self.process = subprocess.Popen(
            command,
            stdin=self._far,
            stdout=self._far,
            stderr=self._far,
            start_new_session=True,
            env={**os.environ, "LINES": "40", "COLUMNS": "120", **(environment or {})},
        )
        self._text = ""

    def until(self, pattern: str) -> str:
        """Reads what is shown until it matches; returns it, and forgets it."""
        deadline = time.monotonic() + 120
        while re.search(pattern, self._text) is None:
            left = max(0.0, deadline - time.monotonic())
            assert select.select([self._near], [], [], left)[0], self._text
            self._text += os.read(self._near, 65536).decode(errors="replace")
        text, self._text = self._text, ""
        return text

    def press(self, keys: str) -> None:
        """Types keys."""
        os.write(self._near, keys.encode())

    def ended(self) -> int:
        """Waits for the end; returns the exit code. The terminal must be as it was before."""
        code = self.process.wait(120)
        assert termios.tcgetattr(self._far) == self._before
        return code

    def hang_up(self) -> None:
        """Closes the window, as a lost connection does."""
        os.close(self._near)
        self._near = -1
        self.process.wait(120)

    def close(self) -> None:
        """Ends the program."""
        self.process.kill()
        self.process.wait()
        for fd in {self._near, self._far} - {-1}:
            os.close(fd)
