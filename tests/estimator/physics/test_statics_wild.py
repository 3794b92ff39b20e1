"""Statics on bodies that nobody would build: no crash, no hang, and every pose an equilibrium."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.body.morphology import BASE, Array, Base, Morphology, Part, PartShape
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.statics import StaticsPhysics
from estimator.readings.observation import PredictedReadings
from tests.estimator.kinematics import part_frames

STATICS = StaticsPhysics(WorldSettings(clearance_cap=1e9))
BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
LENGTHS = (0.0, 1e-9, 0.006, 0.05, 0.2, 30.0)
RADII = (1e-6, 0.006, 0.05, 2.0)
SHAPES: tuple[PartShape, ...] = ("capsule", "box")
ANGLES = (0.0, -0.0, math.pi, -math.pi, math.pi / 2, -1e-9, 6.5)


@st.composite
def wild_pairs(draw: st.DrawFn) -> Pair:
    """Coincident, vanishing, gigantic and locked parts, at round angles and at others."""
    count = draw(st.integers(0, 9))
    parts = tuple(
        Part(
            parent=draw(st.integers(BASE, index - 1)),
            mount=draw(st.integers(0, 3)),
            hinge=draw(st.integers(0, 5)),
            length=draw(st.sampled_from(LENGTHS) | st.floats(0, 1)),
            radius=draw(st.sampled_from(RADII)),
            motor=draw(st.sampled_from((None, index))),
            sensor=index,
            shape=draw(st.sampled_from(SHAPES)),
        )
        for index in range(count)
    )
    base = Base(
        size=draw(st.tuples(*[st.sampled_from((1e-6, 0.085, 0.14, 3.0))] * 3)),
        mass=draw(st.sampled_from((1e-6, 1.0, 1e6))),
    )
    body = Morphology(base=base, parts=parts, density=draw(st.sampled_from((1e-6, 1e3, 1e6))))
    angle = st.sampled_from(ANGLES) | st.floats(-math.pi, math.pi)
    return body, np.array(draw(st.lists(angle, min_size=count, max_size=count)))


CORNERS = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T


def ends(body: Morphology, program: Array) -> Array:
    """Near and far ends of each part's axis in the body frame, m, shape (parts, 2, 3)."""
    origins, rotations = part_frames(body, program)
    along = np.array([(part.near, part.far) for part in body.parts])
    both: Array = origins[:, None, :] + along.reshape(-1, 2, 1) * rotations[:, None, :, 0]
    return both


def spheres(body: Morphology, program: Array) -> tuple[Array, Array]:
    """Centres and radii of the spheres whose hull the body is, m, shapes (n, 3) and (n,)."""
    _, rotations = part_frames(body, program)
    centres, radii = [CORNERS * body.base.size], [np.zeros(8)]
    for part, turn, two in zip(body.parts, rotations, ends(body, program), strict=True):
        box = part.shape == "box"
        centres.append(two.mean(axis=0) + CORNERS * part.size @ turn.T if box else two)
        radii.append(np.zeros(8) if box else np.full(2, part.radius))
    return np.concatenate(centres), np.concatenate(radii)


def support(body: Morphology, program: Array, up: Array) -> tuple[float, float]:
    """Depth of the lowest point, and how far the centre of mass lies inside the contacts' hull.

    Worked out from the parts' positions alone, by trying every direction in the ground plane.
    """
    points, radii = spheres(body, program)
    middles = ends(body, program).mean(axis=1)
    centre = (body.masses @ middles) / (body.masses.sum() + body.base.mass)
    below = radii - points @ up
    touching = points[below >= below.max() - 1e-6 * (1 + np.abs(points).max())]
    across = np.linalg.svd(up[None])[2][1:]
    flat = (touching - centre) @ across.T
    directions = np.linspace(0, 2 * np.pi, 721)
    reaches = flat @ np.stack([np.cos(directions), np.sin(directions)])
    return float(below.max()), float(reaches.max(axis=0).min())


def assert_rests(body: Morphology, program: Array, felt: PredictedReadings) -> None:
    """The centre of mass is over the contacts, and clearance and touch are those of the pose."""
    x, y = np.sin(felt.tilt[0, 1]), np.sin(felt.tilt[0, 0])
    z = math.sqrt(max(0.0, 1 - x * x - y * y))
    size = 1 + np.abs(ends(body, program)).max(initial=0.0)
    poses = [np.array([x, y, z]), np.array([x, y, -z])]  # tilt cannot tell upside down
    margins = [support(body, program, up)[1] for up in poses]
    assert max(margins) > -1e-5 * size
    if not felt.saturated[0] and z > 0.01:  # beyond, tilt does not tell z well enough
        depth = support(body, program, poses[0])[0]
        expected = max(0.0, depth - z * body.base.size[2] / 2) / z
        assert felt.clearance[0] == pytest.approx(expected, rel=1e-5, abs=1e-5 * size / z)


