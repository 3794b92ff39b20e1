"""The analogue inputs of one board, shared by the sensors that are connected to them.

One scan converts every connected channel, so that an accelerometer and gauges that are read one
after the other see the same moment. A board that is silent is noticed by its driver; one that keeps
talking only by what it says: an input with a broken wire sits at an end of its range, and a live
16-bit input, which dithers, does not give the same code again and again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, Protocol

from robot.errors import DeviceDataError
from robot.host.clock import Clock

STUCK_AFTER: Final = 20
"""Number of scans with exactly the same code that make an input stuck; settling alone takes more.

The noise of an accelerometer is some 5 codes at ±5 V, of an amplified gauge more, of a converter
alone 1.
"""

_CODES: Final = 65536
_SAME_MOMENT: Final = 0.5e-3  # s; half the shortest period at which sensors are read


class AnalogueBoard(Protocol):
    """A data acquisition board; like a ``SensorDriver`` it may have a ``link``."""

    def probe(self) -> None:
        """Opens the link, anew after a fault; makes sure that the board is as it should be.

        Raises:
            DeviceError: The board is missing or is not as it should be, or the link cannot be
                opened.
        """

    def scan(self, low: int, high: int) -> list[float]:
        """Volts of the channels ``low`` to ``high``.

        Raises:
            DeviceError: The board failed.
        """

    def close(self) -> None:
        """Closes the link, if it is open; ``probe`` may follow."""


class AnalogueInputs:
    """The connected channels of a board; a scan raises ``DeviceError`` where the board failed.

    Args:
        board: The board's driver.
        name: Name of the board, for messages.
        rails: The volts at the ends of the input range.
        dithers: Whether a live input hardly ever gives the same code twice running, so that one
            that does is stuck.
        clock: Tells which readings belong to one moment.
    """

    def __init__(
        self,
        board: AnalogueBoard,
        *,
        name: str,
        rails: tuple[float, float],
        clock: Clock,
        dithers: bool = True,
    ):
        self.board = board
        self._name = name
        code = (rails[1] - rails[0]) / _CODES
        self._low, self._high = rails[0] + code / 2, rails[1] - 1.5 * code
        self._dithers = dithers
        self._clock = clock
        self._names: dict[int, str] = {}
        self._volts: dict[int, float] = {}
        self._repeats: dict[int, int] = {}
        self._scanned = -math.inf

    @property
    def channels(self) -> tuple[int, int]:
        """The first and the last channel of a scan."""
        return min(self._names), max(self._names)

    def connect(self, names: Mapping[int, str]) -> None:
        """Adds a sensor; ``names`` says what is connected, by channel."""
        self._names |= names
        self._volts |= dict.fromkeys(names, math.nan)
        self._repeats |= dict.fromkeys(names, 0)

    def scan(self) -> Mapping[int, float]:
        """Converts all connected channels; returns volts by channel."""
        low, high = self.channels
        volts = self.board.scan(low, high)
        for channel, previous in self._volts.items():
            unchanged = volts[channel - low] == previous
            self._repeats[channel] = self._repeats[channel] + 1 if unchanged else 1
            self._volts[channel] = volts[channel - low]
        self._scanned = self._clock.now()
        return self._volts

    def same_moment(self) -> Mapping[int, float]:
        """Volts by channel, of the scan that another sensor has just made, or of a new one."""
        is_recent = 0 <= self._clock.now() - self._scanned <= _SAME_MOMENT
        return self._volts if is_recent else self.scan()

    def check(self, channels: Iterable[int]) -> None:
        """Checks that the last scan of the resting robot can be believed.

        Raises:
            DeviceDataError: A channel is at an end of its range, or stuck.
        """
        for channel in channels:
            name, volts = self._names[channel], self._volts[channel]
            if not self._low < volts < self._high:
                raise DeviceDataError(
                    f"{self._name} input {channel}, {name}, is at the end of its range "
                    f"({volts:.3f} V).",
                    "Look for a broken wire, a short circuit, an amplifier without supply or too "
                    "heavy a load.",
                )
            if self._dithers and self._repeats[channel] >= STUCK_AFTER:
                raise DeviceDataError(
                    f"{self._name} input {channel}, {name}, is stuck: it gave exactly {volts:.5f} "
                    f"V {self._repeats[channel]} times running.",
                    "Look for a short circuit, and at the analogue inputs of the board.",
                )
