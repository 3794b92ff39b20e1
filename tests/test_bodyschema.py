"""The commands say so where their packages are somebody else's, as with Robot Framework."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COMMANDS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["scripts"]


def install_stranger(folder: Path, package: str) -> None:
    """Leaves what pip leaves of a distribution that has a package of the same name."""
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text("raise SystemExit('was imported')\n")
    (folder / package / "__main__.py").write_text("raise SystemExit('was imported')\n")
    info = folder / "stranger-7.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 7.5\n")
    (info / "RECORD").write_text(f"{package}/__init__.py,,\n{package}/__main__.py,,\n")


def run(command: str, *folders: Path) -> subprocess.CompletedProcess[str]:
    """Runs a command as its script does, where what is in the folders is found first."""
    module, _, function = COMMANDS[command].partition(":")
    return subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys, {module}; sys.exit({module}.{function}())",
            "--version",
        ],
        env=os.environ | {"PYTHONPATH": ":".join(map(str, (*folders, ROOT)))},
        cwd=ROOT.parent,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_with_our_own_packages_a_command_runs(command: str) -> None:
    ended = run(command)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith(f"{command} (bodyschema) ")


@pytest.mark.parametrize(
    ("command", "package"),
    [
        ("robotd", "robot"),
        ("sim-robotd", "robot"),
        ("robotd", "protocol"),
        ("sim-robotd", "sim_robot"),
        ("estimator", "estimator"),
    ],
)
def test_a_package_of_the_same_name_is_said_to_be_there(
    tmp_path: Path, command: str, package: str
) -> None:
    install_stranger(tmp_path, package)
    ended = run(command, tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.startswith(
        f"{command}: the package {package} at {tmp_path}/{package}/__init__.py is that of "
        "stranger 7.5, which has the same name. Install bodyschema into a virtual environment of "
    )
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "package"),
    [("robotd", "robot"), ("sim-robotd", "sim_robot"), ("estimator", "estimator")],
)
def test_an_interrupt_while_the_first_packages_are_imported_ends_in_a_sentence(
    tmp_path: Path, command: str, package: str
) -> None:
    (tmp_path / package).mkdir()
    (tmp_path / package / "__init__.py").write_text(
        "# passes for a package of bodyschema\nimport signal\nsignal.raise_signal(signal.SIGINT)\n"
    )
    ended = run(command, tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == f"{command}: interrupted\n"


def test_the_estimator_does_not_need_the_robots_package(tmp_path: Path) -> None:
    install_stranger(tmp_path, "robot")
    assert run("estimator", tmp_path).returncode == 0


def test_what_a_stranger_took_away_is_said_to_be_missing(tmp_path: Path) -> None:
    shadow = tmp_path / "bodyschema.py"
    shadow.write_bytes((ROOT / "bodyschema.py").read_bytes())
    (tmp_path / "robot").mkdir()  # pip has taken the files away that it had put over ours
    (tmp_path / "protocol").symlink_to(ROOT / "protocol")
    ended = subprocess.run(
        [
            sys.executable,
            "-I",
            "-S",
            "-c",
            f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
            "import bodyschema; sys.exit(bodyschema.robotd())",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 1
    assert ended.stderr.startswith("robotd: the package robot is missing or lacks its files. ")
