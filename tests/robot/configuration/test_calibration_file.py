"""The calibration file: what is written comes back, what is wrong is named, nothing is lost."""

from __future__ import annotations

import errno
import math
import os
import stat
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robot.cli.new import robot_toml
from robot.configuration.calibration_file import (
    AxesCalibration,
    Calibration,
    DistanceCalibration,
    GaugeCalibration,
    JointCalibration,
    read_calibration,
    save_calibration,
    to_toml,
)
from robot.configuration.joint_calibration import JointScale
from robot.configuration.robot_config import load_config
from robot.drivers.servos.sv203 import COUNTS
from robot.errors import ConfigError
from robot.service.daemon import describe
from robot.uncertainty import Uncertainty

EXAMPLE = Path(str(resources.files("robot") / "robot.toml"))
HIP = JointCalibration(
    output=1,
    lower_limit=math.radians(-90),
    upper_limit=math.radians(70),
    scale=JointScale(((10, math.radians(72)), (131, 0.0), (250, math.radians(-85)))),
    uncertainty=Uncertainty(zero=math.radians(0.3), gain=0.003),
)
WHOLE = Calibration(
    robot="quadruped",
    revision=3,
    made="2026-11-20T03:57:20Z",
    joints={"hip_left": HIP},
    accelerometer=AxesCalibration(
        wiring={"channels": (0, 1, 2)},
        unit="V",
        zero=(2.4, 2.5, 2.6),
        per_g=(-1.0, 1.1, 0.9),
        uncertainty=Uncertainty(zero=math.radians(0.1)),
    ),
    gauges={
        "lower_left": GaugeCalibration(
            channel=3, tare=-0.1, volts_per_newton=-0.3, on=0.12, off=0.06
        ),
    },
    distance=DistanceCalibration(
        zero=0.0125, scale=0.98, uncertainty=Uncertainty(zero=0.0005, gain=0.006)
    ),
)


def written(folder: Path, text: str) -> Path:
    """A robot.toml that names a calibration file with this text."""
    (folder / "calibration.toml").write_text(text, encoding="utf-8")
    robot = EXAMPLE.read_text(encoding="utf-8")
    asked = "# [calibration]\n# file =", "[calibration]\nfile ="
    assert asked[0] in robot
    (folder / "robot.toml").write_text(robot.replace(*asked), encoding="utf-8")
    return folder / "robot.toml"


def test_its_values_take_the_place_of_those_in_robot_toml(tmp_path: Path) -> None:
    before, after = load_config(EXAMPLE), load_config(written(tmp_path, to_toml(WHOLE, COUNTS)))
    hip = after.joints[0]
    assert hip.scale.count(0.0) == 131
    assert [math.degrees(hip.lower_limit), math.degrees(hip.upper_limit)] == pytest.approx(
        [-90, 70]
    )
    assert after.axes is not None
    assert after.axes.zero == (2.4, 2.5, 2.6)
    channels = [config.sensors["accelerometer"].channels for config in (before, after)]
    assert channels[0] == channels[1]
    assert (after.gauges["lower_left"].tare, after.touch[0].on) == (-0.1, 0.12)
    assert after.touch[0].debounce == before.touch[0].debounce
    assert after.distance is not None
    # 12.5 mm is the belly on the ground; 100 mm more are 98 mm of clearance.
    assert after.distance.clearance(0.1125) == pytest.approx(0.098)
    assert after.joints[1:] == before.joints[1:]
    assert after.touch[1:] == before.touch[1:]
    assert after.hash != before.hash


def test_how_well_it_is_known_is_announced_where_it_is_stated(tmp_path: Path) -> None:
    said = describe(load_config(written(tmp_path, to_toml(WHOLE, COUNTS))))
    hip, *others = said.joints
    assert (hip.zero_sigma, hip.travel_sigma) == pytest.approx((math.radians(0.3), 0.003))
    assert {(one.zero_sigma, one.travel_sigma) for one in others} == {(None, None)}
    touch, tilt, clearance = said.sensors
    assert tilt.zero_sigma == pytest.approx(math.radians(0.1))
    assert touch.zero_sigma is touch.gain_sigma is tilt.gain_sigma is None
    assert (clearance.zero_sigma, clearance.gain_sigma) == pytest.approx((0.0005, 0.006))


