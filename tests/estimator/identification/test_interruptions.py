"""Runs that are broken off at random moments, again and again, end as one that never was."""

from __future__ import annotations

import itertools
import json
import os
import random
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

from bench.daemons import simulator
from estimator.storage.database import holds_run
from estimator.storage.store import RunStore

# The command starts in a process that has loaded everything, so that interrupts hit its work.
NURSERY = """
import json, os, signal, sys
import numpy
import estimator.cli.command_line
from estimator.__main__ import main
from estimator.body.arrays import Bodies
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.report.canvas import as_png, as_svg, new_axes
from tests.estimator.little_effort import little_effort
StaticsPhysics().read_bodies(Bodies.of([]), numpy.zeros(0))
PyBulletPhysics().close()
for draw in (as_png, as_svg):
    draw(new_axes()[0])
effort = little_effort()  # which holds as long as this name is there
effort.__enter__()
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
for line in sys.stdin:
    order = json.loads(line)
    child = os.fork()
    if not child:
        os.setsid()
        for stream in (1, 2):
            os.dup2(os.open(order["output"], os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream)
        sys.argv = ["estimator", *order["arguments"]]
        try:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            main()
        except SystemExit as end:
            os._exit(end.code or 0)
        except KeyboardInterrupt:
            os._exit(1)  # before the command had begun
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
RUNS = {
    "paper": ("topological", "paper", "--population", "4", "--generations", "2"),
    "posterior": ("parametric", "posterior"),
}
INTERRUPTIONS = 2  # at least, of each kind of run
SIGNALS = itertools.cycle((signal.SIGKILL, signal.SIGINT))
OF_ONE_RUN = 3  # then it is let be: on a machine that has become busy it would get nowhere


class Nursery:
    """Starts the ``estimator`` command quickly, one at a time."""

    def __init__(self, output: Path):
        self._output = output
        self._process = subprocess.Popen(
            [sys.executable, "-c", NURSERY],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )

    def start(self, *arguments: str | Path) -> int:
        """Its process id, and that of its process group."""
        assert self._process.stdin is not None
        self._output.write_text("")
        order = {"arguments": [str(item) for item in arguments], "output": str(self._output)}
        self._process.stdin.write(json.dumps(order).encode() + b"\n")
        return self._answer()

    def ends_within(self, seconds: float) -> bool:
        assert self._process.stdout is not None
        return bool(select.select([self._process.stdout], [], [], seconds)[0])

    def ended(self) -> tuple[int, str]:
        """Waits for the end; exit code and what was written."""
        return self._answer(), self._output.read_text()

    def close(self) -> None:
        for process in psutil.Process(self._process.pid).children(recursive=True):
            process.kill()  # what a test that failed has left
        self._process.communicate()

    def _answer(self) -> int:
        assert self._process.stdout is not None
        return int(self._process.stdout.readline())


@pytest.fixture(scope="module")
def nursery(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nursery]:
    found = Nursery(tmp_path_factory.mktemp("nursery") / "output")
    yield found
    found.close()


def content(directory: Path) -> dict[str, Any]:
    """All of a run that must not depend on interruptions."""
    found: dict[str, Any] = json.loads((directory / "result.json").read_text())
    for name in ("wall_seconds", "robot_uri", "robot", "problem_asked"):
        del found[name]
    with RunStore.open(directory, to_write=False) as store:
        found["errors"] = [item.errors for item in store.generations()]
        found["best"] = [item.best for item in store.generations()]
        found["summarised"] = [belief for belief, _ in store.posteriors()]
        observations = [item.observation for item in store.interactions()]
    assert None not in observations
    found["observed"] = [
        (item.angles, item.touch, item.tilt, item.clearance) for item in observations if item
    ]
    return found


def command(directory: Path, uri: str, kind: str) -> tuple[str | Path, ...]:
    if holds_run(directory):
        return "resume", directory, "--jobs", "1"
    problem, method, *options = RUNS[kind]
    return (
        *("identify", "--robot", uri, "--problem", problem, "--method", method, *options),
        *("--interactions", "2", "--seed", "8", "--jobs", "1", "--out", directory),
    )


def break_off(pid: int, number: signal.Signals) -> None:
    """As Ctrl-C in a terminal does, which all processes there hear; or as ``kill -9`` does."""
    with suppress(psutil.NoSuchProcess, ProcessLookupError):  # it has just ended by itself
        family = psutil.Process(pid).children(recursive=True)
        if number is signal.SIGINT:
            os.killpg(pid, number)
        else:
            os.kill(pid, number)
        _, left = psutil.wait_procs(family, timeout=120)
        assert not left


@pytest.mark.parametrize("kind", RUNS)
def test_a_run_broken_off_at_random_moments_ends_as_one_that_never_was(
    tmp_path: Path, nursery: Nursery, kind: str
) -> None:
    with simulator("--seed", "8") as robot:
        nursery.start("--help")  # once it has started, it is quick
        nursery.ended()
        began = time.monotonic()
        nursery.start(*command(tmp_path / "whole", robot.uri, kind))
        code, said = nursery.ended()
        lasts = time.monotonic() - began
    assert code == 0, said
    expected = content(tmp_path / "whole")

    interruptions, interaction = 0, 0
    while interruptions < INTERRUPTIONS:
        interaction += 1
        directory, code, broken = tmp_path / str(interaction), -1, 0
        with simulator("--seed", "8") as robot:
            while code != 0:
                pid = nursery.start(*command(directory, robot.uri, kind))
                if broken < OF_ONE_RUN and not nursery.ends_within(
                    random.uniform(0.0, 0.7 * lasts)
                ):
                    break_off(pid, next(SIGNALS))
                    broken += 1
                code, said = nursery.ended()
                assert code in (0, 1, -signal.SIGKILL), said
                # Python loses an interrupt that meets a finaliser, and says so; the run goes on.
                assert "Traceback" not in said.split("Exception ignored")[0]
        assert content(directory) == expected
        interruptions += broken
