"""The commands ``robotd``, ``sim-robotd`` and ``estimator``, under a name that is ours alone.

``robot`` is also the name of Robot Framework's package: pip writes both into one folder, and which
of them was installed last has its files there. So each command first looks whose the packages are
that it needs, without importing any, and says so in a sentence where they are not ours.

Ctrl-C ends a command in a sentence from here on. Before, while Python starts and imports this
module, it still ends in Python's traceback; with ``python -m``, until the first packages are there.
"""

from __future__ import annotations

import importlib
import sys
from importlib.util import find_spec
from pathlib import Path

__all__ = ["estimator", "robotd", "sim_robotd"]


def robotd() -> int:
    """Runs ``robotd``; returns its exit code."""
    return _run("robotd", "", "robot", "protocol", "robot")


def sim_robotd() -> int:
    """Runs ``sim-robotd``; returns its exit code."""
    return _run("sim-robotd", "sim", "sim_robot", "protocol", "robot", "sim_robot")


def estimator() -> int:
    """Runs ``estimator``; returns its exit code."""
    return _run("estimator", "estimator", "estimator", "protocol", "estimator")


def _run(command: str, extra: str, package: str, *needed: str) -> int:
    try:
        for name in needed:
            if problem := _not_ours(name):
                print(f"{command}: {problem}", file=sys.stderr)
                return 1
        try:
            main = importlib.import_module(f"{package}.__main__").main
        except ModuleNotFoundError as error:  # what the package needs before anything else
            lacking = importlib.import_module("protocol.system.missing_library").lacking
            return int(lacking(command, extra, error))
        return int(main() or 0)
    except KeyboardInterrupt:
        print(f"{command}: interrupted", file=sys.stderr)
        return 1


def _not_ours(package: str) -> str | None:
    """A sentence where a package is missing or somebody else's; each of ours names bodyschema."""
    found = find_spec(package)
    remedy = (
        "Install bodyschema into a virtual environment of its own (python3 -m venv), and into "
        "this one, if it is to stay here, again"
    )
    if found is None or found.origin is None:
        return f"the package {package} is missing or lacks its files. {remedy}."
    if b"bodyschema" in Path(found.origin).read_bytes():
        return None
    return f"the package {package} at {found.origin} is {_owner(package)}. {remedy}."


def _owner(package: str) -> str:
    metadata = importlib.import_module("importlib.metadata")  # only here, as it takes long
    for one in metadata.distributions():
        if one.name != "bodyschema" and any(
            file.as_posix() == f"{package}/__init__.py" for file in one.files or ()
        ):
            return f"that of {one.name} {one.version}, which has the same name"
    return "not bodyschema's"
