"""Figures of one robot of ``bench.after``: poses, damages, and what counts as right."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from pydantic import BaseModel, ConfigDict, computed_field

from estimator.use.diagnosis import Verdict

DAMAGES: Final[dict[str, str]] = {
    "body.length=2:70": "leg of .* shortened",
    "body.length=1:50": "leg of .* shortened",
    "body.cut=3:70": "leg of .* (shortened|broken off)",
    "body.cut=2:50": "leg of .* (shortened|broken off)",
    "body.length=3:130": "leg of .* lengthened",
    "servos.jammed=3": "servo of .* jammed",
    "servos.dead=1": "servo of .* dead",
    "servos.swapped=1": "^plugs of (?!touch).* exchanged",
    "servos.slipped=1:8": "zero of",
    "servos.travel=2:60": "travel of",
    "sensors.deaf=2": "touch sensor 2 dead",
    "sensors.tilt_left=3": "own tilt, left/right",
    "sensors.too_high=10": "distance sensor's offset",
    "body.twisted=2:40": "hinge of",
    "body.aside=3:30": "direction of",
}
"""Faults, each with a pattern of the names of its change."""

TOGETHER: Final = (
    "body.length=2:70,servos.slipped=1:8",
    "servos.jammed=3,sensors.deaf=2",
    "body.bent=2:25",
    "servos.travel=2:60,sensors.tilt_left=4",
)
"""Two faults at once, and one that the table lacks, of which no change may be named."""


class Damaged(BaseModel):
    """What became of one damage.

    Attributes:
        fault: Fault as it was injected; empty: none.
        noticed: Number of movements after which it was noticed; ``None``: not within the most.
        suspected: Whether the right change is among the suspects of the watch.
        verdict: Verdict of the diagnosis.
        named: Names of the diagnosis's changes.
        probability: Probability of these changes together.
        share: 90 % interval of the leg's new length as a share of the old one, (0, 0) where the
            right change is not named; ``None``: the damage is no other length.
        as_if: Whether the first of these changes, right or wrong, predicts other movements.
        movements: Number of movements of the diagnosis.
        cpu_seconds: CPU time of the diagnosis, s.
    """

    model_config = ConfigDict(frozen=True)

    fault: str
    noticed: int | None
    suspected: bool
    verdict: str
    named: tuple[str, ...]
    probability: float
    share: tuple[float, float] | None
    as_if: bool
    movements: int
    cpu_seconds: float

    @computed_field  # type: ignore[prop-decorator]  # mypy knows no decorated properties
    @property
    def right(self) -> bool:
        """Whether the verdict is right: the change of a known fault is one of at most two named."""
        if not self.fault:
            return self.verdict == Verdict.UNCHANGED.value
        if self.fault in TOGETHER:
            return self.verdict != Verdict.CHANGED.value
        named = any(map(right_of(self.fault), self.named))
        return named and self.verdict == Verdict.CHANGED.value and len(self.named) <= 2

    @computed_field  # type: ignore[prop-decorator]
    @property
    def wrong(self) -> bool:
        """Whether another change is named."""
        return self.verdict == Verdict.CHANGED.value and not self.right

    @property
    def holds(self) -> bool:
        """Whether the interval ``share`` holds the leg's true share."""
        assert self.share is not None
        low, high = self.share
        return low <= float(self.fault.partition(":")[2]) / 100 <= high


def right_of(fault: str) -> Callable[[str], bool]:
    """Returns a test of whether a name is that of a fault's change, on whatever leg."""
    pattern = re.compile(DAMAGES.get(fault, "(?!)"))
    return lambda name: pattern.search(name) is not None


class Reached(BaseModel):
    """What became of one goal: ``share`` and ``margin``, rad, are those of its ``Pose``.

    The robot has reached it, or it fell elsewhere than predicted, or neither.
    """

    model_config = ConfigDict(frozen=True)

    share: float
    margin: float
    reached: bool
    elsewhere: bool


class Figures(BaseModel):
    """Figures of one robot.

    Attributes:
        poses: What became of goals, which are readings of this robot at random programs.
        quiet: Number of movements of a watch while nothing happened.
        alarms: Number of alarms in these movements.
        damaged: What became of no damage and of each damage, one after the other.
    """

    model_config = ConfigDict(frozen=True)

    poses: tuple[Reached, ...]
    quiet: int
    alarms: int
    damaged: tuple[Damaged, ...]
