"""The notebook runs, from its first cell to its last, and shows what its cells gave."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from tests.docs.notebooks import NOTEBOOK
from tests.free_ports import two_free_ports

TEXT = NOTEBOOK.read_text(encoding="utf-8")
RUN = """
import sys
from pathlib import Path
from tests.docs.notebooks import main
from tests.estimator.little_effort import little_effort
with little_effort():
    main(Path(sys.argv[1]))
"""


def code_cells(text: str) -> list[dict[str, Any]]:
    return [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]


def test_every_cell_runs(tmp_path: Path) -> None:
    port = two_free_ports()
    short = TEXT.replace("5750", str(port)).replace("interactions=6", "interactions=1")
    less = "explore=height, interactions=2, population=8, generations=2"
    copy = tmp_path / "notebook.ipynb"
    copy.write_text(short.replace("explore=height", less), encoding="utf-8")
    run = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", RUN, str(copy)],
        cwd=NOTEBOOK.parents[1],
        env=os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        process_group=0,
    )
    try:
        assert run.wait(600) == 0
    finally:
        with suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)  # with the robot that the notebook started
    again, shown = code_cells(copy.read_text(encoding="utf-8")), code_cells(TEXT)
    for new, old in zip(again, shown, strict=True):
        kinds = [[output["output_type"] for output in cell["outputs"]] for cell in (new, old)]
        assert kinds[0] == kinds[1]
    legs = "".join(again[2]["outputs"][0]["text"])
    assert re.findall(r"^hip_(\w+): on the ", legs, re.MULTILINE) == [
        *("left", "front", "right", "back")
    ]


def test_it_is_kept_as_it_was_run_and_small() -> None:
    cells = code_cells(TEXT)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert len(TEXT) < 60_000
    assert TEXT.count("image/png") == 1
