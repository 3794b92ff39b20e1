"""What the tables of ``robot.toml`` and of the calibration file have in common."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from robot.configuration import device_tables
from robot.drivers.sensors.analogue import read_bridge
from robot.drivers.sensors.contracts import read_axes
from robot.drivers.servos.sv203 import COUNTS
from robot.errors import ConfigError
from robot.toml_sections import Section, read_toml


def section(folder: Path, text: str) -> Section:
    file = folder / "some.toml"
    file.write_text(f"[part]\n{text}\n", encoding="utf-8")
    return read_toml(file).table("part")


def test_degrees_and_millimetres_become_radians_and_metres(tmp_path: Path) -> None:
    table = section(tmp_path, "limits_deg = [-90, 45]\nzero_mm = 12\nscale = 0.9")
    assert device_tables.read_limits(table) == pytest.approx((-math.pi / 2, math.pi / 4))
    assert device_tables.read_distance_calibration(table) == (0.012, 0.9)


def test_a_distance_sensor_reads_true_unless_said_otherwise(tmp_path: Path) -> None:
    distance = device_tables.read_distance(
        section(tmp_path, "bus = 1\nzero_mm = 10\nrange_mm = 200")
    )
    assert distance.clearance(0.110) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("read", "text", "words"),
    [
        (device_tables.read_limits, "limits_deg = [5, 5]", "part.limits_deg: must rise"),
        (
            partial(read_axes, unit="V"),
            "zero_v = [1, 2, 3]\nvolts_per_g = [1, 0, 1]",
            "0.02 to 5 volts, not 0",
        ),
        (read_bridge, "tare_v = 0\nvolts_per_newton = 0", "to 50 volts, not 0"),
        (device_tables.read_thresholds, "on_n = 0.1\noff_n = 0.2", "part.off_n: must not exceed"),
        (
            device_tables.read_distance_calibration,
            "zero_mm = 10\nscale = 3",
            "part.scale: must be a number from 0.5",
        ),
        (
            partial(device_tables.read_scale, counts=COUNTS),
            "calibration = [[1, 5], [1, 6]]",
            "one count twice",
        ),
        (
            partial(device_tables.read_scale, counts=COUNTS),
            "calibration = [[0, 5], [9, 9]]",
            "counts must lie in 1 to 255",
        ),
    ],
)
def test_what_cannot_be_is_refused_by_key(
    tmp_path: Path, read: Callable[[Section], object], text: str, words: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        read(section(tmp_path, text))
    assert words in str(caught.value)
    assert "some.toml" in str(caught.value)
