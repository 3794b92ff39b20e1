"""What the live page costs a search: the same searches with and without ``--live``, in turn.

Somebody looks at the page all the while: a client that takes in whatever it is sent. Readings are
recorded ones, so no robot's time is in it. A search is timed by the run itself (``wall_seconds``,
from the first interaction on); CPU is that of the whole process, that of the page included.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import threading
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from bench.simulation_cost import workload
from estimator.readings import readings_csv

AIM: Final = 0.05
SEARCHES: Final = {
    "paper, statics, 600 models": "--method paper --physics statics --population 600",
    "posterior, 2 interactions": "--method posterior --interactions 2",
}
_ROBOT: Final = {"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6}


class Cost(NamedTuple):
    """Wall-clock time and CPU time of one run, s."""

    wall: float
    cpu: float


def write_readings(folder: Path) -> Path:
    """Writes nine interactions as a table; returns its path."""
    _, _, observations = workload()
    joints = [f"joint_{number}" for number in range(len(observations[0].angles))]
    readings_csv.write(folder / "readings.csv", joints, observations)
    (folder / "robot.json").write_text(json.dumps(_ROBOT), encoding="utf-8")
    return folder / "readings.csv"


def look_at(uri: str) -> None:
    """Receives all that a page sends, until it ends."""
    protocol = f"viser-v{viser.__version__}"
    try:
        with connect(
            uri.replace("http", "ws", 1), origin=Origin(uri), subprotocols=[Subprotocol(protocol)]
        ) as socket:
            for _ in socket:
                pass
    except (ConnectionClosed, OSError):
        return


def search(readings: Path, run: Path, options: str, *, live: bool) -> Cost:
    """Runs one search as a process; returns its cost."""
    command = f"--robot file:{readings} --problem topological --seed 1 --out {run} {options}"
    page = "--live --live-bind 127.0.0.1:0" if live else ""
    process = subprocess.Popen(
        [sys.executable, "-m", "estimator", "identify", *command.split(), *page.split()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    with process.stderr:
        for line in process.stderr:
            if at := re.search(r"live page is at (\S+)", line):
                threading.Thread(target=look_at, args=(at[1],), daemon=True).start()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"estimator ended with {process.returncode}")
    result = json.loads((run / "result.json").read_text("utf-8"))
    return Cost(result["wall_seconds"], used.ru_utime + used.ru_stime)


def main(repeats: int) -> None:
    """Measures and prints the ratios, which takes some minutes."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        readings = write_readings(folder)
        for title, options in SEARCHES.items():
            costs: dict[bool, list[Cost]] = {False: [], True: []}
            for number in range(2 * repeats):
                live = bool(number % 2)
                run = folder / f"{len(title)}-{number}"
                cost = search(readings, run, options, live=live)
                print(f"  live={live}: {cost.wall:.1f} s, CPU {cost.cpu:.1f} s", flush=True)
                costs[live].append(cost)
            without, with_page = (
                Cost(*(statistics.median(column) for column in zip(*costs[live], strict=True)))
                for live in (False, True)
            )
            print(
                f"{title}: {without.wall:.1f} s, with the live page {with_page.wall:.1f} s: "
                f"{100 * (with_page.wall / without.wall - 1):+.1f} % (aim: below "
                f"{100 * AIM:.0f} %); CPU {without.cpu:.1f} s and {with_page.cpu:.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3, help="searches of each kind")
    main(parser.parse_args().repeats)
