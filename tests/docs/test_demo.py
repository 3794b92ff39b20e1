"""``docs/demo.sh``, which ``make demo`` runs: here without the minutes of its identifications."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from socket import socket

DEMO = Path(__file__).parents[2] / "docs" / "demo.sh"


def test_the_demo_takes_a_free_port(tmp_path: Path) -> None:
    estimator = tmp_path / "estimator"
    estimator.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path / "asked"}\n')
    estimator.chmod(0o755)
    path = f"{tmp_path}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    with socket() as taken:
        with suppress(OSError):  # by somebody else
            taken.bind(("127.0.0.1", 5750))
            taken.listen()
        ended = subprocess.run(
            ["bash", DEMO, tmp_path / "demo"],
            env={**os.environ, "PATH": path},
            check=False,
            capture_output=True,
            text=True,
            timeout=120,
        )
    assert ended.returncode == 0, ended.stderr
    asked = (tmp_path / "asked").read_text()
    (port,) = set(re.findall(r"--robot tcp://127\.0\.0\.1:(\d+) ", asked.replace("\n", " \n")))
    assert port != "5750"
    assert f"The robot is at tcp://127.0.0.1:{port}\n" in ended.stdout
    assert asked.count("--robot") == 3
    assert (tmp_path / "demo" / "truth.urdf").stat().st_size > 0