def test_what_robot_toml_states_of_its_values_does_not_hold_for_others(tmp_path: Path) -> None:
    unstated = replace(WHOLE, distance=DistanceCalibration(zero=0.0125, scale=0.98))
    file = written(tmp_path, to_toml(unstated, COUNTS))
    text = file.read_text(encoding="utf-8")
    stated = "zero_sigma_deg = 0.2\ntravel_sigma = 0.001\n"
    text = text.replace("\nscale = 1.0 ", "\nzero_sigma_mm = 0.4\nscale = 1.0 ")
    text = text.replace("[[joint]]\n", f"[[joint]]\n{stated}")
    text = text.replace("[accelerometer]", "[accelerometer]\ngain_sigma = 0.002\n#")
    file.write_text(text, encoding="utf-8")
    said = describe(load_config(file))
    assert [one.zero_sigma for one in said.joints[:2]] == pytest.approx(
        [math.radians(0.3), math.radians(0.2)]
    )
    assert [one.gain_sigma for one in said.sensors] == [None] * 3
    (tmp_path / "calibration.toml").unlink()
    said = describe(load_config(file, uncalibrated=True))
    assert [one.gain_sigma for one in said.sensors] == [None, 0.002, None]
    assert said.sensors[2].zero_sigma == pytest.approx(0.0004)


numbers = st.floats(-9, 9).map(lambda value: round(value, 5))
gains = st.floats(0.02, 5).map(lambda value: round(value, 5))
positive = st.floats(0.01, 9).map(lambda value: round(value, 5))
names = st.text(st.characters(codec="utf-8"), min_size=1, max_size=8)


@st.composite
def scales(draw: st.DrawFn) -> JointScale:
    counts = draw(st.lists(st.integers(1, 255), min_size=2, max_size=9, unique=True))
    sign = draw(st.sampled_from((-1, 1)))
    return JointScale(tuple((count, sign * math.radians(count * 0.7 - 90)) for count in counts))


uncertainties = st.builds(
    Uncertainty,
    zero=st.none() | st.floats(1e-5, 0.02),  # rad or m
    gain=st.none() | st.floats(1e-4, 0.5),
)
calibrations = st.builds(
    Calibration,
    robot=names,
    revision=st.integers(1, 10**6),
    made=names,
    joints=st.dictionaries(
        names,
        st.builds(
            JointCalibration,
            output=st.integers(0, 300),
            lower_limit=st.just(math.radians(-60)),
            upper_limit=st.just(math.radians(60)),
            scale=scales(),
            uncertainty=uncertainties,
        ),
        max_size=3,
    ),
    accelerometer=st.none()
    | st.builds(
        AxesCalibration,
        wiring=st.just({"channels": (7, 3, 5)})
        | st.just({"forward": "-y", "left": "x", "up": "z"})
        | st.just({}),
        unit=st.just("V"),
        zero=st.tuples(numbers, numbers, numbers),
        per_g=st.tuples(gains, gains, gains),
        uncertainty=uncertainties,
    ),
    gauges=st.dictionaries(
        names,
        st.builds(
            GaugeCalibration,
            channel=st.integers(0, 31),
            tare=numbers,
            volts_per_newton=positive,
            on=st.just(9.5),
            off=positive,
        ),
        max_size=3,
    ),
    distance=st.none()
    | st.builds(
        DistanceCalibration,
        zero=st.just(0.012),
        scale=st.floats(0.7, 1.4),
        uncertainty=uncertainties,
    ),
)


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(calibrations)
def test_what_is_written_comes_back(tmp_path: Path, calibration: Calibration) -> None:
    file = tmp_path / "calibration.toml"
    file.write_text(to_toml(calibration, COUNTS), encoding="utf-8")
    read = read_calibration(file, COUNTS)
    assert (read.robot, read.revision, read.made) == (
        calibration.robot,
        calibration.revision,
        calibration.made,
    )
    if (axes := calibration.accelerometer) is not None:
        assert read.accelerometer is not None
        assert (read.accelerometer.zero, read.accelerometer.per_g) == (axes.zero, axes.per_g)
        assert read.accelerometer.wiring == axes.wiring
        same(read.accelerometer.uncertainty, axes.uncertainty)
    assert read.gauges == calibration.gauges
    assert read.joints.keys() == calibration.joints.keys()
    for name, joint in calibration.joints.items():
        assert read.joints[name].output == joint.output
        for count in (1, 100, 255):
            assert read.joints[name].scale.angle(count) == pytest.approx(
                joint.scale.angle(count), abs=1e-4
            )
        same(read.joints[name].uncertainty, joint.uncertainty)
    if calibration.distance is not None:
        assert read.distance is not None
        assert read.distance.scale == pytest.approx(calibration.distance.scale, abs=1e-5)
        same(read.distance.uncertainty, calibration.distance.uncertainty)


