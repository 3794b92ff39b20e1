"""A program that knows only SPEC.md can control the robot."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Serve

PROGRAM = Path(__file__).with_name("foreign_client.py")


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-I", str(PROGRAM), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_it_says_hello_acquires_performs_reads_and_releases(serve: Serve, robot: FakeRobot) -> None:
    server = serve(robot)
    done = run(server.endpoint, "0.25")
    assert done.returncode == 0, done.stderr
    felt = json.loads(done.stdout)
    assert felt["performed"]["type"] == felt["read"]["type"] == "observation"
    assert felt["read"]["sequence"] > felt["performed"]["sequence"]
    assert [dict(motion.targets) for motion in robot.motions] == [{"a": 0.25, "b": 0.25}]
    assert robot.controllers[-1] is None


@pytest.mark.parametrize(
    ("angle", "answer"),
    [
        ("0.7", "out_of_range: Joint a reaches -0.6000 to 0.6000 rad, not 0.7000."),
        ("nan", "malformed: A frame cannot hold the number nan."),
    ],
)
def test_it_is_told_what_is_wrong(serve: Serve, robot: FakeRobot, angle: str, answer: str) -> None:
    server = serve(robot)
    done = run(server.endpoint, angle)
    assert done.returncode == 1
    assert done.stderr.startswith(answer)
    assert robot.motions == []


def test_it_knows_nothing_of_this_project() -> None:
    imported = {
        (alias.name if isinstance(node, ast.Import) else node.module or "").split(".")[0]
        for node in ast.walk(ast.parse(PROGRAM.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    assert imported - sys.stdlib_module_names == {"zmq", "msgpack"}
