"""Writes bodies as URDF files, so that what reads URDF can be held to our own kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from estimator.body.morphology import Morphology
from estimator.report.export.description import describe
from estimator.report.export.formats import urdf
from protocol.wire.capabilities import Joint


def write_urdf(path: Path, body: Morphology, names: Sequence[str | None]) -> Path:
    """Writes a body.

    Args:
        path: The file.
        body: The body.
        names: Name of the joint of each part; ``None`` for a fixed one.
    """
    described = describe(
        body,
        robot="tree",
        parts=[f"part_{row}" for row in range(len(names))],
        carried=[None if name is None else row for row, name in enumerate(names)],
        joints=[
            Joint(name=name or f"none_{row}", lower=-3, upper=3, speed=1, resolution=0)
            for row, name in enumerate(names)
        ],
    )
    path.write_text(urdf(described), encoding="utf-8")
    return path
