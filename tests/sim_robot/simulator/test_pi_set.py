"""A body with more joints and feet than one chip has outputs and inputs."""

from __future__ import annotations

import logging

import pytest

from sim_robot.simulator.daemon import emulation
from sim_robot.world.body import load_body, shipped_bodies
from sim_robot.world.sensor_noise import NO_NOISE


def test_a_body_has_as_many_boards_as_it_needs() -> None:
    body = load_body(shipped_bodies()["hexapod_18"])
    with emulation(
        body,
        seed=0,
        levels=NO_NOISE,
        real_time=False,
        log=logging.getLogger("test"),
        electronics="pi",
    ) as robot:
        joints, servos = robot.config.joints, robot.devices.servos
        outputs = [joint.output for joint in joints]
        assert outputs == list(range(18))  # the last two on the second board
        assert set(servos.read_counts(outputs).values()) == {0}
        servos.set_counts({joint.output: joint.quantise(0.2) for joint in joints})
        robot.clock.sleep(1.0)
        wanted = [joint.scale.angle(joint.quantise(0.2)) for joint in joints]
        assert robot.world.angles() == pytest.approx(wanted, abs=0.01)
        last = list(body.touch)[-1]
        robot.world.press(last, 2.0)
        loads = [sensor.load() for sensor in robot.devices.touch]
        assert len(loads) == 6  # the last two on the second chip
        assert loads[-1] - loads[-2] > 1.0
