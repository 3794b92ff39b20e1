"""What all simulated bodies have in common: when one rests, and what its sensors then read."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from estimator.body.geometry import up_as_measured
from estimator.body.morphology import Morphology
from estimator.physics.base import WorldSettings
from estimator.readings.observation import PredictedReadings
from protocol.wire.readings import (
    Direction,
    belly_ray,
    clearance_of,
    tilt_of,
    touch_is_doubtful,
    touches,
)


class MainBody(NamedTuple):
    """How the main body moves and lies.

    Attributes:
        velocity: Velocity, m/s.
        spin: Angular velocity, rad/s.
        height: Height of its middle, or of its centre of mass, m.
        up: World up in the main body's frame.
    """

    velocity: Iterable[float]
    spin: Iterable[float]
    height: float
    up: Sequence[float]


class RestWatch:
    """Notices when a simulated body rests.

    By default a body rests that hardly moved at several looks, some steps apart. With fine steps
    contacts creep and rattle at millimetres a second for ever, which no sensor notices: then a body
    rests when height and tilt have stayed the same for ``WorldSettings.rest_window``.

    Args:
        settings: Settings of the world; with ``full_steps`` no body ever rests.
    """

    # Chosen together: 1,000 bodies of each kind read as after all steps, to 0.05° and 0.2 mm.
    STEPS_PER_LOOK: Final = 4
    _LOOKS: Final = 4
    _REST_SPEED: Final = 2e-4  # m/s
    _REST_SPIN: Final = 2e-3  # rad/s
    _SAME_HEIGHT: Final = 5e-5  # m
    _SAME_TILT: Final = math.radians(0.05)

    def __init__(self, settings: WorldSettings):
        self._full_steps = settings.full_steps
        self._calm_looks = 0
        self._window = round(settings.rest_window / (settings.step * self.STEPS_PER_LOOK))
        self._poses: deque[tuple[float, ...]] = deque(maxlen=self._window + 1)

    @property
    def rests(self) -> bool:
        """Whether the body rests."""
        return not self._full_steps and self._calm_looks >= (1 if self._window else self._LOOKS)

    def look(self, body: MainBody) -> None:
        """Looks at the main body; to be called every ``STEPS_PER_LOOK`` steps."""
        is_still = self._stays(body) if self._window else self._hardly_moves(body)
        self._calm_looks = self._calm_looks + 1 if is_still else 0

    def _hardly_moves(self, body: MainBody) -> bool:
        is_slow = math.hypot(*body.velocity) < self._REST_SPEED
        return is_slow and math.hypot(*body.spin) < self._REST_SPIN

    def _stays(self, body: MainBody) -> bool:
        self._poses.append((body.height, *body.up))
        if len(self._poses) <= self._window:
            return False
        height, *ups = zip(*self._poses, strict=True)
        if max(height) - min(height) > self._SAME_HEIGHT:
            return False
        return all(max(axis) - min(axis) < self._SAME_TILT for axis in ups)


def fill_row(
    readings: PredictedReadings,
    row: int,
    body: Morphology,
    settings: WorldSettings,
    *,
    height: float,
    up: Direction,
    gaps: Sequence[float],
) -> None:
    """Fills in what one body's sensors read in a pose that was simulated.

    Args:
        readings: Receives touch, tilt and clearance.
        row: Row of the body.
        body: The body.
        settings: Settings of its world.
        height: Height of the main body's middle above the ground, m.
        up: The world's up in the body's frame.
        gaps: Distance of each part from the ground, m; negative where it sinks in.
    """
    readings.tilt[row] = tilt_of(up_as_measured(up, *body.base.accelerometer))
    ray = belly_ray(height - up[2] * body.base.size[2] / 2, up)
    readings.clearance[row], readings.saturated[row] = clearance_of(ray, settings.clearance_cap)
    for sensor in range(body.sensors):
        gap = min((gaps[part] for part in body.sensor_parts(sensor)), default=math.inf)
        readings.touch[row, sensor] = touches(gap, settings.touch_gap)
        readings.touch_doubtful[row, sensor] = touch_is_doubtful(gap, settings.doubtful_gap)
