"""``robot.toml``: the shipped example is right, and each wrong one is refused with a sentence."""

from __future__ import annotations

import math
from contextlib import suppress
from importlib import resources
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robot.cli.new import robot_toml
from robot.configuration.robot_config import load_config
from robot.errors import ConfigError
from robot.sensing.samples import RestDetector

SIZE = "size_mm = [140, 140, 85]"
HIP_COUNTS = "joint 1 (hip_left).calibration"
HIP_LIMITS = "joint 1 (hip_left).limits_deg"
EXAMPLE = Path(str(resources.files("robot") / "robot.toml"))
ARM = Path(__file__).parents[3] / "docs" / "robots" / "arm" / "robot.toml"


def refused(tmp_path: Path, text: str) -> str:
    file = tmp_path / "robot.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert str(file) in str(caught.value)
    return str(caught.value)


def test_the_example_holds_table_1_and_2_of_the_paper() -> None:
    config = load_config(EXAMPLE)
    assert config.body.size == (0.14, 0.14, 0.085)
    assert [joint.name for joint in config.joints] == [
        f"{joint}_{side}"
        for joint in ("hip", "knee")
        for side in ("left", "front", "right", "back")
    ]
    for joint in config.joints:
        upper = 74 if joint.name.startswith("hip") else 94
        assert [math.degrees(angle) for angle in joint.reachable] == pytest.approx([-96, upper])
    assert math.degrees(config.speed) == pytest.approx(60)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("baud = 9600", "baud = 115200", ["servos.baud", "19200", "115200"]),
        ("baud = 9600", "baud = 9601", ["servos.baud", "2400, 4800, 9600, 19200", "9601"]),
        ("baud = 9600", "bauds = 9600", ["servos.bauds", "Did you mean 'baud'?"]),
        ("mass_kg = 0.6", "", ["body.mass_kg", "missing"]),
        ("mass_kg = 0.6", 'mass_kg = "heavy"', ["body.mass_kg", "number"]),
        ("[body]", '[body]\nzero_pose = "sits"', ["body.zero_pose", "flat, standing", "'sits'"]),
        (SIZE, "size_mm = [140, 140]", ["body.size_mm", "3 numbers"]),
        (SIZE, "radius_mm = 70", ["body.height_mm", "missing", "beside its radius_mm"]),
        (SIZE, "height_mm = 20", ["body.radius_mm", "missing", "beside its height_mm"]),
        ("[body]", "[body]\nradius_mm = 70", ["body.size_mm", "of a box", "radius_mm, height_mm"]),
        (SIZE, "radius_mm = -70\nheight_mm = 20", ["body.radius_mm", "millimetres"]),
        (SIZE, "radius_mm = 14\nheight_mm = 20", ["body.mass_kg", "28 x 28 x 20 mm"]),
        ("speed_deg_s = 60", "speed_deg_s = 90", ["motion.speed_deg_s", "60"]),
        ("speed_deg_s = 60", "speed_deg_s = nan", ["motion.speed_deg_s"]),
        ("base = 0x300", "base = 0x310", ["daq.base", "0x300, 0x340", "not 0x310"]),
        ("base = 0x300", 'base = "0x300"', ["daq.base", "one of", "'0x300'"]),
        ('driver = "dmm32"', 'driver = "dsc"', ["daq.driver", "comedi, dmm32"]),
        ('input_range = "±5V"', 'input_range = "5V"', ["daq.input_range", "±5V"]),
        ("channels = [0, 1, 2]", "channels = [0, 1, 1]", ["accelerometer.channels", "not 0, 1, 1"]),
        ("off_n = 0.05", "off_n = 0.5", ["touch 1 (lower_left).off_n", "on_n"]),
        ("[[3, -96], [253, 74]]", "[[3, -96]]", [HIP_COUNTS, "two or more"]),
        (
            "[[3, -96], [253, 74]]",
            "[[3, -96], [300, 74]]",
            [HIP_COUNTS, "255"],
        ),
        (
            "[[3, -96], [253, 74]]",
            "[[3, -96], [100, 10], [253, -5]]",
            [HIP_COUNTS, "rise or fall"],
        ),
        (
            "[[3, -96], [253, 74]]",
            "[[3, 10], [253, 74]]",
            [HIP_COUNTS, "zero pose"],
        ),
        (
            "limits_deg = [-96, 74]",
            "limits_deg = [74, -96]",
            [HIP_LIMITS, "rise"],
        ),
        (
            "output = 2",
            "output = 1",
            ["joint 2 (hip_front).output", "is 1, as that of joint 1 (hip_left)"],
        ),
        (
            'name = "hip_front"',
            'name = "hip_left"',
            ["joint 2 (hip_left).name", "'hip_left'", "joint 1"],
        ),
        ("channel = 4", "channel = 3", ["touch 1 (lower_left).channel", "input 3"]),
        ("channel = 6", "channel = 2", ["touch 4 (lower_back).channel", "input 2"]),
        ("debounce = 3", "debounce = 30", ["touch 1 (lower_left).debounce", "30", "10 samples"]),
        ("joints = 8", "joints = 7", ["robot.joints", "says 7", "8 [[joint]]"]),
        ("[noise]", "[nois]", ["noise", "missing"]),
        ("address = 0x29", "address = 0x80", ["distance.address", "from 8 to 119"]),
        ("board = 1 ", "board = 256", ["servos.board", "from 0 to 255"]),
        ("board = 1 ", "board = [1, 1]", ["servos.board", "different ones", "[1, 1]"]),
        ("board = 1 ", "board = []", ["servos.board", "[]"]),
        ("board = 1 ", "board = [0, 1]", ["servos.board", "0 addresses every board"]),
        ("range_mm = 200", "range_mm = 300", ["distance.range_mm", "from 20 to 255"]),
        ("[daq]", "[dac]", ["daq", "missing", "connected to its inputs"]),
        (
            'driver = "sv203"',
            'driver = "sv204"',
            ["servos.driver", "one of dynamixel, feetech, pca9685, sv203", "'sv204'"],
        ),
        ("output = 2", "output = 9", ["joint 2 (hip_front).output", "is 9", "1 to 8"]),
        ("base = 0x300", 'device = "/dev/comedi0"', ["daq.device", "not a known key"]),
        ("[motion]", "[motion", ["TOML"]),
    ],
)
def test_a_wrong_value_is_named(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    sentence = refused(tmp_path, text.replace(old, new, 1))
    assert all(word in sentence for word in words), sentence


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 0.6", "mass_kg = 600", ["body.mass_kg", "100 kilograms", "600"]),
        ("mass_kg = 0.6", "mass_kg = 60", ["body.mass_kg", "is 60", "write kilograms"]),
        ("mass_kg = 0.6", "mass_kg = 6e-4", ["body.mass_kg", "0.01", "kilograms", "0.0006"]),
        ("[140, 140, 85]", "[0.14, 0.14, 0.085]", ["body.size_mm", "millimetres", "0.14"]),
        ("[140, 140, 85]", "[14, 14, 8.5]", ["body.mass_kg", "14 x 14 x 8.5 mm"]),
        ("[140, 140, 85]", "[1400, 1400, 850]", ["body.mass_kg", "0.36 kg"]),
        ("[-96, 74]", "[-1.68, 1.29]", ["joint 1 (hip_left).limits_deg", "-1.68", "degrees"]),
        ("[[3, -96], [253, 74]]", "[[3, -1.68], [253, 1.29]]", ["hip_left", "0.0119 degrees"]),
        ("[[3, -96], [253, 74]]", "[[100, -96], [153, 74]]", ["3.21 degrees", "[count, degrees]"]),
        ("part_radius_mm = 13", "part_radius_mm = 0.013", ["part_radius_mm", "millimetres"]),
        ("speed_deg_s = 60", "speed_deg_s = 1.05", ["motion.speed_deg_s", "degrees per second"]),
        ("line_gap_ms = 3", "line_gap_ms = 0.003", ["servos.line_gap_ms", "milliseconds"]),
        ("[1.0, 1.0, 1.0]", "[1000, 1000, 1000]", ["accelerometer.volts_per_g", "volts", "1000"]),
        ("[1.0, 1.0, 1.0]", "[1, -0.001, 1]", ["accelerometer.volts_per_g", "0.001"]),
        ("[2.5, 2.5, 2.5]", "[2500, 2500, 2500]", ["accelerometer.zero_v", "volts", "2500"]),
        ("volts_per_newton = 0.2", "volts_per_newton = 200", ["lower_left", "volts", "200"]),
        ("tare_v = 0.2", "tare_v = 200", ["touch 1 (lower_left).tare_v", "volts"]),
        ("on_n = 0.1", "on_n = 100", ["touch 1 (lower_left).on_n", "newtons"]),
        ("range_mm = 200", "range_mm = 0.2", ["distance.range_mm", "millimetres"]),
        ("swing_deg = 0.5", "swing_deg = 0.0087", ["settling.swing_deg", "degrees"]),
        ("drift_deg = 0.1", "drift_deg = 0.0017", ["settling.drift_deg", "degrees"]),
        ("timeout_s = 5", "timeout_s = 5000", ["settling.timeout_s", "seconds"]),
        ("tilt_deg = 0.3", "tilt_deg = 0.0052", ["noise.tilt_deg", "must be 0, or", "degrees"]),
        ("clearance_mm = 1.0", "clearance_mm = 0.001", ["noise.clearance_mm", "millimetres"]),
        # no robot could come to rest
        ("window_s = 1.0", "window_s = 0.05", ["settling.rate_hz", "at least 80,"]),
        ("rate_hz = 50", "rate_hz = 3", ["settling.rate_hz", "at least 4,"]),
        ("window_s = 1.0", "window_s = 6", ["settling.window_s", "at most 5,", "timeout_s"]),
    ],
)
def test_a_slip_of_the_unit_or_of_what_goes_together_is_refused(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    sentence = refused(tmp_path, text.replace(old, new, 1))
    assert all(word in sentence for word in words), sentence


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("window_s = 1.0", "window_s = 0.08"),
        ("rate_hz = 50", "rate_hz = 4"),
        ("window_s = 1.0", "window_s = 5"),
    ],
)
def test_a_still_robot_comes_to_rest_by_whatever_is_not_refused(
    tmp_path: Path, old: str, new: str
) -> None:
    file, text = tmp_path / "robot.toml", EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    criterion = load_config(file).settling
    detector = RestDetector(criterion)
    times = (step / criterion.rate for step in range(int(criterion.timeout * criterion.rate) + 1))
    assert any(detector.feed(time, (0.0, 0.0)) for time in times)


