"""The box around a mesh, which stands for it: STL (both kinds), Wavefront OBJ and Collada."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
from lxml import etree
from numpy.typing import NDArray

Points: TypeAlias = NDArray[np.float64]

_HEADER = 84  # bytes of a binary STL before its triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_PACKAGE = "package://"


def find_mesh(filename: str, description: Path) -> Path | None:
    """The file of a mesh; ``None`` where there is none.

    A path in a ROS package is looked for beside the description and in the folders above it.

    Args:
        filename: As the description has it.
        description: The URDF file.
    """
    folder = description.resolve().parent
    name = filename.removeprefix("file://")
    if not filename.startswith(_PACKAGE):
        path = folder / name
        return path if os.path.isfile(path) else None
    inside = filename.removeprefix(_PACKAGE)
    for place in (folder, *folder.parents):
        for name in (inside, inside.partition("/")[2]):
            if os.path.isfile(place / name):
                return place / name
    return None


def box_of_mesh(path: Path, scale: Sequence[float]) -> tuple[Points, Points]:
    """Extents and middle of the box around a mesh, m.

    Args:
        path: An STL, OBJ or DAE file.
        scale: Of x, y and z.

    Raises:
        ValueError: It is no such file, or has no points.
        OSError: It cannot be read.
    """
    points = _points(path) * np.asarray(scale)
    if not len(points) or not np.isfinite(points).all():
        raise ValueError("has no points")
    low, high = points.min(axis=0), points.max(axis=0)
    return high - low, (low + high) / 2


def _points(path: Path) -> Points:
    kind, data = path.suffix.lower(), path.read_bytes()
    if kind == ".stl":
        count = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
        if len(data) == _HEADER + count * _TRIANGLE.itemsize:
            triangles = np.frombuffer(data, _TRIANGLE, count, _HEADER)
            return triangles["corners"].reshape(-1, 3).astype(float)
        return _numbers(data, b"vertex")
    if kind == ".obj":
        return _numbers(data, b"v")
    if kind == ".dae":
        return _of_collada(data)
    formats = ".stl, .obj or .dae"
    raise ValueError(f"is {kind or 'of no known format'}; write collision meshes as {formats}")


def _numbers(data: bytes, word: bytes) -> Points:
    """The three numbers after a word at the beginning of a line."""
    lines = (line.split() for line in data.splitlines())
    rows = [[float(number) for number in line[1:4]] for line in lines if line[:1] == [word]]
    return np.array(rows, dtype=float).reshape(-1, 3)


def _of_collada(data: bytes) -> Points:
    """The corners in a Collada scene, m; which axis it calls up is ignored, as ROS's tools do."""
    import collada  # noqa: PLC0415 - takes half a second, and few robots need it

    try:
        document = collada.Collada(io.BytesIO(data), ignore=[collada.DaeError])
        scene = () if document.scene is None else document.scene.objects("geometry")
        parts = [
            np.asarray(part.vertex)[np.unique(part.vertex_index)] @ shape.matrix[:3, :3].T
            + shape.matrix[:3, 3]
            for shape in scene
            for part in shape.original.primitives
            if part.vertex_index is not None and len(part.vertex_index)
        ]
    except (collada.DaeError, etree.XMLSyntaxError, AttributeError) as error:
        raise ValueError(f"is no Collada file: {error}") from error
    return np.concatenate([np.empty((0, 3)), *parts]) * (document.assetInfo.unitmeter or 1.0)
