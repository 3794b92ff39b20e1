"""Drivers by name: ours, those of other distributions, and those that cannot be had."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.drivers.registry import SENSORS, SERVOS, read_settings
from robot.drivers.servos.sv203 import SV203Settings
from robot.errors import ConfigError
from robot.toml_sections import Section, toml_section


def servos(driver: str) -> Section:
    return toml_section(f'[servos]\ndriver = "{driver}"', "robot.toml").table("servos")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on the path with a distribution that offers drivers, some of them broken."""
    folder = tmp_path / "outside-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\n")
    (folder / "entry_points.txt").write_text(
        f"[{SERVOS}]\nsound = outside_servos:Settings\nnameless = outside_servos:Missing\n"
        "broken = outside_broken:Settings\nleft = outside_leaving:Settings\n"
        "leaving = outside_servos:Leaving\nunwritten = outside_unwritten:Settings\n"
        "double = outside_servos:Settings\nsv203 = outside_servos:Settings\n"
        f"[{SENSORS}]\ntouch.outside = outside_servos:Settings\n"
    )
    (tmp_path / "outside_servos.py").write_text(
        "import sys\n"
        "class Settings:\n    read = classmethod(lambda cls, table: cls())\n"
        "class Leaving:\n    read = classmethod(lambda cls, table: sys.exit())\n"
    )
    (tmp_path / "outside_leaving.py").write_text("import sys; sys.exit(0)\n")
    (tmp_path / "outside_broken.py").write_text("import no_such_library\n")
    (tmp_path / "outside_unwritten.py").write_text("class\n")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_the_drivers_of_other_distributions_are_found_and_ours_stay(site: Path) -> None:
    outside = read_settings(servos("sound"), SERVOS, "sv203")
    assert type(outside).__module__ == "outside_servos"
    line = toml_section('[servos]\ndriver = "sv203"\nport = "/dev/ttyS0"', "robot.toml")
    assert isinstance(read_settings(line.table("servos"), SERVOS, "sv203"), SV203Settings)


def test_a_name_that_two_distributions_offer_is_refused(site: Path) -> None:
    other = site / "other-1.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: other\n")
    (other / "entry_points.txt").write_text(f"[{SERVOS}]\ndouble = other_servos:Settings\n")
    with pytest.raises(ConfigError, match="is offered by other and outside; uninstall"):
        read_settings(servos("double"), SERVOS, "sv203")


@pytest.mark.parametrize(
    ("driver", "words"),
    [
        (
            "none",
            "must be one of broken, double, dynamixel, feetech, leaving, left, nameless, pca9685, "
            "sound, sv203, unwritten, not 'none'",
        ),
        (
            "broken",
            "outside_broken:Settings, which cannot be imported: ModuleNotFoundError: No",
        ),
        ("unwritten", "outside_unwritten:Settings, which cannot be imported: SyntaxError: "),
        ("left", "outside_leaving:Settings, which cannot be imported: SystemExit: 0"),
        ("leaving", "outside_servos:Leaving, which failed on this table: SystemExit"),
        ("nameless", "outside_servos:Missing, which cannot be imported: AttributeError: module"),
    ],
)
def test_a_driver_that_cannot_be_had_is_a_sentence(site: Path, driver: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_settings(servos(driver), SERVOS, "sv203")
    assert str(caught.value).startswith("robot.toml: servos.driver: ")
    assert words in str(caught.value)


def test_a_sensor_is_offered_only_for_its_own_table(site: Path) -> None:
    table = toml_section('[distance]\ndriver = "outside"', "robot.toml").table("distance")
    with pytest.raises(ConfigError, match="must be one of vl6180x, not 'outside'"):
        read_settings(table, SENSORS, "vl6180x", kind="distance")
