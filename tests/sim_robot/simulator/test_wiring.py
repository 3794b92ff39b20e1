"""The configuration that fits the emulated electronics of any body."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_robot.simulator.electronics_set import VOLTS_PER_NEWTON
from sim_robot.simulator.pc104_set import configure
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

BODY = load_body(default_body_path())


@pytest.mark.parametrize("mass", [BODY.mass, 5.0, 20.0, 100.0])
def test_a_foot_that_carries_the_whole_body_is_within_its_range(mass: float) -> None:
    config = configure(replace(BODY, mass=mass), port="nowhere", levels=NoiseLevels())
    assert config.daq is not None
    for gauge in config.gauges.values():
        carried = gauge.tare + 2 * mass * 9.81 * gauge.volts_per_newton
        assert carried < config.daq.rails[1]


def test_the_default_body_has_the_documented_gauges() -> None:
    config = configure(BODY, port="nowhere", levels=NoiseLevels())
    assert {gauge.volts_per_newton for gauge in config.gauges.values()} == {VOLTS_PER_NEWTON}
