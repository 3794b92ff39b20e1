"""The demonstrations, here without the minutes of their identifications and diagnoses."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from socket import socket

DOCS = Path(__file__).parents[2] / "docs"


def shown(script: str, folder: Path, estimator: str) -> tuple[str, str]:
    """What a demonstration prints, and what it asks an estimator that is but a line of shell."""
    stub, asked = folder / "estimator", folder / "asked"
    stub.write_text(f'#!/bin/sh\necho "$@" >> {asked}\n{estimator}\n')
    stub.chmod(0o755)
    path = f"{folder}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    ended = subprocess.run(
        ["bash", DOCS / script, "demo"],
        env={**os.environ, "PATH": path},
        cwd=folder,
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout, asked.read_text()


def test_the_demo_takes_a_free_port(tmp_path: Path) -> None:
    with socket() as taken:
        with suppress(OSError):  # by somebody else
            taken.bind(("127.0.0.1", 5750))
            taken.listen()
        stdout, asked = shown("demo.sh", tmp_path, "")
    (port,) = set(re.findall(r"--robot tcp://127\.0\.0\.1:(\d+) ", asked.replace("\n", " \n")))
    assert port != "5750"
    assert f"The robot is at tcp://127.0.0.1:{port}\n" in stdout
    assert asked.count("--robot") == 3
    assert (tmp_path / "demo" / "truth.urdf").stat().st_size > 0


def test_a_running_robot_is_damaged_between_two_watches(tmp_path: Path) -> None:
    """Its daemon and control socket are real; the watch after the damage ends with 3: changed."""
    stdout, asked = shown("demo-damage.sh", tmp_path, 'case "$*" in *--every*) exit 3;; esac')
    assert '"body.cut=2:70"' in stdout
    order = [line.split()[0] for line in asked.splitlines()]
    assert order == ["identify", "pose", "monitor", "monitor", "diagnose", "pose", "compare"]
    before, after = stdout.split('"body.cut=2:70"')
    assert "monitor demo/body" in before
    assert "--once" in before
    assert "pose demo/body-now" in after
