"""A package from elsewhere, as ``pip install`` leaves it: one module and its metadata."""

import re
import sys
from pathlib import Path

import pytest

_PAGE = (Path(__file__).parents[2] / "docs" / "physics.md").read_text(encoding="utf-8")
((PHYSICS, _TABLE),) = re.findall(r"```python\n(.*?)```.*?```toml\n(.*?)```", _PAGE, re.DOTALL)
"""The back-end that ``docs/physics.md`` shows."""

THUMB = re.sub(r'project\.entry-points\.|"', "", _TABLE)
"""Its entry point, as an installer writes it down."""


def install(
    folder: Path,
    entry_points: str,
    *,
    name: str = "bodyschema-thumb",
    version: str = "0.3",
    code: str = PHYSICS,
) -> Path:
    """Writes the package into a folder, which is to be on the path; returns the folder.

    Its one module is called as the package, with an underscore for the dash.
    """
    folder.mkdir(parents=True, exist_ok=True)
    module = name.replace("-", "_")
    (folder / f"{module}.py").write_text(code, "utf-8")
    information = folder / f"{module}-{version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", "utf-8"
    )
    (information / "entry_points.txt").write_text(entry_points, "utf-8")
    return folder


def put_on_path(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the packages of a folder be imported until the test ends, anew in each test."""
    for module in (path.stem for path in folder.glob("*.py")):
        monkeypatch.setitem(sys.modules, module, None)  # what was there comes back at the end
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.syspath_prepend(str(folder))
