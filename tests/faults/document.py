"""Writes ``docs/faults.csv``, the fault matrix: ``python -m tests.faults.document``."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.faults.devices import DEVICES
from tests.faults.matrix import NETWORK, PROCESSES, Row
from tests.faults.pi_devices import PI_DEVICES

CABLE = ("cut", "pulled")  # scenarios that belong to the network
FILE = Path(__file__).parents[2] / "docs" / "faults.csv"
HEADER = (
    "part",
    "fault",
    "how it is injected",
    "the robot",
    "its state",
    "the controller is told",
    "how it comes back",
)


def lines(part: str, rows: Iterable[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        told = row.words if row.code is None else f"{row.code}: …{row.words}…"
        yield part, row.fault, row.injected, row.does, row.state, told, row.back


def matrix() -> str:
    """The whole file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    for part, rows in {**DEVICES, **PI_DEVICES}.items():
        writer.writerows(lines(part, rows))
    writer.writerows(lines("Network", [*NETWORK, *(PROCESSES[name] for name in CABLE)]))
    rest = [row for name, row in PROCESSES.items() if name not in CABLE]
    writer.writerows(lines("Processes and computers", rest))
    return text.getvalue()


if __name__ == "__main__":
    FILE.write_text(matrix(), encoding="utf-8")