def test_without_an_accelerometer_nobody_looks_for_rest(tmp_path: Path) -> None:
    file, text = tmp_path / "robot.toml", ARM.read_text(encoding="utf-8")
    file.write_text(text.replace("timeout_s = 2", "timeout_s = 0.5\nrate_hz = 1"), encoding="utf-8")
    assert load_config(file).settling.timeout == 0.5


def test_noise_may_be_none(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    text = EXAMPLE.read_text(encoding="utf-8")
    file.write_text(text.replace("clearance_mm = 1.0", "clearance_mm = 0"), encoding="utf-8")
    assert load_config(file).noise.clearance == 0.0


def test_whether_the_zero_pose_is_flat(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    text = EXAMPLE.read_text(encoding="utf-8")
    assert load_config(EXAMPLE).body.lies_flat
    file.write_text(text.replace("# zero_pose", "zero_pose"), encoding="utf-8")
    assert not load_config(file).body.lies_flat


@pytest.mark.parametrize(
    ("pins", "key"),
    [
        ("[[touch]]", "touch 1 (lower_left).channel: names input 4"),
        ("[accelerometer]", "accelerometer.channels: names input 5"),
    ],
)
def test_an_input_that_the_board_lacks_is_refused(tmp_path: Path, pins: str, key: str) -> None:
    text = robot_toml("pi", name="mine", joints=8, touch=4)
    if pins == "[[touch]]":
        text = text.replace("channel = 0", "channel = 4", 1)
    else:
        axes = (
            'driver = "analogue"\nchannels = [5, 6, 7]\nzero_v = [1.5, 1.5, 1.5]\n'
            "volts_per_g = [1, 1, 1]\n"
        )
        table = text[text.index(pins) : text.index("\n\n", text.index(pins))]
        text = text.replace(table, f"{pins}\n{axes}")
    sentence = refused(tmp_path, text)
    assert key in sentence
    assert "ADS1115" in sentence
    assert "inputs 0 to 3" in sentence
    two_chips = text.replace("address = 0x48", "address = [0x48, 0x49]", 1)
    (tmp_path / "two.toml").write_text(two_chips, encoding="utf-8")
    load_config(tmp_path / "two.toml", uncalibrated=True)


@pytest.mark.parametrize(
    "servos",
    [f"oscillator_mhz = {mhz}" for mhz in (22, 23.49, 27, 28)] + ["pulse_us = [1000, 2000]"],
)
def test_a_table_of_counts_stands_whatever_limits_the_pulses(tmp_path: Path, servos: str) -> None:
    file, text = tmp_path / "robot.toml", robot_toml("pi", name="mine", joints=8, touch=4)
    file.write_text(text.replace("pulse_us =", f"{servos}\n# ="), encoding="utf-8")
    config = load_config(file, uncalibrated=True)
    (hip, *_), counts = config.joints, config.servos.counts
    assert [count for count, _ in hip.scale.points] == [123, 492]
    assert all(hip.quantise(angle) in counts for angle in (hip.lower_limit, hip.upper_limit))
    of_another_driver = text.replace("[[123, -90], [492, 90]]", "[[3, -96], [253, 74]]")
    assert "calibration: counts must lie in 91 to 573" in refused(tmp_path, of_another_driver)


def test_a_round_body(tmp_path: Path) -> None:
    file, text = tmp_path / "robot.toml", EXAMPLE.read_text(encoding="utf-8")
    file.write_text(text.replace(SIZE, "radius_mm = 70\nheight_mm = 3"), encoding="utf-8")
    body = load_config(file).body
    assert body.size == pytest.approx((0.14, 0.14, 0.003))
    assert body.radius == pytest.approx(0.07)
    assert load_config(EXAMPLE).body.radius is None


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path / "nowhere.toml")


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(min_value=0))
def test_a_truncated_file_never_loads_by_half(tmp_path: Path, cut: int) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    cut %= len(text)
    file = tmp_path / "robot.toml"
    file.write_text(text[:cut], encoding="utf-8")
    with suppress(ConfigError):  # only optional keys of the last gauge can be missing unnoticed
        config = load_config(file)
        assert len(config.joints) == 8
        assert len(config.touch) == 4
        assert cut > text.rindex("volts_per_newton")


