"""The box around a mesh, which stands for it: STL (both kinds), Wavefront OBJ and Collada.

A file is looked at before it is read: what is too large, cut short or no mesh at all ends in a
sentence that says which. STL and OBJ are read in pieces, so they take no memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from sim_robot.world.urdf.declarations import Points

LFS_POINTER: Final = b"version https://git-lfs.github.com/spec/"
"""Beginning of the text that stands for a large file that Git LFS did not fetch."""

LARGEST: Final = 100 * 2**20
"""Most bytes of a mesh: a million triangles, of which only the box around them is used."""

LARGEST_COLLADA: Final = 20 * 2**20
"""Most bytes of a Collada file, which is in memory as a whole, ten times as large."""

_HEADER_SIZE: Final = 84  # bytes of a binary STL before its triangles
_TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])
_BATCH_SIZE: Final = 10_000  # triangles, or lines
_PACKAGE_PREFIX: Final = "package://"


def find_mesh(filename: str, description: Path) -> Path | None:
    """The file of a mesh; ``None`` where there is none.

    A path in a ROS package is looked for beside the description and in the folders above it.

    Args:
        filename: Name of the mesh's file, as the description has it.
        description: The URDF file.
    """
    folder = description.resolve().parent
    name = filename.removeprefix("file://")
    if not filename.startswith(_PACKAGE_PREFIX):
        path = folder / name
        return path if path.is_file() else None
    package_path = filename.removeprefix(_PACKAGE_PREFIX)
    for parent in (folder, *folder.parents):
        for name in (package_path, package_path.partition("/")[2]):
            if (parent / name).is_file():
                return parent / name
    return None


def box_of_mesh(path: Path) -> NDArray[np.float64]:
    """Least and greatest coordinates of a mesh, in its own units, shape (2, 3).

    Args:
        path: An STL, OBJ or DAE file.

    Raises:
        ValueError: The file is none of these, is cut short, is too large, or has no points.
        OSError: The file cannot be read.
    """
    kind = path.suffix.lower()
    readers = {".stl": _stl, ".obj": _obj, ".dae": _collada}
    if kind not in readers:
        formats = ".stl, .obj or .dae"
        raise ValueError(f"is {kind or 'of no known format'}; write collision meshes as {formats}")
    size, limit = path.stat().st_size, LARGEST_COLLADA if kind == ".dae" else LARGEST
    if size > limit:
        raise ValueError(
            f"has {size / 2**20:.0f} MiB, and may have {limit / 2**20:.0f} at most: only the box "
            "around it is used, so write a coarser mesh for <collision>, or a box"
        )
    with path.open("rb") as file:
        if file.read(len(LFS_POINTER)) == LFS_POINTER:
            raise ValueError("is a Git LFS pointer, not the mesh: fetch it with git lfs pull")
        file.seek(0)
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for points in readers[kind](file, size):
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    if np.isnan(low).any() or (low == -np.inf).any() or (high == np.inf).any():
        raise ValueError("has a corner that is nowhere: not every coordinate is a finite number")
    if (low > high).any():
        raise ValueError("has no points")
    return np.stack([low, high])


def _stl(file: BinaryIO, size: int) -> Iterator[Points]:
    head = file.read(_HEADER_SIZE)
    count = int.from_bytes(head[_HEADER_SIZE - 4 :], "little") if len(head) == _HEADER_SIZE else 0
    expected = _HEADER_SIZE + count * _TRIANGLE.itemsize
    if size == expected:
        while triangles := min(count, _BATCH_SIZE):
            count -= triangles
            yield np.fromfile(file, _TRIANGLE, triangles)["corners"].reshape(-1, 3).astype(float)
    elif head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        file.seek(0)
        yield from _text_stl(file)
    elif expected > LARGEST:
        raise ValueError("is no STL file")
    elif size > expected:
        raise ValueError(f"has the wrong size: {size} bytes, and its triangles take {expected}")
    else:
        raise ValueError(f"is cut short: {size} of {expected} bytes")


def _text_stl(file: BinaryIO) -> Iterator[Points]:
    corners, last_word = 0, b""
    for lines in _batches(file):
        last_word = lines[-1][0]
        points = _numbers(lines, b"vertex")
        corners += len(points)
        if len(points):
            yield points
    if last_word != b"endsolid" or corners % 3:
        raise ValueError(f"is cut short: after {corners} corners it ends without 'endsolid'")


def _obj(file: BinaryIO, _: int) -> Iterator[Points]:
    has_faces = False
    for lines in _batches(file):
        has_faces = has_faces or any(line[0] in (b"f", b"l") for line in lines)
        points = _numbers(lines, b"v")
        if len(points):
            yield points
    if not has_faces:
        raise ValueError("has no faces: it is cut short, or no mesh")


def _batches(file: BinaryIO) -> Iterator[list[list[bytes]]]:
    """The words of lines that are not empty, many lines at once."""
    lines: list[list[bytes]] = []
    for line in file:
        words = line.split(maxsplit=4)
        if words:
            lines.append([words[0].lower(), *words[1:4]])
        if len(lines) == _BATCH_SIZE:
            yield lines
            lines = []
    if lines:
        yield lines


def _numbers(lines: list[list[bytes]], word: bytes) -> Points:
    """The three numbers after a word at the beginning of each line that has it, shape (n, 3)."""
    corners = []
    for line in lines:
        if line[0] == word:
            try:
                x, y, z = map(float, line[1:])
            except ValueError:
                text = b" ".join(line).decode(errors="replace")
                raise ValueError(f"is cut short or damaged: '{text:.60}' is no corner") from None
            corners.append((x, y, z))
    return np.array(corners, dtype=float).reshape(-1, 3)


def _collada(file: BinaryIO, _: int) -> Iterator[Points]:
    """The corners in a Collada scene, m; which axis it calls up is ignored, as ROS's tools do."""
    import collada  # noqa: PLC0415 - takes half a second, and few robots need it

    try:
        document = collada.Collada(file, ignore=[collada.DaeError])
        scene = () if document.scene is None else document.scene.objects("geometry")
        metres = document.assetInfo.unitmeter or 1.0
        for shape in scene:
            for primitive in shape.original.primitives:
                if primitive.vertex_index is not None and len(primitive.vertex_index):
                    corners = np.asarray(primitive.vertex)[np.unique(primitive.vertex_index)]
                    yield (corners @ shape.matrix[:3, :3].T + shape.matrix[:3, 3]) * metres
    except (collada.DaeError, etree.XMLSyntaxError, AttributeError) as error:
        raise ValueError(f"is no Collada file: {error}") from error
