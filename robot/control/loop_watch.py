"""Notices that the control loop no longer turns: a driver does not return.

Nothing can end a call that hangs; but somebody else can say so. The watch has a thread of its own,
which sleeps while the loop waits for work.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

PATIENCE: Final = 2.0
"""Seconds without a sign of life after which the loop is given up until it turns again.

A motion that was held up for as long has failed anyway: ``robot.host.clock``."""

LATE: Final = 0.25
"""Seconds without one after which a person who asks is told."""

_LOOK: Final = 0.25  # s; time in which the whole process stood still counts as one look


class LoopWatch:
    """Watches a loop.

    Args:
        seen: When the loop last gave a sign of life, monotonic, s.
        on_hang: Called, from the watch's thread, once it has given none for ``PATIENCE``.
        on_return: Called, likewise, when it then gives one after all.

    Attributes:
        hangs: Whether it has given none for so long.
    """

    def __init__(
        self,
        seen: Callable[[], float],
        *,
        on_hang: Callable[[], None],
        on_return: Callable[[], None],
    ):
        self.hangs = False
        self._seen = seen
        self._on_hang = on_hang
        self._on_return = on_return
        self._rests = True
        self._began = 0.0  # when it last had work to do
        self._ended = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)

    @property
    def silence(self) -> float:
        """Seconds since the last sign of life of a loop that has work to do; 0: it has none."""
        return 0.0 if self._rests else time.monotonic() - self._sign()

    def start(self) -> None:
        """Begins to watch."""
        self._thread.start()

    def rest(self) -> None:
        """The loop waits for work from now on, which may last."""
        self._rests = True

    def work(self) -> None:
        """The loop has work to do from now on."""
        with self._changed:
            self._began = time.monotonic()
            self._rests = False
            self._changed.notify()

    def end(self) -> None:
        """Watches no longer."""
        with self._changed:
            self._ended = True
            self._changed.notify()

    def _sign(self) -> float:
        return max(self._seen(), self._began)

    def _run(self) -> None:
        seen, silent = 0.0, 0.0
        while True:
            with self._changed:
                if not self._ended:
                    self._changed.wait(None if self._rests else _LOOK)
                if self._ended:
                    return
                before, seen = seen, self._sign()
                silent = silent + _LOOK if seen == before and not self._rests else 0.0
            if silent >= PATIENCE and not self.hangs:
                self.hangs = True
                self._on_hang()
            elif not silent and self.hangs:
                self.hangs = False
                self._on_return()
