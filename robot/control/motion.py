"""The way from the present counts to the targets, no joint faster than its servo.

A ``Slew`` is pure arithmetic: it is told the time and says which counts to send. Each update
advances a joint by at most the top speed times the time since that joint's last update; joints do
not finish together. Where one count is more than the speed allows, the joint waits until enough
time has passed. However long the loop stood still, an update advances a joint by no more than when
it is in time: one count, or what it moves in ``period``. So a delay never ends in a leap; the joint
arrives later.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robot.configuration.joint_calibration import DrivenJoint


@dataclass
class _Track:
    joint: DrivenJoint
    count: int
    target: int
    updated: float

    def next_count(self, now: float, speed: float, period: float) -> int:
        """The count nearest to the target that may be sent now."""
        if self.count == self.target:
            return self.count
        scale = self.joint.scale
        angle = scale.angle(self.count)
        max_reach = max(speed * period, scale.resolution * (1 + 1e-9))
        reach = min(speed * (now - self.updated), max_reach)
        if abs(scale.angle(self.target) - angle) <= reach:
            return self.target
        step = 1 if self.target > self.count else -1
        estimate = max(int(reach / scale.resolution) - 1, 0)
        count = self.count + step * estimate
        while abs(scale.angle(count + step) - angle) <= reach:
            count += step
        return count


class Slew:
    """Moves joints from counts to counts.

    Args:
        joints: The driven joints, in motor order.
        start: Present count of each output.
        targets: Target count of each output.
        speed: Top speed of every joint, rad/s.
        period: Longest time between two updates of a joint when nothing is late, s.
        now: Robot time at which the motion begins, s.
    """

    def __init__(
        self,
        joints: Sequence[DrivenJoint],
        *,
        start: Mapping[int, int],
        targets: Mapping[int, int],
        speed: float,
        period: float,
        now: float,
    ):
        self._speed = speed
        self._period = period
        self._tracks = [
            _Track(joint, start[joint.output], targets[joint.output], now) for joint in joints
        ]
        self._distance = max(self._remaining(), 1e-12)

    @property
    def arrived(self) -> bool:
        """Whether every joint was sent its target."""
        return all(track.count == track.target for track in self._tracks)

    @property
    def fraction(self) -> float:
        """Share of the longest way that is done, 0 to 1."""
        return min(1.0, max(0.0, 1.0 - self._remaining() / self._distance))

    def due(self, now: float, *, at_most: int) -> dict[int, int]:
        """Outputs and counts to send now: those that waited longest, ``at_most`` of them."""
        waiting = sorted(self._tracks, key=lambda track: track.updated)
        counts: dict[int, int] = {}
        for track in waiting:
            count = track.next_count(now, self._speed, self._period)
            if count != track.count and len(counts) < at_most:
                counts[track.joint.output] = count
        return counts

    def sent(self, counts: Mapping[int, int], now: float) -> None:
        """Notes that counts went out at ``now``."""
        for track in self._tracks:
            count = counts.get(track.joint.output)
            if count is not None:
                track.count = count
                track.updated = now

    def _remaining(self) -> float:
        return max(
            abs(track.joint.scale.angle(track.target) - track.joint.scale.angle(track.count))
            for track in self._tracks
        )
