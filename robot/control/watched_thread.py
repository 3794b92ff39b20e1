"""A thread that runs a loop, and a watch that notices when the loop no longer turns.

Nothing can end a call of a driver that does not return; but somebody else can say so. The watch has
a thread of its own, which sleeps while the loop waits for work.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

from robot.drivers.guard import under_way

PATIENCE: Final = 2.0
"""Seconds without a sign of life after which the loop is given up until it turns again.

A motion that was held up for as long has failed anyway: ``robot.host.clock.MAX_GAP``."""

LATE: Final = 0.25
"""Seconds without a sign of life after which a person who asks is told."""

_PERIOD: Final = 0.25  # s between looks; time in which the whole process stood still counts as one


class WatchedThread:
    """Runs a loop, and watches it.

    Args:
        name: Name of the thread.
        run: The loop; it calls ``rest`` before it waits for work, and ``work`` afterwards.
        seen: Returns when the loop last gave a sign of life, monotonic, s.
        on_hang: Called, from the watch's thread, once the loop has given none for ``PATIENCE``.
        on_return: Called, from the watch's thread, when the loop then gives one after all.

    Attributes:
        hangs: Whether the loop has given no sign of life for ``PATIENCE``.
        rests: Whether the loop waits for work.
    """

    def __init__(
        self,
        name: str,
        run: Callable[[], None],
        *,
        seen: Callable[[], float],
        on_hang: Callable[[], None],
        on_return: Callable[[], None],
    ):
        self.hangs = False
        self._loop = run
        self._seen = seen
        self._on_hang = on_hang
        self._on_return = on_return
        self.rests = True
        self._began_at = 0.0  # when it last had work to do
        self._ended = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._watch = threading.Thread(target=self._look, name="watch", daemon=True)

    @property
    def is_late(self) -> bool:
        """Whether the loop has waited for a driver for longer than ``LATE``."""
        silence = 0.0 if self.rests else time.monotonic() - self._sign()
        return silence > LATE and bool(under_way(self._thread.ident))

    @property
    def obstacle(self) -> str:
        """What the loop waits for, a sentence."""
        cause = under_way(self._thread.ident) or "something does not return"
        return f"The control loop does not turn: {cause}."

    def start(self) -> None:
        """Starts the loop and the watch."""
        self._watch.start()
        self._thread.start()

    def join(self, timeout: float) -> bool:
        """Waits up to ``timeout`` seconds for the end of the loop, and no longer once it hangs.

        Returns:
            Whether the loop has ended.
        """
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0 and not self.hangs and self._thread.is_alive():
            self._thread.join(min(left, LATE))
        return not self._thread.is_alive()

    def rest(self) -> None:
        """Notes that the loop waits for work from now on, which may last."""
        self.rests = True

    def work(self) -> None:
        """Notes that the loop has work to do from now on."""
        with self._changed:
            self._began_at = time.monotonic()
            self.rests = False
            self._changed.notify()

    def _run(self) -> None:
        try:
            self._loop()
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify()

    def _sign(self) -> float:
        return max(self._seen(), self._began_at)

    def _look(self) -> None:
        sign, silence = 0.0, 0.0
        while True:
            with self._changed:
                if not self._ended:
                    self._changed.wait(None if self.rests else _PERIOD)
                if self._ended:
                    return
                previous, sign = sign, self._sign()
                silence = silence + _PERIOD if sign == previous and not self.rests else 0.0
            if silence >= PATIENCE and not self.hangs:
                self.hangs = True
                self._on_hang()
            elif not silence and self.hangs:
                self.hangs = False
                self._on_return()
