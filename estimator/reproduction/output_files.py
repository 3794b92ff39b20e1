"""The files of one figure: picture, table and numbers, each written as a whole or not at all."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from protocol.system.files import replace_file, replace_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI: Final = 150


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table; ``None`` becomes an empty cell."""

    def write(fresh: Path) -> None:
        with fresh.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows(rows)

    replace_file(path, write)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Numbers for programs."""
    replace_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def write_png(path: Path, figure: Figure) -> None:
    """A picture; the version of Matplotlib does not enter it."""
    replace_file(path, lambda fresh: figure.savefig(fresh, dpi=_DPI, metadata={"Software": None}))
