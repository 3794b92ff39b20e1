"""The README is true: its commands are run, in order, in an empty folder."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
# The same commands on a smaller budget: what is tested is that they do what is said.
PAPER = " --population 8 --generations 1"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def test_the_commands_and_the_program_run(tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    script = "".join(blocks("sh"))
    assert script.count("estimator identify") == 4
    for command, shorter in (
        ("--interactions 6", "--interactions 1"),
        ("--robot (replay|file):", r"--method paper --robot \1:"),
        (r"^(.* --method paper .*)$", rf"\1{PAPER}"),
        ("estimator identify", "python -m tests.estimator.little_effort identify"),
    ):
        script = re.sub(command, shorter, script, flags=re.MULTILINE)
    # The first command goes to the background; the second must find it listening.
    script = script.replace("&\n", "2> log &\nuntil grep -q serving log; do sleep 0.1; done\n", 1)
    python = "".join(blocks("python"))
    assert "RobotClient" in python
    script += "cat > program.py <<'END'\n" + python + "END\npython program.py\n"
    script = "set -e\ntrap 'kill %1' EXIT\n" + script.replace("5750", str(port))
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        env=os.environ
        | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Mean leg error" in done.stdout
    assert "Prediction error" in done.stdout


def test_its_make_targets_and_links_exist() -> None:
    targets = re.findall(r"^make (\w+)", "".join(blocks("")), flags=re.MULTILINE)
    assert targets == ["demo", "test"]
    for target in [*targets, "help"]:
        subprocess.run(["make", "-n", target], cwd=ROOT, check=True, capture_output=True)
    for link in re.findall(r"\]\(([^)]+)\)", README):
        assert (ROOT / link).exists(), link
