"""Log lines on standard error, for a terminal or for systemd's journal.

The journal adds time and program itself and files a line by the priority that stands in front of
it. A log must never cost the robot anything: a line that standard error does not take at once,
because the disk is full or the reader asleep, is dropped, and the next one that gets through says
how many were.
"""

from __future__ import annotations

import faulthandler
import logging
import os
import select
import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from protocol.text import brief, printable

_ERROR, _WARNING, _INFORMATION, _DEBUG = "<3>", "<4>", "<6>", "<7>"  # as in sd-daemon(3)
_STDERR: Final = 2
_LONGEST: Final = 4096  # what a pipe that is ready to be written to takes without blocking
_KEPT_LINES: Final = 40  # of a traceback, at its beginning and at its end
_TERMINAL_FORMAT: Final = "%(asctime)s %(name)s %(levelname)s: %(message)s"
_JOURNAL_FORMAT: Final = "%(message)s"


def set_up_logging() -> None:
    """Sends what is logged from now on to standard error, if there is one.

    A crash, or the SIGABRT of a watchdog, then writes there where each thread was.
    """
    if sys.__stderr__ is None:
        return
    faulthandler.enable(file=_STDERR)
    logging.basicConfig(handlers=[LineHandler()], level=logging.INFO, force=True)


def complain(program: str, error: Exception) -> None:
    """Says on standard error why a program ends."""
    start = _ERROR if reads_journal(_STDERR) else f"{program}: "
    with suppress(OSError):
        print(f"{start}{printable(brief(str(error), _LONGEST))}", file=sys.stderr, flush=True)


def reads_journal(fd: int, environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a file descriptor leads to systemd's journal, by ``$JOURNAL_STREAM``."""
    try:
        status = os.fstat(fd)
    except OSError:
        return False
    return environment.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


class PlainFormatter(logging.Formatter):
    """Shows control characters as escapes: a client's name cannot forge a line or a priority.

    Nothing is longer than a person reads, whatever a driver raises.
    """

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """The line without a traceback."""
        record.message = printable(brief(record.message, _LONGEST))
        return super().formatMessage(record)

    def formatException(self, ei: Any) -> str:  # noqa: N802 - logging's name
        """The traceback, without its middle where it is long."""
        lines = [brief(line, _LONGEST) for line in super().formatException(ei).splitlines()]
        left_out = len(lines) - 2 * _KEPT_LINES
        if left_out > 0:
            lines[_KEPT_LINES:-_KEPT_LINES] = [f"({left_out:,} lines are left out)"]
        return "\n".join(lines)


class LineHandler(logging.Handler):
    """Writes whole lines to a file descriptor, and never waits for it.

    Args:
        fd: The file descriptor; the handler does not close it.
    """

    def __init__(self, fd: int = _STDERR):
        super().__init__()
        self._fd = fd
        self._journal = reads_journal(fd)
        self._poll = select.poll()
        self._poll.register(fd, select.POLLOUT)
        self._lost = 0
        self.setFormatter(PlainFormatter(_JOURNAL_FORMAT if self._journal else _TERMINAL_FORMAT))

    def emit(self, record: logging.LogRecord) -> None:
        """Writes one record, line by line."""
        urgency = _urgency(record.levelno) if self._journal else ""
        try:
            lines = [printable(line) for line in self.format(record).splitlines()]
        except Exception:  # a bad format string must not end the control loop
            self.handleError(record)
            return
        if self._lost and self._write(f"{urgency}({self._lost} log lines were lost)"):
            self._lost = 0
        self._lost += sum(not self._write(urgency + line) for line in lines)

    def _write(self, line: str) -> bool:
        data = line.encode(errors="backslashreplace")[: _LONGEST - 1] + b"\n"
        try:
            return any(state & select.POLLOUT for _, state in self._poll.poll(0)) and (
                os.write(self._fd, data) == len(data)
            )
        except OSError:
            return False


def _urgency(level: int) -> str:
    if level >= logging.ERROR:
        return _ERROR
    if level >= logging.WARNING:
        return _WARNING
    return _INFORMATION if level >= logging.INFO else _DEBUG
