"""Meshes of other programs, taken as the box around them."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from sim_robot.errors import BodyError
from sim_robot.world.urdf.declarations import Box, vector
from sim_robot.world.urdf.meshes import LARGEST, LARGEST_COLLADA, LFS_POINTER
from tests.sim_robot.world.urdf.meshes import (
    CORNERS,
    NO_TRIANGLES,
    binary_stl,
    dae,
    obj,
    text_stl,
)
from tests.sim_robot.world.urdf.pieces import BASE, LEG, LIMIT, joint, taken


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.stl", binary_stl(CORNERS)),
        ("a.STL", text_stl(CORNERS)),
        ("a.obj", obj(CORNERS)),
        ("a.dae", dae(CORNERS)),
        ("empty_beside.dae", dae(CORNERS).replace(b"</mesh>", NO_TRIANGLES + b"</mesh>")),
    ],
)
@pytest.mark.parametrize("prefix", ["meshes/", "package://my_robot/meshes/", "file://meshes/"])
def test_a_mesh_is_taken_as_the_box_around_it(
    tmp_path: Path, name: str, content: bytes, prefix: str
) -> None:
    folder = tmp_path / "my_robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / name).write_bytes(content)
    mesh = f'mesh filename="{prefix}{name}" scale="2 2 1"'
    mesh = LEG.replace('box size="0.2 0.1 0.1"', mesh)
    body = taken(folder, BASE, mesh, joint("revolute", "base", "leg", LIMIT))
    (collision,) = body.robot.links[1].collisions
    assert isinstance(collision.geometry.shape, Box)
    assert vector(collision.geometry.shape.size) == pytest.approx((0.08, 0.02, 0.2), abs=1e-6)
    assert vector(collision.origin.xyz) == pytest.approx((0.02, 0.01, -0.1), abs=1e-6)
    assert body.notes[0].endswith(f"{name} is taken as the box around it, 80 × 20 × 200 mm")


def refusal(folder: Path, name: str, content: bytes, size: int = 0) -> str:
    """What is said of a mesh, which is filled up with nothing to a size."""
    with (folder / name).open("wb") as file:
        file.write(content)
        if size:
            file.truncate(size)
    leg = LEG.replace('box size="0.2 0.1 0.1"', f'mesh filename="{name}"')
    with pytest.raises(BodyError) as caught:
        taken(folder, BASE, leg, joint("revolute", "base", "leg", LIMIT))
    return str(caught.value).rpartition(f"{name} ")[2]


TEXT = text_stl(CORNERS)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.stl", LFS_POINTER + b"v1\noid sha256:0\n", "is a Git LFS pointer, not the mesh"),
        ("a.obj", LFS_POINTER + b"v1\noid sha256:0\n", "is a Git LFS pointer, not the mesh"),
        ("a.stl", binary_stl(CORNERS)[:-20], "is cut short: 114 of 134 bytes."),
        ("a.stl", binary_stl(CORNERS) + b"\0" * 4, "has the wrong size: 138 bytes, and its"),
        ("a.stl", b"solid".ljust(80, b"\0") + binary_stl(CORNERS)[80:-1], "is cut short: 133 of"),
        ("a.stl", bytes(84), "has no points."),
        ("a.stl", b"", "is cut short: 0 of 84 bytes."),
        ("a.stl", b"<!DOCTYPE html><html>" * 20, "is no STL file."),
        ("a.stl", TEXT.removesuffix(b"endsolid\n"), "is cut short: after 3 corners it ends"),
        ("a.stl", TEXT[: TEXT.index(b"endloop") - 6], "is cut short or damaged: 'vertex 0.0 0.01'"),
        ("a.stl", TEXT.replace(b"0.03", b"nan"), "has a corner that is nowhere"),
        ("a.stl", TEXT.replace(b"0.03", b"0,03"), "is cut short or damaged: 'vertex 0,03 0.0 0.0'"),
        ("a.stl", b"solid a\nendsolid a\n", "has no points."),
        ("a.obj", obj(CORNERS).removesuffix(b"f 1 2 3\n"), "has no faces: it is cut short"),
        ("a.obj", obj(CORNERS)[:11], "is cut short or damaged: 'v -0.01 0.0'"),
        ("a.obj", b"", "has no faces"),
        ("a.dae", dae(CORNERS)[:-200], "is no Collada file"),
        ("a.step", b"", "is .step; write collision meshes as .stl, .obj or .dae."),
    ],
)
def test_a_mesh_that_is_none_is_told_as_what_it_is(
    tmp_path: Path, name: str, content: bytes, sentence: str
) -> None:
    assert refusal(tmp_path, name, content).startswith(sentence)


@pytest.mark.parametrize(
    ("name", "size"),
    [("a.stl", 2 * 2**30), ("a.obj", LARGEST + 1), ("a.dae", LARGEST_COLLADA + 1)],
)
def test_a_mesh_that_is_too_large_is_not_read(tmp_path: Path, name: str, size: int) -> None:
    content = bytes(80) + (2**25).to_bytes(4, "little")
    tracemalloc.start()
    try:
        assert "only the box around it is used" in refusal(tmp_path, name, content, size)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()


def test_a_large_mesh_is_read_in_pieces(tmp_path: Path) -> None:
    count = 100_000
    triangles = binary_stl(CORNERS)[84:] * count
    (tmp_path / "a.stl").write_bytes(bytes(80) + count.to_bytes(4, "little") + triangles)
    leg = LEG.replace('box size="0.2 0.1 0.1"', 'mesh filename="a.stl"')
    arm = leg.replace('"leg"', '"arm"')
    joints = joint("revolute", "base", "leg", LIMIT), joint("revolute", "base", "arm", LIMIT)
    tracemalloc.start()
    try:
        body = taken(tmp_path, BASE, leg, arm, *joints)
        assert tracemalloc.get_traced_memory()[1] < len(triangles)
    finally:
        tracemalloc.stop()
    assert body.notes[0].endswith("as the box around it, 40 × 10 × 200 mm; likewise 'arm'")
