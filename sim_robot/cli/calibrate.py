"""``sim-robotd --calibrate``: a simulated person goes through the guided session, on the screen."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from robot.cli.calibrate import calibrate
from robot.configuration.calibration_file import Calibration, read_calibration
from sim_robot.simulator.daemon import DEFAULT_SET, emulation
from sim_robot.simulator.person import SimulatedPerson
from sim_robot.world.body import Body
from sim_robot.world.engines import DEFAULT_ENGINE
from sim_robot.world.sensor_noise import NoiseLevels


def calibrate_simulated(
    body: Body,
    *,
    seed: int,
    levels: NoiseLevels,
    electronics: str = DEFAULT_SET,
    wrong: int | None,
    file: Path,
    echo: Callable[[str], None],
    log: logging.Logger,
    engine: str = DEFAULT_ENGINE,
) -> None:
    """Runs the session of ``robotd calibrate`` on emulated electronics.

    Args:
        body: The body.
        seed: Seed of the sensor noise and of the person's errors.
        levels: Sensor noise.
        electronics: Which boards.
        wrong: Seed of electronics that differ from their configuration, or ``None`` for true ones.
        file: The calibration file; if it exists, its values are where the session begins.
        echo: Shown everything that is said and answered.
        log: Where to write what a person may want to know.
        engine: What simulates the body.

    Raises:
        AbandonedError: The person was refused; the file has what was measured before.
    """
    known = file if file.exists() else None
    with emulation(
        body,
        seed=seed,
        levels=levels,
        real_time=False,
        log=log,
        electronics=electronics,
        wrong=wrong,
        calibration=known,
        engine=engine,
    ) as parts:
        before = Calibration(robot=parts.config.name)
        if known:
            before = read_calibration(known, parts.config.servos.counts)
        calibrate(
            parts.config,
            before,
            parts.devices,
            clock=parts.clock,
            terminal=SimulatedPerson(
                body,
                parts.world,
                parts.noise,
                parts.clock,
                counts=parts.config.servos.counts,
                seed=seed,
                echo=echo,
            ),
            file=file,
        )