@settings(max_examples=250)
@given(pair=wild_pairs())
def test_any_body_comes_to_rest(pair: Pair) -> None:
    body, program = pair
    felt = STATICS.read([pair])
    assert np.isfinite(felt.tilt).all()
    assert np.isfinite(felt.joint_miss).all()
    assert 0 <= felt.clearance[0] <= 1e9
    if felt.valid[0] and not felt.joint_miss[0]:
        assert_rests(body, program, felt)
    margin = STATICS.path_margins([pair])[0]
    assert 0 <= margin <= math.atan(0.5)


def test_ordinary_bodies_are_never_given_up() -> None:
    rng = np.random.default_rng(20)
    pairs = []
    for _ in range(400):
        parts = tuple(
            Part(
                parent=int(rng.integers(BASE, index)),
                mount=int(rng.integers(4)),
                hinge=int(rng.integers(6)),
                length=float(rng.uniform(0, 0.4)),
                radius=float(rng.choice([0.006, 0.013])),
                motor=index,
                shape=SHAPES[index % 2],
            )
            for index in range(8)
        )
        body = Morphology(base=BODY, parts=parts, density=1000.0)
        pairs.append((body, rng.uniform(-math.pi, math.pi, 8)))
    felt = STATICS.read(pairs)
    assert felt.valid.all()
    for row, (body, program) in enumerate(pairs):
        assert_rests(body, program, felt[row : row + 1])


@pytest.mark.parametrize("density", [1e-6, 1e6])
def test_all_the_mass_may_be_in_one_part(density: float) -> None:
    """A body of feathers with a heavy main body, and a feather with one heavy leg."""
    leg = Part(parent=BASE, mount=1, hinge=2, length=0.4, radius=0.01, motor=0, sensor=0)
    body = Morphology(base=BODY, parts=(leg,), density=density)
    for degrees in (-180, -90, -20, 0, 20, 90, 180):
        program = np.radians([float(degrees)])
        felt = STATICS.read([(body, program)])
        assert felt.valid.all()
        assert_rests(body, program, felt)
    heavy = density > 1
    lying = STATICS.read([(body, np.zeros(1))])
    assert bool(lying.touch[0, 0]) == heavy  # it tips over the front edge onto the leg
    assert (lying.tilt[0, 1] < -0.05) == heavy


def test_hundreds_of_parts() -> None:
    rng = np.random.default_rng(21)
    chain = tuple(
        Part(
            parent=index - 1,
            mount=1,
            hinge=int(rng.integers(6)),
            length=0.02,
            radius=0.004,
            motor=index,
            sensor=0 if index == 299 else None,
        )
        for index in range(300)
    )
    bush = tuple(
        replace(part, parent=int(rng.integers(BASE, index)), mount=int(rng.integers(4)))
        for index, part in enumerate(chain)
    )
    program = rng.uniform(-0.5, 0.5, 300)
    pairs = [
        (Morphology(base=BODY, parts=parts, density=1000.0), program) for parts in (chain, bush)
    ]
    STATICS.read(pairs[:1])
    start = time.monotonic()
    felt = STATICS.read(pairs)
    STATICS.path_margins(pairs)
    assert time.monotonic() - start < 30
    assert felt.valid.all()
    for row, (body, angles) in enumerate(pairs):
        assert_rests(body, angles, felt[row : row + 1])


def test_coincident_parts_are_one() -> None:
    """Ten parts in one place touch in one point, and stand like one."""
    leg = Part(parent=BASE, mount=3, hinge=2, length=0.2, radius=0.006, motor=0, sensor=0)
    one = Morphology(base=BODY, parts=(leg,), density=1e-6)
    many = replace(one, parts=tuple(replace(leg, motor=index, sensor=index) for index in range(10)))
    program = np.radians([-40.0] * 10)
    single, tenfold = STATICS.read([(one, program)]), STATICS.read([(many, program)])
    assert tenfold.tilt == pytest.approx(single.tilt, abs=1e-9)
    assert tenfold.touch.all()
    assert single.touch.all()
