"""Electronics that are wrong by a seed are calibrated through the emulators, to 1° and 1 mm.

Servos are off by up to 15 counts and turn the wrong way, axes point down, gauges are glued on the
wrong side, the distance sensor sits elsewhere. The person has a protractor of 0.2°; the sensors
have their usual noise.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from robot.configuration.calibration_file import read_calibration
from robot.configuration.robot_config import RobotConfig, apply_calibration
from robot.drivers.servos.sv203 import COUNTS
from robot.sensing.sensors import tilt_at_rest
from sim_robot.command_line import _parser
from sim_robot.simulator.daemon import emulation, robot_on
from sim_robot.simulator.electronics_sets import SETS
from sim_robot.simulator.person import SimulatedPerson
from sim_robot.simulator.wiring import miscalibrated
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NO_NOISE, NoiseLevels

LOG = logging.getLogger("test")
SEEDS = range(1000, 1010)
AT_EACH_CHANGE = {"pc104": (1000,)}  # tests/processes calibrates a pi
BODY = load_body(default_body_path())
BELIEVED = {name: one.configure(BODY, NoiseLevels()) for name, one in SETS.items()}


@dataclass(frozen=True)
class Errors:
    """The worst errors of a configuration, against the electronics as they are."""

    joint: float  # degrees
    tilt: float  # degrees
    clearance: float  # mm
    force: float  # N


def errors(config: RobotConfig, truth: RobotConfig) -> Errors:
    assert config.distance is not None
    assert truth.distance is not None
    pairs = zip(config.joints, truth.joints, strict=True)
    joint = max(
        abs(ours.scale.angle(count) - true.scale.angle(count))
        for ours, true in pairs
        for count in true.counts
        if true.lower_limit <= true.scale.angle(count) <= true.upper_limit
    )
    sensor, real = config.distance, truth.distance
    heights = [millimetres / 1000 for millimetres in range(151)]
    clearance = max(
        abs(sensor.clearance(real.zero + height / real.scale) - height) for height in heights
    )
    gauges = zip(config.gauges.values(), truth.gauges.values(), strict=True)
    force = max(
        abs(ours.force(true.tare + true.volts_per_newton * load) - load)
        for ours, true in gauges
        for load in (0.0, 0.1, 1.0, 5.0)
    )
    tilt = max(_tilt_error(config, truth, *angles) for angles in _leans())
    return Errors(math.degrees(joint), math.degrees(tilt), clearance * 1000, force)


def _leans() -> Iterator[tuple[float, float]]:
    for across in range(-60, 61, 10):
        for along in range(-60, 61, 10):
            if math.hypot(math.sin(math.radians(across)), math.sin(math.radians(along))) < 0.95:
                yield math.radians(across), math.radians(along)


def _tilt_error(config: RobotConfig, truth: RobotConfig, across: float, along: float) -> float:
    x, y = math.sin(along), math.sin(across)
    assert config.axes is not None
    assert truth.axes is not None
    up = (x, y, math.sqrt(1 - x * x - y * y))
    axes = zip(truth.axes.zero, truth.axes.per_g, up, strict=True)
    raw = [zero + gain * value for zero, gain, value in axes]
    tilt = tilt_at_rest(config.axes.acceleration(raw))
    return max(abs(a - b) for a, b in zip(tilt, (across, along), strict=True))


def calibrate(seed: int, electronics: str, file: Path, only: Collection[str] = ()) -> list[str]:
    """A session with the robot that is wrong by a seed; what was shown."""
    shown: list[str] = []
    with emulation(
        BODY,
        seed=seed,
        levels=NoiseLevels(),
        real_time=False,
        log=LOG,
        electronics=electronics,
        wrong=seed,
        calibration=file if file.exists() else None,
    ) as parts:
        SimulatedPerson(parts, seed=seed, echo=shown.append).calibrate(parts.devices, file, only)
    return shown


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int, str], Path]:
    """The file that a first session writes."""

    @cache
    def first_session(seed: int, electronics: str) -> Path:
        file = tmp_path_factory.mktemp("robot") / "calibration.toml"
        calibrate(seed, electronics, file)
        return file

    return first_session


def robot(seed: int, electronics: str) -> ParameterSet:
    wanted = seed in AT_EACH_CHANGE.get(electronics, ()) or "ALL_SEEDS" in os.environ
    skip = pytest.mark.skipif(not wanted, reason="make calibration has all seeds")
    return pytest.param(seed, electronics, marks=skip)


@pytest.mark.parametrize(
    ("seed", "electronics"), [robot(seed, name) for name in SETS for seed in SEEDS]
)
def test_a_wrong_calibration_is_put_right(
    seed: int, electronics: str, calibrated: Callable[[int, str], Path]
) -> None:
    believed = BELIEVED[electronics]
    truth = miscalibrated(believed, seed)
    before = errors(believed, truth)
    assert before.joint > 10  # degrees: there is something to put right
    file = calibrated(seed, electronics)
    read = read_calibration(file, believed.servos.known_counts)
    after = errors(apply_calibration(believed, read, file=str(file)), truth)
    assert after.joint < 1
    assert after.tilt < 1
    assert after.clearance < 1
    assert after.force < 0.02  # a fifth of what counts as touching
    off = errors_in_sigmas(apply_calibration(believed, read, file=str(file)), truth)
    assert max(off) < 3.5
    assert sum(one < 1 for one in off) >= 0.5 * len(off)


def errors_in_sigmas(config: RobotConfig, truth: RobotConfig) -> list[float]:
    """What is off, in the standard deviations that the calibration states."""
    off = []
    for ours, true in zip(config.joints, truth.joints, strict=True):
        at, ends = ours.scale.count(0.0), [ours.scale.count(end) for end in ours.reachable]
        spans = [scale.angle(ends[1]) - scale.angle(ends[0]) for scale in (ours.scale, true.scale)]
        off.append((ours.scale.angle(at) - true.scale.angle(at)) / (ours.uncertainty.zero or 0))
        off.append(math.log(spans[0] / spans[1]) / (ours.uncertainty.gain or 0))
    assert config.axes is not None
    assert truth.axes is not None
    gains = zip(config.axes.per_g, truth.axes.per_g, strict=True)
    off += [math.log(ours / true) / (config.axes.uncertainty.gain or 0) for ours, true in gains]
    assert config.distance is not None
    assert truth.distance is not None
    sensor, real = config.distance, truth.distance
    off.append((sensor.zero - real.zero) / (sensor.uncertainty.zero or 0))
    off.append(math.log(sensor.scale / real.scale) / (sensor.uncertainty.gain or 0))
    return [abs(one) for one in off]


@pytest.fixture(scope="module")
def file(calibrated: Callable[[int, str], Path]) -> Path:
    return calibrated(SEEDS[0], "pc104")


def test_a_second_session_begins_with_the_first(file: Path, tmp_path: Path) -> None:
    copy = tmp_path / "calibration.toml"
    copy.write_bytes(file.read_bytes())
    believed = BELIEVED["pc104"]
    truth = miscalibrated(believed, SEEDS[0])
    pairs = zip(believed.joints, truth.joints, strict=True)
    turned = [ours.name for ours, true in pairs if ours.scale.rises != true.scale.rises]
    assert turned
    shown = calibrate(SEEDS[0], "pc104", copy, only=turned)
    assert any(f"{turned[-1]}: count" in text for text in shown)
    assert read_calibration(copy, COUNTS).revision == 2
    assert (tmp_path / "calibration.toml.1").read_bytes() == file.read_bytes()
    assert not any("other way" in text for text in shown)


def test_the_robot_lies_flat_with_its_calibration_and_not_without(file: Path) -> None:
    misses = []
    for calibration in (None, file):
        with emulation(
            BODY,
            seed=0,
            levels=NO_NOISE,
            real_time=False,
            log=LOG,
            wrong=SEEDS[0],
            calibration=calibration,
        ) as parts:
            controller = robot_on(parts, LOG, operator=True)
            controller.start()
            controller.shut_down()  # parks at what it believes is zero
            parts.clock.sleep(1.0)
            misses.append(max(abs(math.degrees(angle)) for angle in parts.world.angles()))
    assert misses[0] > 3
    assert misses[1] < 1


def test_every_set_of_electronics_can_be_chosen() -> None:
    for name in SETS:
        assert _parser().parse_args(["--electronics", name]).electronics == name
