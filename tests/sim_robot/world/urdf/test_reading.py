"""Files that are no URDF yet, or not as a whole: what they are is said, within bounds."""

from __future__ import annotations

import time
import tracemalloc
from pathlib import Path

import pytest

from sim_robot.errors import BodyError
from sim_robot.world.body import examine, load_body
from sim_robot.world.urdf.meshes import LFS_POINTER
from sim_robot.world.urdf.reading import LARGEST, MAX_ELEMENTS, MAX_WRITTEN
from tests.sim_robot.world.urdf.pieces import BASE, LEG, LIMIT, joint, taken, written

NAMESPACE = ' xmlns:xacro="http://www.ros.org/wiki/xacro"'
HIP = joint("revolute", "base", "leg", LIMIT)


@pytest.mark.parametrize(
    "inside",
    [
        f"<xacro:arm{NAMESPACE}/>{BASE}{LEG}{HIP}",
        f"<xacro:arm{NAMESPACE.replace('www.ros.org/wiki', 'ros.org')}/>{BASE}{LEG}{HIP}",
        f"<xacro:arm/>{BASE}{LEG}{HIP}",
        BASE + LEG.replace("<geometry>", f"<geometry{NAMESPACE}><xacro:foot/>") + HIP,
        BASE + LEG + HIP.replace("<axis", '<origin xyz="0 0 ${h}"/><axis'),
        BASE.replace("0.2 0.1 0.1", "${l} 0.1 0.1") + LEG + HIP,
        BASE + LEG.replace("box size", 'mesh filename="$(find it)/leg.stl" name') + HIP,
    ],
)
def test_xacro_that_was_not_expanded_is_told_as_what_it_is(tmp_path: Path, inside: str) -> None:
    (fault,) = examine(written(tmp_path, inside))[1]
    assert str(fault).endswith("is xacro, of which URDF is made first: xacro FILE > robot.urdf.")


def test_what_xacro_leaves_behind_is_harmless(tmp_path: Path) -> None:
    plugin = "<gazebo><plugin file='$(find it)/controllers.yaml'/></gazebo>"
    body = taken(tmp_path, BASE.replace("<link", f"<link{NAMESPACE}"), LEG, HIP, plugin)
    assert body.notes == ()


def test_what_many_elements_have_in_common_is_said_once(tmp_path: Path) -> None:
    names = [f"leg{number}" for number in range(8)]
    parts = [LEG.replace('"leg"', f'"{name}"') for name in names]
    limit = LIMIT.replace("effort", "efort")
    hips = [joint("revolute", "base", name, limit) for name in names]
    (fault,) = examine(written(tmp_path, BASE, *parts, *hips))[1]
    assert fault.reason == "is unknown; did you mean 'effort'?"
    light = [part.replace('mass value="1"', 'mass value="0"') for part in parts]
    hips = [joint("revolute", "base", name, LIMIT) for name in names]
    (fault,) = examine(written(tmp_path, BASE, *light, *hips))[1]
    others = ", ".join(f"'{name}'" for name in names[1:])
    assert fault.element == "link 'leg0'"
    assert fault.reason == f"needs <inertial> with a mass above 0; likewise {others}."


def test_a_git_lfs_pointer_is_told_as_one(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_bytes(LFS_POINTER + b"v1\noid sha256:0\nsize 30000\n")
    with pytest.raises(BodyError, match="is a Git LFS pointer, not the description"):
        load_body(file)


LINK = '<link name="a"/>'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (LINK * 400_000, f"has more than {LARGEST // 2**20} MiB"),
        ("<a/>" * (LARGEST // 4 - 100), f"has more than {MAX_ELEMENTS} elements"),
        (LINK * (MAX_WRITTEN + 1), f"must have at most 100 links, not {MAX_WRITTEN + 1}"),
        (HIP * (MAX_WRITTEN + 1), f"must have at most 100 joints, not {MAX_WRITTEN + 1}"),
    ],
)
def test_too_much_is_refused_before_it_is_worked_on(
    tmp_path: Path, text: str, sentence: str
) -> None:
    file = written(tmp_path, text)
    tracemalloc.start()
    begun = time.process_time()
    try:
        (fault,) = examine(file)[1]
        assert tracemalloc.get_traced_memory()[1] < 4 * LARGEST
    finally:
        tracemalloc.stop()
    assert sentence in str(fault)
    assert time.process_time() - begun < 5


def test_as_much_as_may_be_is_worked_on_in_seconds(tmp_path: Path) -> None:
    """Links without mass, each fixed to the one before: all of them are joined."""
    count = MAX_WRITTEN - 2
    links = "".join(f'<link name="l{number}"/>' for number in range(count))
    chain = "".join(joint("fixed", f"l{n}", f"l{n + 1}") for n in reversed(range(count - 1)))
    begun = time.process_time()
    body = taken(tmp_path, BASE, LEG, HIP, links, chain, joint("fixed", "leg", "l0"))
    assert [link.name for link in body.robot.links] == ["base", "leg"]
    assert time.process_time() - begun < 10


def test_an_endless_file_is_refused() -> None:
    with pytest.raises(BodyError, match="has more than 4 MiB"):
        load_body(Path("/dev/zero"))
