"""A robot without any hardware, for trying out a network, a client or an installation.

Commanded angles come back, quantised and in the time that they would take. There is nothing to
feel, and nothing is made up: the robot's name ends in "(dry run)", ``hello`` lists no sensors,
observations carry no touch, tilt or clearance, and no motion is ever said to have come to rest.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final

from protocol.wire.field_checks import MAX_NAME
from robot.configuration.robot_config import RobotConfig
from robot.control.controller import Controller
from robot.host.clock import Clock, SteadyClock
from robot.host.service_manager import ServiceManager
from robot.sensing.sensors import OnProgress, Reading, ignore
from robot.service.daemon import HOUSEKEEPING, assemble, describe

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


class NoSensors:
    """Sensors of a robot without hardware: their readings are empty."""

    def __init__(self, clock: Clock):
        self._clock = clock

    def tilt(self) -> tuple[float, float] | None:
        """Returns ``None``: nothing is measured."""
        return None

    def average(self, samples: int, report: OnProgress = ignore) -> Reading:
        """Returns an empty reading."""
        del samples
        report(1.0)
        return Reading(robot_time=self._clock.now())


def dry_config(config: RobotConfig) -> RobotConfig:
    """The configuration under a name that says that it is a dry run, without waiting for rest."""
    return replace(
        config,
        name=config.name[: MAX_NAME - len(SUFFIX)] + SUFFIX,
        settling=replace(config.settling, timeout=_NO_WAIT),
    )


def dry_controller(
    config: RobotConfig, *, clock: Clock, log: logging.Logger, manager: ServiceManager
) -> Controller:
    """The control loop of a robot that is not there, not yet started; it begins at zero.

    Args:
        config: Configuration from ``dry_config``.
        clock: The robot clock.
        log: Log for what a person may want to know.
        manager: Service manager, which is told that the control loop turns.
    """
    return assemble(
        config,
        servos=NullServos({joint.output: joint.quantise(0.0) for joint in config.joints}),
        sensing=NoSensors(clock),
        capabilities=replace(describe(config), sensors=()),
        clock=SteadyClock(clock),
        operator=None,
        housekeeping=HOUSEKEEPING,
        log=log,
        manager=manager,
    )
