"""Inertia is held against mass and size: what no link can have is replaced, and that is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_robot.world.body import Body, load_body, shipped_bodies
from sim_robot.world.urdf.declarations import (
    Box,
    Collision,
    Geometry,
    Inertia,
    Inertial,
    Link,
    Mass,
    Origin,
    Robot,
    text_of,
)
from sim_robot.world.urdf.inertia import mend_inertia
from tests.sim_robot.world.urdf.pieces import BASE, INERTIAL, LEG, LIMIT, joint, taken

HIP = joint("revolute", "base", "leg", LIMIT)


def with_inertia(folder: Path, xx: float, yy: float, zz: float, inside: str = "") -> Body:
    """A leg of 1 kg within 0.2 × 0.1 × 0.1 m."""
    tensor = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}"'
    leg = LEG.replace(INERTIAL, f'<inertial>{inside}<mass value="1"/>{tensor}/></inertial>')
    return taken(folder, BASE, leg, HIP)


def inertial(body: Body) -> Inertial:
    found = body.robot.links[1].inertial
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ((100, 100, 100), "has an inertia of 100 kg·m², and 1 kg within 245 mm cannot have more"),
        ((1, 1, 1), "cannot have more than 0.06"),
        ((3.3e5, 4.2e6, 4.2e6), "cannot have more than 0.06"),  # g·mm²
        ((0.001, 0.002, 0.0031), "no body's largest exceeds the sum of the others"),
        ((0, 0, 0), "has a mass and no inertia"),
    ],
)
def test_what_no_link_can_have_is_replaced_aloud(
    tmp_path: Path, moments: tuple[float, float, float], words: str
) -> None:
    body = with_inertia(tmp_path, *moments, '<origin xyz="0.01 0 0" rpy="0 0.3 0"/>')
    (note,) = body.notes
    assert note.startswith("link 'leg' ")
    assert words in note
    assert note.endswith("it is given that of a box of its size")
    given_instead = inertial(body)
    assert given_instead.inertia is not None
    assert np.diag(given_instead.inertia.matrix) == pytest.approx([1 / 600, 1 / 240, 1 / 240])
    assert (given_instead.origin.xyz, given_instead.origin.rpy) == ("0.01 0 0", "0 0 0")


def test_a_link_whose_file_says_no_inertia_has_that_of_a_box(tmp_path: Path) -> None:
    leg = LEG.replace(INERTIAL, '<inertial><mass value="1"/></inertial>')
    body = taken(tmp_path, BASE, leg, HIP)
    assert body.notes == (
        "link 'leg' has a mass and no inertia; it is given that of a box of its size",
    )
    assert inertial(body).inertia is not None


@pytest.mark.parametrize("moments", [(0.05, 0.05, 0.05), (0, 0.004, 0.004), (0.001, 0.002, 0.003)])
def test_what_a_link_can_have_stays(tmp_path: Path, moments: tuple[float, float, float]) -> None:
    body = with_inertia(tmp_path, *moments)
    assert body.notes == ()
    tensor = inertial(body).inertia
    assert tensor is not None
    assert np.diag(tensor.matrix) == pytest.approx(moments)


def test_bodies_that_ship_keep_theirs() -> None:
    assert all(load_body(path).notes == () for path in shipped_bodies().values())


LENGTHS = st.floats(0.02, 1)


@given(
    sides=st.tuples(LENGTHS, LENGTHS, LENGTHS),
    corner=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    mass=st.floats(1e-3, 10),
    seed=st.integers(0, 2**32 - 1),
)
def test_whatever_its_mass_is_like_within_its_shape_a_link_keeps_its_inertia(
    sides: tuple[float, float, float],
    corner: tuple[float, float, float],
    mass: float,
    seed: int,
) -> None:
    """Any points within the shape, with any share of the mass each."""
    random = np.random.default_rng(seed)
    points = random.uniform(size=(8, 3)) * sides + corner
    shares = random.dirichlet(np.full(8, 0.3)) * mass
    middle = shares @ points / mass
    arms = points - middle
    tensor = sum(
        share * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        for share, arm in zip(shares, arms, strict=True)
    )
    (xx, xy, xz), (_, yy, yz), (*_, zz) = np.asarray(tensor).tolist()
    inertia = Inertia(ixx=xx, ixy=xy, ixz=xz, iyy=yy, iyz=yz, izz=zz)
    shape = Collision(
        origin=Origin(xyz=text_of(np.add(corner, np.divide(sides, 2)))),
        geometry=Geometry(box=Box(size=text_of(sides))),
    )
    link = Link(
        name="leg",
        inertial=Inertial(
            origin=Origin(xyz=text_of(middle)), mass=Mass(value=mass), inertia=inertia
        ),
        collisions=[shape],
    )
    notes = list[tuple[str, str]]()
    mend_inertia(Robot(name="r", links=[link]), lambda *note: notes.append(note))
    assert notes == []
