"""The versions of everything that computes: a result is reproduced only with the same versions."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Final

_ROOT: Final = Path(__file__).parents[1]
_PACKAGES: Final = ("estimator", "protocol", "robot", "sim_robot")
_BENCH: Final = "bench"
_SOURCES: Final = (".py", ".toml", ".urdf")


@cache
def versions() -> dict[str, str]:
    """Version, by name, of everything that computes."""
    installed = {"python": platform.python_version()}
    for name in ("bodyschema", "numpy", "numba", "pybullet", "mujoco"):
        try:
            installed[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            installed[name] = "not installed"
    return installed


@cache
def code_digest() -> str:
    """A digest of our source and data files, as installed."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((_ROOT / package).rglob("*")):
            if path.suffix in _SOURCES:
                digest.update(str(path.relative_to(_ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def commit() -> str:
    """Names the code that runs: its commit, with a digest of the code if that was changed since.

    Where the code is not in a Git checkout of its own, the digest alone.
    """
    try:
        top, head = _git("rev-parse", "--show-toplevel", "--short=12", "HEAD").splitlines()
        changed = _git("status", "--porcelain", "--", *_PACKAGES, _BENCH)
    except (OSError, ValueError, subprocess.CalledProcessError):
        return f"code {code_digest()}"
    if Path(top) != _ROOT:
        return f"code {code_digest()}"
    return f"commit {head} with changes ({code_digest()})" if changed else f"commit {head}"


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", "-C", str(_ROOT), *arguments], check=True, capture_output=True, text=True
    ).stdout
