"""``make`` takes the best Python that there is, says which and why, or what to install."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def chosen(folder: Path, *options: str, **pythons: str) -> str:
    """What ``make install`` says where these Pythons are all there is; no environment is made."""
    make = shutil.which("make")
    assert make is not None
    for name, version in pythons.items():
        python = folder / name.replace("_", ".")
        # Answers what its version is; without one it is a shim of pyenv's that leads nowhere.
        python.write_text(f"#!/bin/sh\n[ $1 = -c ] && [ -n '{version}' ] && echo {version}\n")
        python.chmod(0o755)
    ended = subprocess.run(
        [make, "install", f"VENV={folder / 'venv'}", *options],
        cwd=ROOT,
        env={"PATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 2
    return ended.stderr.splitlines()[0]


def test_it_is_the_one_with_pybullet(tmp_path: Path) -> None:
    said = chosen(tmp_path, python3="3.14", python3_13="3.13", python3_11="3.11")
    assert said == "Python 3.11 (python3.11): has PyBullet on x86-64"


@pytest.mark.parametrize(
    ("pythons", "best"),
    [
        ({"python3": "3.14", "python3_11": "", "python3_13": "3.13"}, "3.13 (python3.13)"),
        ({"python3": "3.16"}, "3.16 (python3)"),
    ],
)
def test_elsewhere_it_is_one_without(tmp_path: Path, pythons: dict[str, str], best: str) -> None:
    said = chosen(tmp_path, **pythons)
    assert said.startswith(f"Python {best}: MuJoCo takes the place of PyBullet")


def test_one_that_is_asked_for_is_taken_or_refused(tmp_path: Path) -> None:
    said = chosen(tmp_path, "PYTHON=python3.12", python3_12="3.12", python3_11="3.11")
    assert said.startswith("Python 3.12 (python3.12): ")
    assert "tried python9. Install one" in chosen(tmp_path, "PYTHON=python9")


def test_where_there_is_none_it_says_what_to_install(tmp_path: Path) -> None:
    assert "tried python3.11 python3.13" in chosen(tmp_path, python3="")
