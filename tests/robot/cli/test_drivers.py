"""``robotd drivers``: what is installed, by whom, and what of it cannot be used."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.cli.command_line import main
from robot.drivers.registry import OURS


def test_ours_are_listed_by_table_with_the_names_of_their_devices(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["drivers"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == sum(map(len, OURS.values()))
    assert [line.split()[:3] for line in lines[:2]] == [
        ["[servos]", "sv203", "SV203"],
        ["[servos]", "pca9685", "PCA9685"],
    ]
    assert all("bodyschema" in line for line in lines)


def test_those_of_others_are_listed_and_what_is_wrong_with_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "outside-2.1.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 2.1\n")
    (folder / "entry_points.txt").write_text(
        "[bodyschema.servos]\nsound = outside_drivers:Settings\nsv203 = outside_drivers:Settings\n"
        "[bodyschema.sensors]\ntouch.lost = outside_drivers:Missing\n"
    )
    (tmp_path / "outside_drivers.py").write_text("class Settings:\n    name = 'Sound servos'\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["drivers"]) == 1
    lines = {" ".join(line.split()) for line in capsys.readouterr().out.splitlines()}
    assert "[servos] sound Sound servos outside 2.1" in lines
    assert "[servos] sv203 not used: the name is ours outside 2.1" in lines
    (lost,) = (line for line in lines if line.startswith("[touch] lost"))
    assert "outside_drivers:Missing cannot be imported: AttributeError" in lost
