"""What the page and its vectors are to a program in another language: JavaScript, in Node."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from protocol.wire.messages import Perform, RobotRequest, State
from tests.protocol.conftest import FakeRobot

if TYPE_CHECKING:
    from tests.protocol.conftest import Serve

NODE = shutil.which("node")
PROGRAMS = Path(__file__).with_name("node")
VECTORS = Path(str(resources.files("protocol"))) / "vectors.json"

pytestmark = pytest.mark.skipif(NODE is None, reason="Node is not installed")


def run(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    assert NODE is not None
    return subprocess.run(
        [NODE, str(PROGRAMS / program), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_every_vector_holds_in_javascript() -> None:
    done = run("vectors.mjs", str(VECTORS))
    assert done.returncode == 0, done.stderr
    verdict = json.loads(done.stdout)
    assert verdict["failed"] == []
    assert sum(verdict["tried"].values()) == len(json.loads(VECTORS.read_text("utf-8")))


def spoilt(vector: dict[str, Any]) -> dict[str, Any]:
    """A vector that says something wrong."""
    if vector["kind"] == "message":
        return vector | {"json": vector["json"] | {"type": "other"}}
    if vector["kind"] == "malformed":
        return vector | {"id": 99}
    return vector | {"touch": not vector.get("touch"), "clearance": 0.111}


def test_a_vector_that_is_wrong_is_noticed(tmp_path: Path) -> None:
    wrong = [spoilt(vector) for vector in json.loads(VECTORS.read_text("utf-8"))]
    (tmp_path / "wrong.json").write_text(json.dumps(wrong), "utf-8")
    verdict = json.loads(run("vectors.mjs", str(tmp_path / "wrong.json")).stdout)
    assert len(verdict["failed"]) == len(wrong)


class OnceQuick(FakeRobot):
    """Its second motion ends only when something ends it."""

    def submit(self, ticket: int, request: RobotRequest) -> None:
        super().submit(ticket, request)
        self.manual = self.manual or isinstance(request, Perform)


def test_it_performs_stops_clears_and_releases(serve: Serve) -> None:
    robot = OnceQuick()
    server = serve(robot)
    done = run("session.mjs", server.endpoint, "0.25")
    assert done.returncode == 0, done.stderr
    session = json.loads(done.stdout)
    assert session["performed"]["type"] == "observation"
    assert session["ended"] == "aborted_stop"
    assert session["stopped"]["state"] == State.STOPPED
    assert session["refused"] == "stopped"
    assert session["cleared"]["state"] == State.HOLDING
    assert session["status"]["controller"]
    assert session["released"]["type"] == "ok"
    assert session["heard"][:4] == ["welcome", "ok", "accepted", "progress"]
    assert [dict(motion.targets) for motion in robot.motions] == [{"a": 0.25, "b": 0.25}] * 2
    assert robot.controllers[-1] is None
    assert server.garbage == 0


def test_it_is_told_what_is_wrong(serve: Serve, robot: FakeRobot) -> None:
    done = run("session.mjs", serve(robot).endpoint, "7")
    assert done.returncode == 1
    assert done.stderr.startswith("out_of_range: Joint a reaches -0.6000 to 0.6000 rad, not 7")
    assert robot.motions == []


def test_it_needs_nothing_but_node() -> None:
    imported = {
        name
        for program in PROGRAMS.glob("*.mjs")
        for name in re.findall(r'from "([^"]+)"', program.read_text("utf-8"))
    }
    assert {name for name in imported if not name.startswith(("node:", "./"))} == set()
