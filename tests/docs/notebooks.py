"""Runs the cells of a notebook, without Jupyter, and keeps what they print and draw.

``python -m tests.docs.notebooks`` runs docs/first-identification.ipynb in an empty folder and
writes its outputs into it; that takes some minutes.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from matplotlib.figure import Figure

NOTEBOOK: Final = Path(__file__).parents[2] / "docs" / "first-identification.ipynb"
_DPI: Final = 70


def run_cells(notebook: dict[str, Any]) -> None:
    """Runs a notebook's code in this process as ``__main__``, and replaces its outputs."""
    names = vars(sys.modules["__main__"])
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(code, 1):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            value = _run("".join(cell["source"]), names)
        cell["execution_count"] = number
        cell["outputs"] = []
        if printed.getvalue():
            text = printed.getvalue().splitlines(keepends=True)
            cell["outputs"].append({"output_type": "stream", "name": "stdout", "text": text})
        if value is not None:
            cell["outputs"].append(_output(value, number))


def _run(source: str, names: dict[str, Any]) -> object:
    """Runs a cell; returns the value of the expression that it ends with, if it does."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if not isinstance(last, ast.Expr):
        return None
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def _output(value: object, number: int) -> dict[str, Any]:
    data: dict[str, Any] = {"text/plain": [repr(value)]}
    if isinstance(value, Figure):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=_DPI)
        data["image/png"] = base64.b64encode(picture.getvalue()).decode()
    return {
        "output_type": "execute_result",
        "execution_count": number,
        "metadata": {},
        "data": data,
    }


def main(path: Path) -> None:
    """Runs a notebook in an empty folder and writes its outputs into it."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    here = Path.cwd()
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            run_cells(notebook)
        finally:
            os.chdir(here)
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve() if sys.argv[1:] else NOTEBOOK)
