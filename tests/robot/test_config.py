"""``robot.toml``: the shipped example is right, and each wrong one is refused with a sentence."""

from __future__ import annotations

import math
from contextlib import suppress
from importlib import resources
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robot.config import load_config
from robot.errors import ConfigError

EXAMPLE = Path(str(resources.files("robot") / "robot.toml"))


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
        ("baud = 9600", "baud = 115200", ["servo_board.baud", "19200", "115200"]),
        ("baud = 9600", "baud = 9601", ["servo_board.baud", "2400, 4800, 9600, 19200", "9601"]),
        ("baud = 9600", "bauds = 9600", ["servo_board.bauds", "Did you mean 'baud'?"]),
        ("mass_kg = 0.6", "", ["body.mass_kg", "missing"]),
        ("mass_kg = 0.6", 'mass_kg = "heavy"', ["body.mass_kg", "number"]),
        ("size_mm = [140, 140, 85]", "size_mm = [140, 140]", ["body.size_mm", "3 numbers"]),
        ("speed_deg_s = 60", "speed_deg_s = 90", ["motion.speed_deg_s", "60"]),
        ("speed_deg_s = 60", "speed_deg_s = nan", ["motion.speed_deg_s"]),
        ("base = 0x300", "base = 0x310", ["daq.base", "0x300, 0x340", "not 0x310"]),
        ("base = 0x300", 'base = "0x300"', ["daq.base", "one of", "'0x300'"]),
        ('driver = "dmm32"', 'driver = "dsc"', ["daq.driver", "dmm32, comedi"]),
        ('input_range = "±5V"', 'input_range = "5V"', ["daq.input_range", "±5V"]),
        ("channels = [0, 1, 2]", "channels = [0, 1, 1]", ["accelerometer.channels"]),
        ("off_n = 0.05", "off_n = 0.5", ["touch[0].off_n", "on_n"]),
        ("[[3, -96], [253, 74]]", "[[3, -96]]", ["joint[0].calibration", "two or more"]),
        ("[[3, -96], [253, 74]]", "[[3, -96], [300, 74]]", ["joint[0].calibration", "255"]),
        (
            "[[3, -96], [253, 74]]",
            "[[3, -96], [100, 10], [253, -5]]",
            ["joint[0].calibration", "rise or fall"],
        ),
        ("[[3, -96], [253, 74]]", "[[3, 10], [253, 74]]", ["joint[0].calibration", "zero pose"]),
        ("limits_deg = [-96, 74]", "limits_deg = [74, -96]", ["joint[0].limits_deg", "rise"]),
        ("output = 2", "output = 1", ["joint", "share an output"]),
        ('name = "hip_front"', 'name = "hip_left"', ["joint", "share a name"]),
        ("channel = 4", "channel = 3", ["touch (lower_left).channel", "input 3"]),
        ("channel = 6", "channel = 2", ["touch (lower_back).channel", "input 2"]),
        ("debounce = 3", "debounce = 30", ["touch (lower_left)", "30", "10 samples"]),
        ("joints = 8", "joints = 7", ["robot.joints", "says 7", "8 [[joint]]"]),
        ("[noise]", "[nois]", ["noise", "missing"]),
        ("[motion]", "[motion", ["TOML"]),
    ],
)
def test_a_wrong_value_is_named(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    sentence = refused(tmp_path, text.replace(old, new, 1))
    assert all(word in sentence for word in words), sentence


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
        assert len(config.gauges) == 4
        assert cut > text.rindex("volts_per_newton")


def test_the_hash_changes_with_the_calibration(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    text = EXAMPLE.read_text(encoding="utf-8")
    file.write_text(text.replace("[253, 74]", "[254, 74]", 1), encoding="utf-8")
    assert load_config(file).hash != load_config(EXAMPLE).hash