def same(read: Uncertainty, written: Uncertainty) -> None:
    """As well as five digits behind the point tell, of degrees or millimetres."""
    for one, other in ((read.zero, written.zero), (read.gain, written.gain)):
        assert (one is None) == (other is None)
        assert one is None or one == pytest.approx(other, rel=0.06, abs=2e-5)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("schema = 2", "schema = 3", ["schema", "is 3", "reads 2", "update robotd"]),
        ("schema = 2", "schema = 1", ["schema", "is 1", "wired", "docs/your-robot.md"]),
        ("schema = 2", "", ["schema", "missing"]),
        ('robot = "quadruped"', 'robot = "hexapod"', ["robot", "hexapod", "quadruped"]),
        ("[end]", "", ["end", "missing"]),
        (
            "[[touch]]",
            '[[joint]]\nname = "hip_left"\noutput = 1\ncounts = [1, 255]\nlimits_deg = [-60, 60]\n'
            "calibration = [[1, -9], [200, 9]]\n\n[[touch]]",
            ["joint 2 (hip_left).name", "twice"],
        ),
        ('name = "hip_left"', 'name = "hip_lef"', ["joint", "'hip_lef'"]),
        ('name = "lower_left"', 'name = "foot"', ["touch", "'foot'"]),
        ("scale = 0.98", "scale = 0", ["distance.scale", "0.5 to 2"]),
        ("scale = 0.98", "scales = 0.98", ["distance.scales", "Did you mean 'scale'"]),
        (
            "zero_sigma_deg = 0.3",
            "zero_sigma_deg = -0.3",
            ["(hip_left).zero_sigma_deg", "0.001 to"],
        ),
        ("travel_sigma = 0.003", "travel_sigma = nan", ["(hip_left).travel_sigma", "not nan"]),
        (
            "zero_sigma_mm = 0.5",
            "zero_sigma_mm = 1e300",
            ["distance.zero_sigma_mm", "20 millimetres"],
        ),
        ("scale_sigma = 0.006", "scale_sigma = 0", ["distance.scale_sigma", "0.0001 to 0.5"]),
        ("zero_sigma_deg = 0.1", "gain_sigma = true", ["accelerometer.gain_sigma", "not True"]),
        ("zero_v = [2.4, ", "zero_v = [nan, ", ["accelerometer.zero_v"]),
        ("limits_deg = [-90, 70]", "limits_deg = [10, 70]", ["joint.calibration", "zero pose"]),
        ("[10, 72], ", "[10, -72], ", ["joint 1 (hip_left).calibration", "rise or fall"]),
        ("off_n = 0.06", "off_n = 0.6", ["touch 1 (lower_left).off_n", "on_n"]),
        ("[distance]", "[distance", ["TOML"]),
    ],
)
def test_a_wrong_value_is_named(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    text = to_toml(WHOLE, COUNTS)
    assert old in text
    with pytest.raises(ConfigError) as caught:
        load_config(written(tmp_path, text.replace(old, new, 1)))
    sentence = str(caught.value)
    assert str(tmp_path / "calibration.toml") in sentence
    assert all(word in sentence for word in words), sentence


def test_a_file_made_for_other_counts_is_refused(tmp_path: Path) -> None:
    """The joints of a PCA9685 turn further per count at another update rate."""
    path = tmp_path / "calibration.toml"
    joint, counts = replace(HIP, scale=JointScale(((120, -1.4), (500, 1.4)))), range(91, 574)
    path.write_text(to_toml(replace(WHOLE, joints={"hip_left": joint}), counts), encoding="utf-8")
    assert "hip_left" in read_calibration(path, counts).joints
    with pytest.raises(
        ConfigError,
        match=r"joint 1 \(hip_left\)\.counts: are 91 to 573, .* 108 to 686 .* remove this table",
    ):
        read_calibration(path, range(108, 687))
    path.write_text(to_toml(replace(WHOLE, joints={}), counts), encoding="utf-8")
    assert read_calibration(path, range(108, 687)).gauges


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("output = 1", "output = 9", ["joint (hip_left)", "with output = 1,", "has output = 9"]),
        ("channel = 3", "channel = 9", ["touch (lower_left)", "with channel = 3,", "channel = 9"]),
        ("[0, 1, 2]", "[1, 0, 2]", ["accelerometer", "[0, 1, 2],", "has channels = [1, 0, 2]"]),
    ],
)
def test_what_was_wired_otherwise_since_is_refused(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    file = written(tmp_path, to_toml(WHOLE, COUNTS))
    load_config(file)
    robot = file.read_text(encoding="utf-8").replace("board = 1 ", "board = [1, 2] ")
    assert old in robot
    file.write_text(robot.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    sentence = str(caught.value)
    assert str(tmp_path / "calibration.toml") in sentence
    assert all(word in sentence for word in [*words, "--only"]), sentence


def test_a_chip_that_is_mounted_otherwise_since_is_refused(tmp_path: Path) -> None:
    robot = tmp_path / "robot.toml"
    text = robot_toml("pi", name="quadruped", joints=8, touch=4)
    robot.write_text(text, encoding="utf-8")
    config = load_config(robot, uncalibrated=True)
    assert config.axes is not None
    axes = AxesCalibration(
        wiring=config.axes.wiring, unit="g", zero=(0.0,) * 3, per_g=(-0.972, -1.0, 1.0)
    )
    calibration = Calibration(robot="quadruped", revision=1, accelerometer=axes)
    save_calibration(tmp_path / "calibration.toml", calibration, COUNTS)
    load_config(robot)
    text = text.replace('forward = "x"', 'forward = "-x"').replace('left = "y"', 'left = "-y"')
    robot.write_text(text, encoding="utf-8")
    with pytest.raises(
        ConfigError, match=r'accelerometer: .* forward = "x", left = "y", up.* forward = "-x", left'
    ):
        load_config(robot)


def test_a_truncated_file_is_refused_wherever_it_was_cut(tmp_path: Path) -> None:
    text = to_toml(WHOLE, COUNTS)
    for cut in range(0, text.rindex("[end]") + 5, 3):
        with pytest.raises(ConfigError):
            load_config(written(tmp_path, text[:cut]))


def test_a_sensor_that_the_robot_does_not_have_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path, to_toml(WHOLE, COUNTS))
    robot = file.read_text(encoding="utf-8")
    start, end = robot.index("[distance]"), robot.index("[settling]")
    file.write_text(robot[:start] + robot[end:], encoding="utf-8")
    with pytest.raises(ConfigError, match="distance"):
        load_config(file)


def test_a_file_that_nobody_may_look_at_is_not_taken_for_missing(tmp_path: Path) -> None:
    robot = written(tmp_path, to_toml(WHOLE, COUNTS)).read_text(encoding="utf-8")
    long = tmp_path / "long.toml"
    long.write_text(robot.replace("calibration.toml", 256 * "n"), encoding="utf-8")
    for uncalibrated in (False, True):
        with pytest.raises(ConfigError, match="n: cannot be read: File name too long"):
            load_config(long, uncalibrated=uncalibrated)


def test_a_file_that_is_named_and_missing_stops_the_robot(tmp_path: Path) -> None:
    file = written(tmp_path, "")
    (tmp_path / "calibration.toml").unlink()
    with pytest.raises(ConfigError, match="robotd calibrate"):
        load_config(file)


def test_the_files_before_are_kept_under_numbers(tmp_path: Path) -> None:
    file = tmp_path / "calibration.toml"
    assert save_calibration(file, WHOLE, COUNTS) is None
    first = file.read_bytes()
    assert save_calibration(file, Calibration(robot="quadruped", revision=4), COUNTS) == (
        tmp_path / "calibration.toml.1"
    )
    second = file.read_bytes()
    save_calibration(file, WHOLE, COUNTS)
    assert (tmp_path / "calibration.toml.1").read_bytes() == first
    assert (tmp_path / "calibration.toml.2").read_bytes() == second
    assert read_calibration(file, COUNTS).revision == 3


def test_a_daemon_of_another_user_can_read_it(tmp_path: Path) -> None:
    file = tmp_path / "calibration.toml"
    save_calibration(file, WHOLE, COUNTS)
    assert stat.S_IMODE(file.stat().st_mode) == 0o644


@pytest.mark.parametrize("call", ["fsync", "replace", "fchmod"])
@pytest.mark.parametrize("at", [1, 2])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left"), KeyboardInterrupt()])
def test_whatever_fails_the_old_file_stands_and_nothing_lies_about(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, at: int, error: BaseException
) -> None:
    file = tmp_path / "calibration.toml"
    save_calibration(file, WHOLE, COUNTS)
    before = file.read_bytes()
    calls = 0
    original = getattr(os, call)

    def failing(*arguments: object) -> object:
        nonlocal calls
        calls += 1
        if calls == at:
            raise error
        return original(*arguments)

    monkeypatch.setattr(os, call, failing)
    expected = ConfigError if isinstance(error, OSError) else KeyboardInterrupt
    with pytest.raises(expected):
        save_calibration(file, Calibration(robot="quadruped", revision=4), COUNTS)
    assert file.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} <= {file.name, f"{file.name}.1"}


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link = tmp_path / "calibration.toml"
    link.symlink_to(tmp_path / "there" / "real.toml")
    save_calibration(link, WHOLE, COUNTS)
    assert link.is_symlink()
    assert read_calibration(tmp_path / "there" / "real.toml", COUNTS) == read_calibration(
        link, COUNTS
    )
