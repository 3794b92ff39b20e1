"""A damaged description ends in a body or in sentences, whatever was damaged."""

from __future__ import annotations

import copy
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from sim_robot.world.body import examine, shipped_bodies

VALUES = ("", "nan", "x", "0 0", "1e999", "-1", "base", "0 0 0", "0.5")
TAGS = ("link", "joint", "limit", "origin", "mesh", "collision", "visual", "axis", "foo", "parent")
A_ROBOT_OF_OTHERS = """<robot name="r">
<link name="world"/>
<joint name="f" type="floating"><parent link="world"/><child link="base"/></joint>
<link name="base"/><joint name="t" type="fixed"><parent link="base"/><child link="trunk"/></joint>
<link name="trunk">
<inertial><mass value="4"/><inertia ixx=".01" iyy=".01" izz=".01"/></inertial>
<visual><geometry><box size="0.3 0.2 0.1"/></geometry></visual></link>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><axis xyz="0 1 0"/>
<origin xyz="0 0 -0.2"/><limit lower="-2.7" upper="-0.9" effort="0" current="3"/></joint>
<joint name="hip" type="continuous"><parent link="base"/><child link="thigh"/></joint>
<link name="thigh">
<inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01"/></inertial></link>
<link name="shank">
<inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01"/></inertial>
<collision><geometry><cylinder radius="0.01" length="0.2"/></geometry></collision></link>
<mujoco/></robot>"""
ORIGINALS = (A_ROBOT_OF_OTHERS, *(path.read_text() for path in shipped_bodies().values()))


def damaged(text: str, chance: random.Random) -> bytes:
    """The description with some elements and attributes gone, doubled, renamed or senseless."""
    root = etree.fromstring(text.encode())
    for _ in range(chance.randint(1, 6)):
        element = chance.choice([one for one in root.iter() if isinstance(one.tag, str)])
        parent, names = element.getparent(), sorted(element.attrib)
        kind = chance.randrange(5)
        if parent is None:
            continue
        if kind == 0:
            parent.remove(element)
        elif kind == 1:
            parent.append(copy.deepcopy(element))
        elif kind == 2:
            element.tag = chance.choice(TAGS)
        elif names and kind == 3:
            del element.attrib[chance.choice(names)]
        elif names:
            element.set(str(chance.choice(names)), chance.choice(VALUES))
    return etree.tostring(root)


def test_the_original_is_taken(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(A_ROBOT_OF_OTHERS)
    body, faults = examine(file)
    assert faults == ()
    assert body is not None
    assert (body.base, [motor.name for motor in body.motors]) == ("trunk", ["hip", "knee"])


@settings(deadline=None, max_examples=300)
@given(seed=st.integers(0, 2**32))
def test_it_is_a_body_or_it_has_faults(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    chance = random.Random(seed)
    file = tmp_path_factory.getbasetemp() / "damaged.urdf"
    file.write_bytes(damaged(chance.choice(ORIGINALS), chance))
    body, faults = examine(file)
    assert (body is None) == bool(faults)
    assert all(str(fault).startswith(str(file)) for fault in faults)
