"""One's own ``robot.toml`` on emulated electronics: what it says is what is wired."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from robot.cli.new import robot_toml
from robot.configuration.robot_config import RobotConfig, load_config
from robot.errors import DeviceMissingError
from sim_robot.command_line import main
from sim_robot.errors import BodyError
from sim_robot.faults.fault_panel import FaultSpec
from sim_robot.simulator.daemon import Emulation, emulation, robot_on
from sim_robot.simulator.fitted_body import fitted
from sim_robot.world.body import Body, default_body_path, load_body, shipped_bodies
from sim_robot.world.sensor_noise import NO_NOISE, NoiseLevels
from tests.docs.test_drivers import POINTS, PYTHON, TABLES, install

BODY = load_body(default_body_path())
LOG = logging.getLogger("test_own_electronics")
FOOT = re.compile(r'driver = "analogue".*?debounce = 3[^\n]*\n', re.DOTALL)


def without(text: str, table: str) -> str:
    return re.sub(rf"^\[{table}\].*?(?=^\[)", "", text, flags=re.DOTALL | re.MULTILINE)


def config_of(folder: Path, text: str) -> RobotConfig:
    file = folder / "robot.toml"
    file.write_text(text, encoding="utf-8")
    return load_config(file, uncalibrated=True)


def gpio_crawler() -> str:
    """A crawler as somebody built it: sockets, chips and switches where they happened to fit."""
    text = robot_toml("pi", name="crawler", joints=8, touch=4)
    head, *feet = text.split("\n[[touch]]")
    lines = ['line = "GPIO27"', "line = 4", 'line = 5\npressed = "high"', "line = 6"]
    feet = [
        FOOT.sub(f'driver = "gpio"\nchip = "pinctrl-rp1"\n{line}\n', foot)
        for foot, line in zip(feet, lines, strict=True)
    ]
    text = "\n[[touch]]".join([without(without(head, "distance"), "daq"), *feet])
    for old, new in (
        ("bus = 1 ", "bus = 3 "),
        ("output = 0", "output = 12"),
        ("# enable_line = 17", "enable_line = 17"),
        ('forward = "x"', 'forward = "-y"'),
        ('left = "y"', 'left = "x"'),
        ("address = 0x68", "address = 0x69"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


@contextmanager
def rehearsal(
    config: RobotConfig, body: Body = BODY, *, wrong: int | None = None
) -> Iterator[Emulation]:
    with emulation(
        body, seed=0, levels=NO_NOISE, real_time=False, log=LOG, own=config, wrong=wrong
    ) as parts:
        yield parts


def moved(parts: Emulation) -> tuple[list[float], tuple[float, ...]]:
    """Angles that were commanded, all different, and those that the body has then."""
    joints, servos = parts.config.joints, parts.devices.servos
    wanted = [0.05 * number - 0.2 for number in range(len(joints))]
    servos.read_counts([joint.output for joint in joints])
    parts.world.hold(1.0, (0.0, 0.0, 1.0))
    counts = [joint.quantise(angle) for joint, angle in zip(joints, wanted, strict=True)]
    servos.set_counts({joint.output: count for joint, count in zip(joints, counts, strict=True)})
    parts.clock.sleep(1.0)
    named = zip(joints, counts, strict=True)
    return [joint.scale.angle(count) for joint, count in named], parts.world.angles()


def test_a_crawler_is_wired_as_its_file_says(tmp_path: Path) -> None:
    with rehearsal(config_of(tmp_path, gpio_crawler())) as parts:
        assert {"pwm", "accelerometer", "gpio", "i2c"} <= parts.electronics.switches.keys()
        commanded, reached = moved(parts)
        assert reached == pytest.approx(commanded, abs=0.01)
        parts.world.hold(1.0, (0.6, 0.0, 0.8))  # nose up
        assert parts.devices.accelerometer is not None
        assert parts.devices.accelerometer.acceleration() == pytest.approx((0.6, 0, 0.8), abs=1e-3)
        for number, point in enumerate(parts.config.touch):
            parts.world.press(point.name, 1.0)
            felt = [sensor.load() for sensor in parts.devices.touch]
            assert felt == [other == number for other in range(4)]
            parts.world.press(point.name, 0.0)
        outputs = [joint.output for joint in parts.config.joints]
        assert all(parts.electronics.pulses())
        parts.devices.servos.release(outputs)
        assert not any(parts.electronics.pulses())
        parts.panel.order(FaultSpec.parse("gpio.unplugged"))
        with pytest.raises(DeviceMissingError, match=r"GPIO line 4 of pinctrl-rp1"):
            parts.devices.touch[1].load()


def test_a_switch_that_bears_a_little_does_not_flicker(tmp_path: Path) -> None:
    with emulation(
        BODY,
        seed=1,
        levels=NoiseLevels(),
        real_time=False,
        log=LOG,
        own=config_of(tmp_path, gpio_crawler()),
    ) as parts:
        switch = parts.devices.touch[0]
        parts.world.hold(1.0)
        felt = []
        for load in (0.0, 0.09, 0.11, 0.09, 0.06, 0.04, 0.06):
            parts.world.press("lower_left", load)
            felt.append({switch.load() for _ in range(20)})
        assert felt == [{False}, {False}, {True}, {True}, {True}, {False}, {False}]


def test_a_robot_of_2006_is_wired_as_its_file_says(tmp_path: Path) -> None:
    text = robot_toml("pc104", name="old", joints=8, touch=4)
    for old, new in (
        ("base = 0x300", "base = 0x340"),
        ("channels = [0, 1, 2]", "channels = [9, 8, 7]"),
        ("output = 1\n", "output = 11\n"),
        ("board = 1 ", "board = [1, 2] "),
    ):
        assert old in text
        text = text.replace(old, new)
    switch = 'driver = "switch"\nchannel = 4\npressed_v = 0.3\nfree_v = 3.0\n'
    head, left, front, *rest = text.split("\n[[touch]]")
    config = config_of(tmp_path, "\n[[touch]]".join([head, left, FOOT.sub(switch, front), *rest]))
    with rehearsal(config) as parts:
        commanded, reached = moved(parts)
        assert reached == pytest.approx(commanded, abs=0.01)
        parts.world.hold(0.1, (0.0, 0.6, 0.8))
        assert parts.devices.accelerometer is not None
        assert parts.devices.accelerometer.acceleration() == pytest.approx((0, 0.6, 0.8), abs=1e-3)
        parts.world.press("lower_front", 1.0)
        parts.world.press("lower_right", 2.0)
        parts.devices.accelerometer.acceleration()  # a scan of all inputs
        loads = [sensor.load() for sensor in parts.devices.touch]
        assert loads[1] is True
        assert loads == pytest.approx([0.0, 1.0, 2.0, 0.0], abs=0.01)


@pytest.mark.parametrize("driver", ["feetech", "dynamixel"])
def test_bus_servos_are_wired_by_their_ids(tmp_path: Path, driver: str) -> None:
    text = robot_toml("pi", name=driver, joints=8, touch=4)
    servos = f'[servos]\ndriver = "{driver}"\nport = "/dev/ttyUSB0"\n\n[motion]'
    text = without(text, "servos").replace("[motion]", servos)
    text = re.sub(r"^output = (\d+)", lambda at: f"output = {30 - int(at[1])}", text, flags=re.M)
    text = re.sub(r"calibration = \[\[.*", "calibration = [[1024, -90], [3072, 90]]", text)
    with rehearsal(config_of(tmp_path, text)) as parts:
        assert driver in parts.electronics.switches
        commanded, reached = moved(parts)
        assert reached == pytest.approx(commanded, abs=0.01)


def test_drivers_without_an_emulator_get_stand_ins_and_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    install(tmp_path, POINTS)
    (tmp_path / "bench_drivers.py").write_text(PYTHON, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    text = robot_toml("pc104", name="bench", joints=8, touch=4)
    head, joints = text.split("\n[[joint]]", 1)
    joints = joints[: joints.index("# One [[touch]]")]
    joints = re.sub(r"calibration = .*", "calibration = [[1, -90], [4095, 90]]", joints)
    feet = [f'[[touch]]\nname = "{name}"\ndriver = "bench"\n' for name in BODY.touch]
    ours = TABLES[: TABLES.index("[[touch]]")]
    for table in ("servos", "accelerometer", "distance", "daq"):
        head = without(head, table)
    config = config_of(tmp_path, head + "\n" + ours + "\n[[joint]]" + joints + "\n".join(feet))
    with rehearsal(config) as parts:
        said = [record.message for record in caplog.records if "stand-in" in record.message]
        assert [re.findall(r"^\[(.+?)\]", sentence)[0] for sentence in said] == [
            "servos",
            "accelerometer",
            "distance",
            *(f"touch {name}" for name in BODY.touch),
        ]
        assert "no emulator of the bench servos" in said[0]
        commanded, reached = moved(parts)
        assert reached == pytest.approx(commanded, abs=0.01)
        first = parts.config.hash
        parts.world.hold(0.1, (0.0, 0.6, 0.8))
        assert parts.devices.distance is not None
        assert parts.devices.accelerometer is not None
        assert parts.devices.accelerometer.acceleration() == pytest.approx((0, 0.6, 0.8), abs=1e-6)
        parts.world.lay_down()
        below = parts.world.belly_ray() + 0.010
        assert parts.devices.distance.distance() == pytest.approx(below, abs=1e-6)
    with rehearsal(config) as parts:
        assert parts.config.hash == first  # it is of the robot, not of this process


def test_a_board_without_an_emulator_gets_a_stand_in(tmp_path: Path) -> None:
    text = robot_toml("pc104", name="comedi", joints=8, touch=4)
    text = text.replace('driver = "dmm32"', 'driver = "comedi"\ndevice = "/dev/comedi0"')
    text = re.sub(r"^base = .*\n", "", text, flags=re.MULTILINE)
    with rehearsal(config_of(tmp_path, text)) as parts:
        parts.world.press("lower_front", 1.0)
        assert parts.devices.touch[1].load() == pytest.approx(1.0, abs=0.02)


def test_a_robot_without_accelerometer_and_distance_sensor_tells_touch_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = config_of(tmp_path, without(gpio_crawler(), "accelerometer"))
    with rehearsal(config) as parts:
        controller = robot_on(parts, LOG, operator=True)
        assert [sensor.modality for sensor in controller.capabilities.sensors] == ["touch"]
        runner = controller._interaction
        begun = parts.clock.now()
        targets = dict.fromkeys((joint.name for joint in config.joints), 0.0)
        reading = runner.perform(targets, lambda phase, share: None)
        assert (reading.tilt, reading.clearance, reading.settled) == (None, None, False)
        assert reading.touch is not None
        assert parts.clock.now() - begun > 2 * config.settling.timeout


def test_what_calibration_has_to_find_can_be_wrong_here_too(tmp_path: Path) -> None:
    with rehearsal(config_of(tmp_path, gpio_crawler()), wrong=3) as parts:
        commanded, reached = moved(parts)
        assert max(abs(a - b) for a, b in zip(commanded, reached, strict=True)) > math.radians(2)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "hexapod_12",
            "hexapod_12: has 12 joints, and crawler in robot.toml 8: give --body a body with 8 "
            "joints (with as many comes",
        ),
        ("biped", "biped: has 4 joints"),
    ],
)
def test_a_body_with_other_joints_is_refused(tmp_path: Path, name: str, words: str) -> None:
    config = config_of(tmp_path, gpio_crawler())
    with pytest.raises(BodyError) as refused:
        fitted(load_body(shipped_bodies()[name]), config)
    assert words.replace(" joints (", " (") in str(refused.value)


def test_names_order_the_body_and_feet_that_the_file_leaves_out_have_no_sensor(
    tmp_path: Path,
) -> None:
    config = config_of(tmp_path, gpio_crawler())
    turned = replace(config, joints=config.joints[::-1], touch=config.touch[2:0:-1])
    body, notes = fitted(BODY, turned)
    assert [motor.name for motor in body.motors] == [joint.name for joint in turned.joints]
    assert list(body.touch) == ["lower_right", "lower_front"]
    assert notes == []


def test_what_the_body_has_otherwise_is_said(tmp_path: Path) -> None:
    text = gpio_crawler()
    for old, new in (
        ("size_mm = [140, 140, 85]", "size_mm = [140, 120, 85]"),
        ("mass_kg = 0.6", "mass_kg = 0.9"),
        ("# zero_pose", "zero_pose"),
        ('name = "knee_left"', 'name = "knee"'),
        ('name = "lower_left"', 'name = "foot"'),
    ):
        text = text.replace(old, new)
    _, notes = fitted(BODY, config_of(tmp_path, text))
    assert [note.split(" are taken")[0].split(":")[0] for note in notes[:2]] == [
        "the body's joints have other names, and",
        "the body's feet have other names, and",
    ]
    assert "foot = lower_left" in notes[1]
    assert notes[2:] == [
        "the main body is 140 x 140 x 85 mm in the URDF and 140 x 120 x 85 mm in robot.toml",
        "the main body has 0.6 kg in the URDF and 0.9 kg in robot.toml",
        "with all joints at 0 the body lies flat, and robot.toml says that it stands "
        "(body.zero_pose)",
    ]


def test_feet_that_the_body_does_not_have_are_refused(tmp_path: Path) -> None:
    config = config_of(tmp_path, gpio_crawler())
    strange = replace(config.touch[0], name="tail")
    with pytest.raises(BodyError, match=r"has the feet lower_left.*robot\.toml names tail: call"):
        fitted(BODY, replace(config, touch=(strange,)))


def test_the_command_line_takes_one_or_the_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    with pytest.raises(SystemExit):
        main(["--config", str(file), "--electronics", "pi"])
    assert "leave --electronics out" in capsys.readouterr().err
    assert main(["--config", str(file)]) == 1
    assert f"{file}: cannot be read" in capsys.readouterr().err
