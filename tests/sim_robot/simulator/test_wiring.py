"""The configuration of the emulated electronics, and electronics that are not as it says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from robot.configuration.joint_calibration import DrivenJoint
from sim_robot.simulator.electronics_sets import VOLTS_PER_NEWTON, pc104
from sim_robot.simulator.wiring import miscalibrated
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

BODY = load_body(default_body_path())


@pytest.mark.parametrize("mass", [BODY.mass, 5.0, 20.0, 100.0])
def test_a_foot_that_carries_the_whole_body_is_within_its_range(mass: float) -> None:
    config = pc104(replace(BODY, mass=mass), NoiseLevels())
    assert config.daq is not None
    for gauge in config.gauges.values():
        carried = gauge.tare + 2 * mass * 9.81 * gauge.volts_per_newton
        assert carried < config.daq.rails[1]


def test_the_default_body_has_the_documented_gauges() -> None:
    config = pc104(BODY, NoiseLevels())
    assert {gauge.volts_per_newton for gauge in config.gauges.values()} == {VOLTS_PER_NEWTON}


BELIEVED = pc104(load_body(default_body_path()), NoiseLevels())


def slope(joint: DrivenJoint) -> float:
    return math.degrees(joint.scale.angle(101) - joint.scale.angle(100))


def test_a_seed_is_one_robot() -> None:
    assert miscalibrated(BELIEVED, 4) == miscalibrated(BELIEVED, 4)
    assert miscalibrated(BELIEVED, 4) != miscalibrated(BELIEVED, 5)


def test_signs_offsets_and_gains_are_wrong_somewhere() -> None:
    turned = shifted = stretched = upside_down = pulled = deeper = 0
    for seed in range(20):
        truth = miscalibrated(BELIEVED, seed)
        for ours, true in zip(BELIEVED.joints, truth.joints, strict=True):
            turned += slope(ours) * slope(true) < 0
            shifted += abs(ours.scale.count(0.0) - true.scale.count(0.0)) > 5
            stretched += abs(abs(slope(true) / slope(ours)) - 1) > 0.05
        assert truth.axes is not None
        upside_down += sum(gain < 0 for gain in truth.axes.per_g)
        pulled += sum(gauge.volts_per_newton < 0 for gauge in truth.gauges.values())
        assert BELIEVED.distance is not None
        assert truth.distance is not None
        deeper += truth.distance.zero > BELIEVED.distance.zero + 0.002
    assert 60 < turned < 100  # of 160, half of them
    assert shifted > 60
    assert stretched > 40
    assert 15 < upside_down < 45  # of 60
    assert 25 < pulled < 55  # of 80
    assert 2 < deeper < 18  # of 20


@pytest.mark.parametrize("seed", range(20))
def test_every_joint_can_still_lie_flat_and_volts_stay_within_the_range(seed: int) -> None:
    truth = miscalibrated(BELIEVED, seed)
    for joint in truth.joints:
        joint.check_zero()
    assert truth.axes is not None
    axes = zip(truth.axes.zero, truth.axes.per_g, strict=True)
    assert all(abs(zero) + abs(gain) < 5 for zero, gain in axes)