def test_the_hash_changes_with_the_calibration(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    text = EXAMPLE.read_text(encoding="utf-8")
    file.write_text(text.replace("[253, 74]", "[254, 74]", 1), encoding="utf-8")
    assert load_config(file).hash != load_config(EXAMPLE).hash


@pytest.mark.parametrize("value", ["[" * 5000, "9" * 400, "9" * 5000, "0x" + "f" * 5000])
def test_what_no_parser_should_meet_is_a_sentence(tmp_path: Path, value: str) -> None:
    assert "is not valid TOML" in refused(tmp_path, f"name = {value}")


def test_25_joints_on_16_outputs_are_refused_by_file_key_and_name(tmp_path: Path) -> None:
    text = EXAMPLE.read_text(encoding="utf-8").replace("board = 1 ", "board = [1, 2] ")
    file = tmp_path / "robot.toml"
    joints = "".join(
        f"[[joint]]\nname = 'j{n}'\noutput = {n}\nlimits_deg = [-80, 80]\npart_radius_mm = 6\n"
        "calibration = [[3, -96], [253, 74]]\n"
        for n in range(9, 26)
    )
    file.write_text(text.replace("joints = 8 ", "joints = 25 ") + joints, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    sentence = str(caught.value)
    for words in (str(file), "joint 17 (j17).output", "boards 1 and 2", "outputs 1 to 16"):
        assert words in sentence
