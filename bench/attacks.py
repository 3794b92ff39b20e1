"""What attacks and sick drivers cost a daemon: memory, and how long another's ``stop`` waits.

``python -m bench.attacks``: for each attack a daemon of its own, in real time, on still
electronics; the attacker in another process, the client that stops in a third. Then SIGTERM, while
the attack goes on. Where the socket for faults is attacked, it tells how long a report waits.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import psutil

from bench.attackers import ATTACKS
from bench.daemons import Simulator
from bench.latency import percentile
from protocol.errors import RobotError
from protocol.transport.client import RobotClient
from sim_robot.faults.control_socket import FaultClient

SECONDS = 15.0
PAUSE = 0.02  # s between two stops
SICK: Final = {
    "hanging_driver": "servos.set_counts=hang",
    "dying_driver": "servos.set_counts=SystemExit",
}
"""What is wrong with the daemon's drivers, by attack."""
_ASKING = """
import json, sys, time
from bench.attacks import reports, stops
print("ready", flush=True)
sys.stdin.readline()
ask = reports if sys.argv[3] == "idle_faults" else stops
print(json.dumps(ask(sys.argv[1], float(sys.argv[2]))))
"""


@dataclass
class Outcome:
    """Measurements of one attack.

    Attributes:
        name: Name of the attack.
        before: Resident memory before the attack, MB.
        peak: Largest resident memory during the attack, MB.
        stops: How long each stop of another client took, ms, ascending.
        end: Time from SIGTERM until the daemon had ended, s.
        code: Exit status of the daemon.
    """

    name: str
    before: float = 0.0
    peak: float = 0.0
    stops: list[float] = field(default_factory=list)
    end: float = 0.0
    code: int | None = None


def stops(uri: str, seconds: float) -> list[float]:
    """Stops the robot again and again; returns how long each answer took, ms."""
    with RobotClient(uri, timeout=30.0) as client:

        def stop() -> None:
            try:
                client.stop()
            except RobotError as error:
                if error.code != "not_confirmed":
                    raise

        return _timed(stop, seconds)


def reports(control: str, seconds: float) -> list[float]:
    """Asks again and again which faults there are; returns how long each answer took, ms."""
    return _timed(FaultClient(control).report, seconds)


def _timed(ask: Callable[[], object], seconds: float) -> list[float]:
    trips = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        begun = time.perf_counter()
        ask()
        trips.append(1000 * (time.perf_counter() - begun))
        time.sleep(PAUSE)
    return trips


def measure(name: str, seconds: float) -> Outcome:
    """Measures one attack."""
    outcome = Outcome(name)
    sick = ("--sick", SICK[name]) if name in SICK else ()
    robot = Simulator("--control", *sick, module="bench.still_robotd")
    with RobotClient(robot.uri) as client:
        uri = robot.control if name == "idle_faults" else client.telemetry_endpoint
    asked_uri = robot.control if uri == robot.control else robot.uri
    asking = _started("-c", _ASKING, asked_uri, str(seconds), name)
    assert asking.stdout is not None
    asking.stdout.readline()
    outcome.before = robot.process.memory_info().rss / 1e6
    attacker = _started("-m", "bench.attackers", name, robot.uri, uri) if name != "none" else None
    if attacker is not None and attacker.stdout is not None:
        assert attacker.stdout.readline() == "under way\n"
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(robot.process, done, outcome))
    watcher.start()
    answer_times, _ = asking.communicate("go\n", timeout=seconds + 120)
    done.set()
    watcher.join()
    if asking.returncode == 0:
        outcome.stops = sorted(json.loads(answer_times))
    begun = time.monotonic()
    try:
        outcome.code, _ = robot.terminate(60)
    except subprocess.TimeoutExpired:
        robot.kill()
    outcome.end = time.monotonic() - begun
    if attacker is not None:
        attacker.kill()
        attacker.communicate()
    return outcome


def _started(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def _watch(victim: psutil.Process, done: threading.Event, outcome: Outcome) -> None:
    while not done.wait(0.02):
        try:
            outcome.peak = max(outcome.peak, victim.memory_info().rss / 1e6)
        except psutil.NoSuchProcess:
            return


def row(outcome: Outcome) -> str:
    """Formats one line of the table in Markdown."""
    stops = outcome.stops
    waits = [f"{percentile(stops, share):.1f}" if stops else "–" for share in (0.5, 0.99, 1.0)]
    cells = [
        outcome.name.replace("_", " "),
        f"{outcome.before:.0f}",
        f"{outcome.peak:.0f}",
        str(len(stops)),
        *waits,
        f"{outcome.end:.2f}",
        str(outcome.code),
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Measures, and prints a table."""
    parser = argparse.ArgumentParser(prog="python -m bench.attacks")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("attacks", nargs="*", default=["none", *ATTACKS])
    options = parser.parse_args()
    print(
        "| attack | MB before | MB at most | stops | p50, ms | p99 | longest | SIGTERM, s | exit |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in options.attacks:
        print(row(measure(name, options.seconds)), flush=True)
    print(f"\n{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}.")


if __name__ == "__main__":
    main()
