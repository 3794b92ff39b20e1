"""A robot without any hardware, for trying out a network, a client or an installation.

Commanded angles come back, quantised and in the time that they would take. There is nothing to
feel, and nothing is made up: the robot's name ends in "(dry run)", ``hello`` lists no sensors,
observations carry no touch, tilt or clearance, and no motion is ever said to have come to rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final

from protocol.wire.field_checks import MAX_NAME
from robot.configuration.robot_config import RobotConfig
from robot.devices import Devices

SUFFIX: Final = " (dry run)"
_SECONDS_PER_SERVO: Final = 0.01  # s; that of an SV-203B at 9600 baud
_NO_WAIT: Final = 1e-3  # s; there is nothing that could settle


class NullServos:
    """A servo driver without a device; it remembers what it was sent."""

    name = "dry run"
    repeats = 0

    def __init__(self, counts: Mapping[int, int]):
        self._counts = dict(counts)

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Remembers counts."""
        self._counts.update(counts)

    def read_counts(self, outputs: Iterable[int]) -> dict[int, int]:
        """Returns the remembered counts."""
        return {output: self._counts[output] for output in outputs}

    def release(self, outputs: Iterable[int]) -> None:
        """Remembers that the outputs are limp."""
        self._counts.update(dict.fromkeys(outputs, 0))

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """The outputs whose remembered count is another one."""
        return [output for output, count in expected.items() if self._counts[output] != count]

    def forget(self) -> None:
        """Does nothing: everything is sent every time."""

    def seconds_for(self, changed: int) -> float:
        """Time that so many counts take over the usual serial line, s."""
        return changed * _SECONDS_PER_SERVO

    def reopen(self) -> None:
        """Does nothing: there is no link."""

    def close(self) -> None:
        """Does nothing: there is no link."""


def dry_config(config: RobotConfig) -> RobotConfig:
    """The configuration without sensors, under a name that says so, without waiting for rest."""
    return replace(
        config,
        name=config.name[: MAX_NAME - len(SUFFIX)] + SUFFIX,
        daq=None,
        accelerometer=None,
        touch=(),
        distance=None,
        settling=replace(config.settling, timeout=_NO_WAIT),
        samples=1,
    )


def dry_devices(config: RobotConfig) -> Devices:
    """Servos that are not there, at zero, and no sensors; ``config`` is one of ``dry_config``."""
    zero = {joint.output: joint.quantise(0.0) for joint in config.joints}
    return Devices(
        servos=NullServos(zero), inputs=None, accelerometer=None, touch=(), distance=None
    )
