"""What ``robotd`` costs and how quickly it answers while it slews, with 1 and with 50 viewers.

``python -m bench.latency``: the daemon in real time on still electronics, its servo board in
this process, the viewers in one other, the prober and a bare ROUTER echo in two more. A heartbeat
to the robot alternates with one to the echo, so both meet the same load; 10,000 are counted that a
moving robot answered.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from bench.daemons import Simulator, cpu_seconds, cpu_share, helper, simulator
from estimator.reproduction.tables import markdown
from protocol.transport.client import RobotClient
from sim_robot.electronics.sv203 import SV203Emulator

REQUESTS = 10_000
VIEWERS = (1, 50)
RATE = 10.0  # publications per second
IDLE_SECONDS = 20.0
LINE_GAP = 0.003  # s that the loop leaves between two lines
PHASE = 0.3  # s: between lines that are farther apart lies settling
BYTE_TIME = 10 / 9600  # s that a byte takes on the line
_MOVES_TWO = re.compile(r"SV\dM\d+SV\dM\d+\r")


def jitter(lines: Sequence[tuple[float, str]]) -> list[float]:
    """How much later than the line allows each next line was written, ms, ascending.

    Only pairs of full lines count: elsewhere the loop may have had nothing to send.
    """
    return sorted(
        1000 * (after - before - len(first) * BYTE_TIME - LINE_GAP)
        for (before, first), (after, second) in pairwise(lines)
        if after - before < PHASE and _MOVES_TWO.match(first) and _MOVES_TWO.match(second)
    )


@dataclass
class LatencyFigures:
    """What was measured with some viewers.

    Attributes:
        viewers: Number of viewers.
        robot: Round trips to the robot, ms, ascending.
        echo: Round trips to the bare echo, ms, ascending.
        jitter: How late the control loop wrote each line, ms, ascending.
        share: Share of one core while moving, %.
        idle_share: Share of one core while idle, %.
        memory: Resident memory, MB.
        seen: What the viewers say they saw.
    """

    viewers: int
    robot: list[float] = field(default_factory=list)
    echo: list[float] = field(default_factory=list)
    jitter: list[float] = field(default_factory=list)
    share: float = 0.0
    idle_share: float = 0.0
    memory: float = 0.0
    seen: str = ""


def percentile(ascending: Sequence[float], share: float) -> float:
    """The value below which a share of the values lies."""
    return ascending[min(len(ascending) - 1, int(share * len(ascending)))]


@contextmanager
def _moving(uri: str) -> Iterator[None]:
    """Has a controller send the robot from one end of its range to the other and back."""
    done = threading.Event()

    def run() -> None:
        with RobotClient(uri) as client:
            client.acquire()
            joints = client.capabilities.joints
            sign = 1
            while not done.is_set():
                client.perform({joint.name: sign * math.radians(70) for joint in joints})
                sign = -sign

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join(60)


def measure(viewers: int, requests: int, idle_seconds: float) -> LatencyFigures:
    """Does one run with so many viewers; returns what was measured."""
    outcome = LatencyFigures(viewers)
    board = SV203Emulator()
    try:
        with tempfile.TemporaryDirectory() as folder:
            times = Path(folder) / "times.json"
            _measure(outcome, board, times, requests, idle_seconds)
            outcome.jitter = jitter(json.loads(times.read_text(encoding="utf-8")))
    finally:
        board.close()
    return outcome


def _measure(
    outcome: LatencyFigures, board: SV203Emulator, times: Path, requests: int, idle_seconds: float
) -> None:
    options = ("--port", board.port, "--telemetry-rate", str(RATE), "--times", str(times))
    with (
        simulator(*options, module="bench.still_robotd") as robot,
        helper("bench.latency_peers", "echo") as echo,
        helper("bench.latency_peers", "view", robot.uri, str(outcome.viewers)) as watching,
    ):
        assert echo.stdout is not None
        assert watching.stdout is not None
        assert watching.stdin is not None
        mirror = echo.stdout.readline().strip()
        assert watching.stdout.readline() == "ready\n"
        outcome.idle_share = cpu_share(robot.process, idle_seconds)
        with _moving(robot.uri):
            _probe(robot, mirror, requests, outcome)
        outcome.memory = robot.process.memory_info().rss / 1e6
        watching.stdin.close()
        outcome.seen = watching.stdout.readline().strip()
        watching.stdin = None
        robot.terminate()  # at whose end it writes its times


def _probe(robot: Simulator, mirror: str, requests: int, outcome: LatencyFigures) -> None:
    cpu_before, start = cpu_seconds(robot.process), time.monotonic()
    completed = subprocess.run(
        [sys.executable, "-m", "bench.latency_peers", "probe", robot.uri, mirror, str(requests)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    spent, passed = cpu_seconds(robot.process) - cpu_before, time.monotonic() - start
    answers = json.loads(completed.stdout)
    outcome.robot, outcome.echo = sorted(answers["robot"]), sorted(answers["echo"])
    outcome.share = 100 * spent / passed


def table(outcomes: Sequence[LatencyFigures]) -> str:
    """Table of the figures, in Markdown."""
    heads = [f"{outcome.viewers} viewer{'s' * (outcome.viewers > 1)}" for outcome in outcomes]
    rows: list[list[str]] = []

    def row(name: str, *cells: str) -> None:
        rows.append([name, *cells])

    for label, attribute in (
        ("robotd, round trip", "robot"),
        ("bare ROUTER echo, round trip", "echo"),
        ("control loop, lateness", "jitter"),
    ):
        for name, share in (("p50", 0.5), ("p99", 0.99), ("largest", 1.0)):
            row(
                f"{label} {name}, ms",
                *(f"{percentile(getattr(outcome, attribute), share):.2f}" for outcome in outcomes),
            )
    row("lines timed", *(str(len(outcome.jitter)) for outcome in outcomes))
    row("CPU while slewing, % of a core", *(f"{outcome.share:.1f}" for outcome in outcomes))
    row("CPU while idle, % of a core", *(f"{outcome.idle_share:.2f}" for outcome in outcomes))
    row("resident memory, MB", *(f"{outcome.memory:.1f}" for outcome in outcomes))
    return markdown(["", *heads], rows)


def main() -> None:
    """Measures and prints the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.latency")
    parser.add_argument("--requests", type=int, default=REQUESTS)
    options = parser.parse_args()
    outcomes = [measure(count, options.requests, IDLE_SECONDS) for count in VIEWERS]
    print(table(outcomes))
    print()
    for outcome in outcomes:
        print(f"With {outcome.viewers}: {outcome.seen}.")
    load = os.getloadavg()[0]
    print(f"{os.cpu_count()} cores, load {load:.1f}, Python {platform.python_version()}.")


if __name__ == "__main__":
    main()
