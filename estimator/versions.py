"""The versions of everything that computes: the same numbers again need the same versions."""

from __future__ import annotations

import platform
from importlib import metadata


def versions() -> dict[str, str]:
    """Versions of everything that computes."""
    installed = {"python": platform.python_version()}
    for name in ("bodyschema", "numpy", "numba", "pybullet", "mujoco"):
        try:
            installed[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            installed[name] = "not installed"
    return installed
