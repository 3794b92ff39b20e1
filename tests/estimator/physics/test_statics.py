"""Resting poses against geometry done by hand, against symmetry and against PyBullet."""

import math
import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.body.arrays import Bodies, Integers
from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.errors import MorphologyError, PhysicsError
from estimator.physics.base import WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import PACE, StaticsPhysics
from estimator.readings.observation import PredictedReadings
from tests.estimator.kinematics import part_frames
from tests.estimator.physics.four_legs import (
    BELLY,
    BODY,
    MakeBody,
    legs,
    plate,
    plate_lean,
    random_pairs,
)

SURE = math.radians(8)


@pytest.fixture(scope="module")
def statics() -> Iterator[StaticsPhysics]:
    with StaticsPhysics() as physics:
        yield physics


def read_one(physics: StaticsPhysics, body: Morphology, *degrees: float) -> PredictedReadings:
    return physics.read([(body, np.radians(degrees))])


def assert_same(one: PredictedReadings, two: PredictedReadings) -> None:
    for item in fields(PredictedReadings):
        assert np.array_equal(getattr(one, item.name), getattr(two, item.name)), item.name


@pytest.mark.parametrize("radius", [0.006, 0.013])
@pytest.mark.parametrize("pieces", [1, 2])
@pytest.mark.parametrize("length", [0.11, 0.35])
def test_four_equal_legs_lift_the_body_level(
    statics: StaticsPhysics, length: float, pieces: int, radius: float
) -> None:
    body = legs(length, radius=radius, pieces=pieces)
    felt = read_one(statics, body, -30, -30, -30, -30)
    lift = (length - radius) * math.sin(math.radians(30)) + radius - BELLY
    assert felt.clearance == pytest.approx([lift], abs=1e-9)
    assert felt.tilt == pytest.approx(np.zeros((1, 2)), abs=1e-9)
    assert felt.touch.all()
    assert felt.valid.all()
    assert not (felt.undecided | felt.saturated | felt.touch_doubtful).any()
    assert felt.speed.tolist() == [0.0]


@pytest.mark.parametrize("turn", [0.0, 0.1, 1.0, 2.5])
def test_a_plate_on_one_leg_rests_on_its_rim(statics: StaticsPhysics, turn: float) -> None:
    """Plane geometry, and nothing but the curve of the rim keeps it from falling to a side."""
    lean, clearance = plate_lean()
    felt = read_one(statics, plate(turn), -90)
    left, ahead = np.sin(felt.tilt[0])
    assert math.asin(math.hypot(left, ahead)) == pytest.approx(lean, abs=1e-5)
    assert math.atan2(left, ahead) == pytest.approx(turn, abs=math.radians(0.2))
    assert felt.clearance == pytest.approx([clearance], abs=1e-5)
    assert felt.valid.all()
    assert not felt.undecided.any()


def test_a_plate_lies_where_any_lean_would_lift_its_centre_of_mass(
    statics: StaticsPhysics, random_tree: MakeBody
) -> None:
    rng = np.random.default_rng(3)
    rims = 0
    for _ in range(60):
        tree = random_tree(rng)
        base = replace(tree.base, size=(0.14, 0.14, 0.03), round=True)
        body = replace(
            tree, base=base, parts=tuple(replace(part, shape="capsule") for part in tree.parts)
        )
        program = rng.uniform(-0.6, 0.6, 8)
        felt = statics.read([(body, program)])
        x, y = np.sin(felt.tilt[0])[::-1]
        if felt.saturated[0] or felt.undecided[0]:
            continue  # who knows whether it lies on its back, and balanced it may stay
        up = np.array([x, y, math.sqrt(1 - x * x - y * y)])
        rest, bears = height(body, program, up)
        rims += bears
        for turn in np.arange(16) * math.pi / 8:
            aside = np.cross(up, [math.cos(turn), math.sin(turn), 0.3])
            lifted, _ = height(body, program, up + 0.01 * aside / np.linalg.norm(aside))
            assert lifted > rest
    assert rims > 10


def height(body: Morphology, program: Array, up: Array) -> tuple[float, bool]:
    """Of the centre of mass over the ground, m, and whether the round main body bears."""
    up = up / np.linalg.norm(up)
    places, turns = part_frames(body, program)
    moment, below = np.zeros(3), -math.inf
    for part, place, turn, mass in zip(body.parts, places, turns, body.masses, strict=True):
        moment += mass * (place + part.middle * turn[:, 0])
        for end in (part.near, part.far):
            below = max(below, part.radius - float(up @ (place + end * turn[:, 0])))
    rim = body.base.radius * math.hypot(up[0], up[1]) + body.base.size[2] / 2 * abs(up[2])
    return max(rim, below) + float(up @ moment) / body.mass, rim > below - 1e-6


def test_raised_legs_leave_the_body_flat(statics: StaticsPhysics) -> None:
    felt = read_one(statics, legs(0.1, 0.2, 0.3, 0.4), 30, 10, 20, 0)
    assert felt.clearance.tolist() == [0.0]
    assert felt.tilt.tolist() == [[0.0, 0.0]]
    assert not (felt.touch | felt.undecided).any()


@pytest.mark.parametrize(("leg", "tilt"), [(0, (1, 0)), (1, (0, 1)), (2, (-1, 0)), (3, (0, -1))])
@pytest.mark.parametrize("down", [25, 60])
def test_one_leg_pushes_its_side_up(
    statics: StaticsPhysics, leg: int, tilt: tuple[int, int], down: float
) -> None:
    """The body rests on the leg's tip and on the opposite lower edge: plane geometry."""
    program, length, radius = [30.0] * 4, 0.15, 0.006
    program[leg] = -down
    felt = read_one(statics, legs(length, radius=radius), *program)
    turn = math.radians(down)
    along = 0.07 + (length - radius) * math.cos(turn) + 0.07  # edge to centre of the tip's sphere
    below = (length - radius) * math.sin(turn) - BELLY
    angle = math.atan2(below, along) + math.asin(radius / math.hypot(along, below))
    assert felt.tilt[0] == pytest.approx(angle * np.array(tilt), abs=1e-9)
    assert felt.clearance[0] == pytest.approx(0.07 * math.tan(angle), abs=1e-9)
    assert felt.touch[0].tolist() == [side == leg for side in range(4)]


def test_gaps_decide_touch_and_doubt(statics: StaticsPhysics) -> None:
    """Three legs stand; the fourth is shorter by a gap that a real gauge may or may not feel."""
    for gap, touch, doubtful in ((0.0004, True, True), (0.0015, False, True), (0.01, False, False)):
        body = legs(0.1 - gap, 0.1, 0.1, 0.1)
        heavy_right = Part(parent=BASE, mount=2, hinge=2, length=0.05, radius=0.02)
        felt = read_one(statics, replace(body, parts=(*body.parts, heavy_right)), *[-90.0] * 4)
        assert felt.touch[0].tolist() == [touch, True, True, True]
        assert felt.touch_doubtful[0].tolist() == [doubtful, False, False, False]


def test_clearance_is_capped(statics: StaticsPhysics) -> None:
    felt = read_one(statics, legs(0.3), *[-90.0] * 4)
    assert felt.clearance.tolist() == [0.2]
    assert felt.saturated.all()


def test_a_body_may_start_above_its_belly(statics: StaticsPhysics) -> None:
    """Parts thicker than the main body carry it from the start."""
    felt = read_one(statics, legs(0.2, radius=0.05), 0, 0, 0, 0)
    assert felt.clearance == pytest.approx([0.05 - BELLY])
    assert felt.touch.all()


def test_a_body_that_topples_comes_to_lie_on_its_side(statics: StaticsPhysics) -> None:
    """A heavy part high up, then carried beyond the edge: the tall body falls over that edge."""
    mast = Part(parent=BASE, mount=0, hinge=2, length=0.35, radius=0.02, motor=0)
    tall = Morphology(base=Base(size=(0.1, 0.1, 0.4), mass=0.2), parts=(mast,), density=5000.0)
    felt = read_one(statics, tall, 0)
    assert felt.tilt[0, 0] == pytest.approx(-math.atan2(0.2, 0.3 + 0.05), abs=0.15)
    assert felt.valid.all()


def test_balance_on_two_feet_is_undecided(statics: StaticsPhysics) -> None:
    """Level on two opposite feet nothing decides; half a degree more of one leg does."""
    body = legs(0.3, 0.3, 0.3, 0.3)
    balanced = read_one(statics, body, -20, 10, -20, 10)
    assert balanced.undecided.tolist() == [True]
    assert balanced.tilt[0] == pytest.approx([0, 0], abs=1e-9)  # the rule: it stays there
    assert balanced.touch[0].tolist() == [True, False, True, False]
    decided = read_one(statics, body, -20, 10, -20, 10.5)
    assert decided.undecided.tolist() == [False]
    assert decided.valid.all()
    assert abs(math.degrees(decided.tilt[0, 1])) > 10
    assert statics.path_margins([(body, np.radians([-20, 10, -20, 10.0]))])[0] == 0


def test_the_path_margin_is_the_inclination_that_topples(statics: StaticsPhysics) -> None:
    for width, height in ((0.06, 0.4), (0.02, 0.4), (0.3, 2.0)):
        base = Base(size=(width, 4.0, height), mass=1.0)
        bare = Morphology(base=base, parts=(), density=1000.0)
        topples = math.atan(width / height)
        (margin,) = statics.path_margins([(bare, np.zeros(0))])
        assert topples / 1.25 < margin <= topples
    (flat,) = statics.path_margins([(legs(0.1), np.zeros(4))])
    assert flat == pytest.approx(math.atan(0.5))  # the steepest that is tried


def test_no_larger_path_margin_is_told_than_was_asked_for(
    statics: StaticsPhysics, random_tree: MakeBody
) -> None:
    bodies, programs = zip(*random_pairs(random_tree, 300, seed=5), strict=True)
    arguments = Bodies.of(bodies), np.array(programs)
    whole = statics.path_margins_of_bodies(*arguments)
    for degrees in (2.0, 10.0):
        most = math.radians(degrees)
        capped = statics.path_margins_of_bodies(*arguments, most)
        assert capped.min() < capped.max() == most
        # each is known to a fifth
        assert np.mean((capped == most) == (whole >= most)) > 0.97
        below = (capped < most) & (whole < most) & (whole > 0)
        assert np.all(np.abs(np.log(capped[below] / whole[below])) < 2 * math.log(1.2))


def test_joints_get_no_farther_than_their_time_allows(statics: StaticsPhysics) -> None:
    """300 steps at 60 degrees per second are 300 degrees."""
    body = replace(legs(0.1), base=replace(BODY, size=(0.4, 0.4, 0.4)))
    late, there = read_one(statics, body, 310, 0, 0, 0), read_one(statics, body, 300, 0, 0, 0)
    assert np.degrees(late.joint_miss) == pytest.approx([10])
    assert (late.valid[0], there.valid[0]) == (False, True)
    assert np.array_equal(late.tilt, there.tilt)
    slow = StaticsPhysics(WorldSettings(steps=10))
    assert np.degrees(read_one(slow, body, 30, 0, 0, 0).joint_miss) == pytest.approx([20])


def mirrored(body: Morphology) -> Morphology:
    """Left and right exchanged: yaw and roll turn the other way, pitch does not."""
    return replace(
        body,
        parts=tuple(
            replace(part, mount=(2, 1, 0, 3)[part.mount], hinge=(1, 0, 2, 3, 5, 4)[part.hinge])
            for part in body.parts
        ),
    )


def turned(body: Morphology) -> Morphology:
    """Everything on the square main body moved from left to front, from front to right …"""
    return replace(
        body,
        parts=tuple(
            replace(part, mount=(part.mount + 1) % 4) if part.parent == BASE else part
            for part in body.parts
        ),
    )


def test_mirrored_and_turned_bodies_rest_alike(
    statics: StaticsPhysics, random_tree: MakeBody
) -> None:
    pairs = random_pairs(random_tree, 300, seed=8)
    sure = statics.path_margins(pairs) > math.radians(1)
    assert sure.mean() > 0.9
    felt = statics.read(pairs)
    mirror = statics.read([(mirrored(body), program) for body, program in pairs])
    turn = statics.read([(turned(body), program) for body, program in pairs])
    for other, tilt in (
        (mirror, felt.tilt * [-1, 1]),
        (turn, np.column_stack([-felt.tilt[:, 1], felt.tilt[:, 0]])),
    ):
        assert other.tilt[sure] == pytest.approx(tilt[sure], abs=1e-6)
        assert other.clearance[sure] == pytest.approx(felt.clearance[sure], abs=1e-6)
        assert np.array_equal(other.touch[sure], felt.touch[sure])


def test_only_shares_of_mass_matter(statics: StaticsPhysics, random_tree: MakeBody) -> None:
    pairs = random_pairs(random_tree, 100, seed=9)
    heavy = [
        (replace(body, base=replace(BODY, mass=8 * BODY.mass), density=8 * body.density), program)
        for body, program in pairs
    ]
    assert_same(statics.read(pairs), statics.read(heavy))


def test_a_part_of_fourfold_density_is_as_heavy_as_four_in_its_place(
    statics: StaticsPhysics,
) -> None:
    """Where they touch nothing: the mass of one raised leg decides which way the body tips."""
    body = legs(0.15, 0.15, 0.15, 0.25)
    raised = [replace(body.parts[1], motor=motor, sensor=None) for motor in range(4, 8)]
    one = Bodies.of([replace(body, parts=(*body.parts, raised[0]))])
    four = Bodies.of([replace(body, parts=(*body.parts, *raised))])
    density = one.density.copy()
    density[0, 4] *= 4  # the other front leg stays as it is
    program = np.radians([-30, 10, -30, *[10] * 5])
    light, heavy, several = (
        statics.read_bodies(bodies, program) for bodies in (one, one.changed(density=density), four)
    )
    assert heavy.tilt == pytest.approx(several.tilt, abs=1e-12)
    assert heavy.clearance == pytest.approx(several.clearance, abs=1e-12)
    assert np.degrees(np.abs(heavy.tilt - light.tilt)).max() > 5


def test_a_larger_robot_rests_like_a_small_one(
    statics: StaticsPhysics, random_tree: MakeBody
) -> None:
    pairs = random_pairs(random_tree, 200, seed=10)
    sure = statics.path_margins(pairs) > math.radians(1)
    small = statics.read(pairs)
    large = StaticsPhysics(WorldSettings(clearance_cap=1.0, touch_gap=5e-3)).read(
        [
            (
                Morphology(
                    base=Base(size=(0.7, 0.7, 0.425), mass=125.0),
                    parts=tuple(
                        replace(part, length=5 * part.length, radius=5 * part.radius)
                        for part in body.parts
                    ),
                    density=body.density,
                ),
                program,
            )
            for body, program in pairs
        ]
    )
    assert large.tilt[sure] == pytest.approx(small.tilt[sure], abs=1e-5)
    assert large.clearance[sure] == pytest.approx(5 * small.clearance[sure], abs=1e-5)
    assert np.array_equal(large.touch[sure], small.touch[sure])


@pytest.fixture(scope="module")
def agreement(
    statics: StaticsPhysics, random_quadruped: MakeBody, random_tree: MakeBody
) -> dict[str, tuple[PredictedReadings, PredictedReadings, Array]]:
    """Readings of 30 bodies of a kind by both back-ends, and the path margins."""
    by_kind = {}
    with PyBulletPhysics(WorldSettings(steps=1200, step=1 / 240, full_steps=True)) as engine:
        for kind, make, motors in (("quadrupeds", random_quadruped, 4), ("trees", random_tree, 8)):
            pairs = random_pairs(make, 30, seed=12, motors=motors)
            by_kind[kind] = (statics.read(pairs), engine.read(pairs), statics.path_margins(pairs))
    return by_kind


@pytest.mark.parametrize(("kind", "share"), [("quadrupeds", 0.86), ("trees", 0.93)])
def test_poses_are_those_of_a_simulation(
    agreement: dict[str, tuple[PredictedReadings, PredictedReadings, Array]],
    kind: str,
    share: float,
) -> None:
    """Quadrupeds 94 % and trees 98 %, of a thousand; here less whatever chance may do to 30.

    What differs is where a body's momentum decides; those poses have a small path margin.
    """
    own, simulated, margins = agreement[kind]
    assert simulated.valid.all()
    assert not simulated.undecided.any()  # a simulation always ends somewhere
    away = np.degrees(np.max(np.abs(own.tilt - simulated.tilt), axis=1))
    alike = away < 0.5
    assert alike.mean() >= share
    assert alike[margins > SURE].mean() >= 0.98
    assert (margins > SURE).mean() > 0.7
    assert np.median(away) < 0.01
    assert np.abs(own.clearance - simulated.clearance)[alike].max() < 2e-3
    doubtful = (own.touch_doubtful | simulated.touch_doubtful)[alike]
    same = (own.touch == simulated.touch)[alike] | doubtful
    assert same.mean() > 0.99


@pytest.mark.parametrize("jobs", [2, 3, 7])
def test_threads_do_not_show_in_the_result(
    statics: StaticsPhysics, random_tree: MakeBody, jobs: int
) -> None:
    pairs = random_pairs(random_tree, 900, seed=13)
    with StaticsPhysics(jobs=jobs) as many:
        assert_same(many.read(pairs), statics.read(pairs))
        assert np.array_equal(many.path_margins(pairs), statics.path_margins(pairs))
        assert many.steps > many.simulations == 900


def test_a_reading_depends_on_its_own_pair_only(
    statics: StaticsPhysics,
    random_tree: MakeBody,
    random_quadruped: MakeBody,
    random_tree_of_own_tables: MakeBody,
) -> None:
    """Not on who is in the lanes beside it, nor on how many are: 1 to 17 for 8 lanes."""
    rng = np.random.default_rng(14)
    bare = Morphology(base=replace(BODY, size=(0.3, 0.1, 0.05)), parts=(), density=1.0)
    kinds = (random_tree, random_quadruped, random_tree_of_own_tables, lambda _: bare)
    bodies = Bodies.of([kinds[row % 4](rng) for row in range(34)])
    programs = rng.uniform(-0.6, 0.6, (34, bodies.motors))
    lean = rng.normal(0, 0.1, (34, 2)) * (np.arange(34) % 3 > 0)[:, None]

    def read(rows: Integers, coarse_step: bool) -> PredictedReadings:
        return statics.read_bodies(
            bodies[rows], programs[rows], lean[rows], coarse_step=coarse_step
        )

    margins = statics.path_margins_of_bodies(bodies, programs)
    for coarse_step in (False, True):
        rows = np.arange(34)
        alone = PredictedReadings.concatenate(read(rows[[row]], coarse_step) for row in rows)
        for count in range(1, 18):
            some = rng.permutation(34)[:count]
            assert_same(read(some, coarse_step), alone[some])
            if not coarse_step:
                theirs = statics.path_margins_of_bodies(bodies[some], programs[some])
                assert np.array_equal(theirs, margins[some])


def test_round_and_square_bodies_read_together_as_each_does_alone(
    statics: StaticsPhysics, random_quadruped: MakeBody
) -> None:
    rng = np.random.default_rng(5)
    pairs = [(random_quadruped(rng), rng.uniform(-0.5, 0.5, 4)) for _ in range(40)]
    pairs = [
        (replace(body, base=replace(body.base, round=bool(row % 2))), program)
        for row, (body, program) in enumerate(pairs)
    ]
    together = statics.read(pairs)
    for row, pair in enumerate(pairs):
        assert_same(together[np.array([row])], statics.read([pair]))


def test_bodies_rest_again_as_those_that_are_nearly_the_same(
    statics: StaticsPhysics,
    random_tree: MakeBody,
    random_quadruped: MakeBody,
    random_tree_of_own_tables: MakeBody,
) -> None:
    """Where it is known on what, at once; where they cannot rest so, as from flat."""
    rng, count = np.random.default_rng(17), 240
    kinds = (random_tree, random_quadruped, random_tree_of_own_tables)
    bodies = Bodies.of([kinds[row % 3](rng) for row in range(count)])
    programs = rng.uniform(-0.6, 0.6, (count, bodies.motors))

    def read(near: Bodies, stances: Integers | None = None) -> tuple[PredictedReadings, int]:
        before = statics.steps
        return statics.read_bodies(near, programs, stances=stances), statics.steps - before

    first, _ = read(bodies)
    sure = first.stance >= 0
    assert sure.mean() > 0.95
    assert np.ptp(first.stance[sure]) > 0
    for near in (bodies, bodies.changed(length=1.001 * bodies.length)):
        (from_flat, dear), (again, cheap) = read(near), read(near, first.stance)
        assert cheap < 0.15 * dear
        likely = statics.path_margins_of_bodies(near, programs) > math.radians(0.5)
        assert likely.mean() > 0.8
        assert again.tilt[likely] == pytest.approx(from_flat.tilt[likely], abs=1e-9)
        assert again.clearance[likely] == pytest.approx(from_flat.clearance[likely], abs=1e-9)
        assert np.array_equal(again.touch[likely], from_flat.touch[likely])
    assert_same(read(bodies, np.full(count, -1))[0], first)
    others, _ = read(bodies, np.roll(first.stance, 3))
    assert others.valid.all()
    assert_same(read(bodies, np.full(count, 2**48 - 1))[0], first)  # of which no body has points


def test_one_program_serves_many_bodies(
    statics: StaticsPhysics, random_quadruped: MakeBody
) -> None:
    rng = np.random.default_rng(15)
    bodies, program = [random_quadruped(rng) for _ in range(20)], np.radians([-20, 5, -9, 30])
    felt = statics.read_bodies(Bodies.of(bodies), program)
    assert_same(felt, statics.read([(body, program) for body in bodies]))


def test_what_is_followed_together_lands_as_each_does_alone(
    statics: StaticsPhysics, random_tree: MakeBody
) -> None:
    """Rows of one body in one program share its joints' turns, under whatever gravity."""
    rng = np.random.default_rng(16)
    several = Bodies.of([random_tree(rng) for _ in range(40)])
    programs = rng.uniform(-0.5, 0.5, (2, several.motors))
    ways = 18  # more than are followed at once
    body, program, lean = (
        one.ravel() for one in np.meshgrid(range(40), range(2), range(ways), indexing="ij")
    )
    gravity_tilts = rng.normal(0, 0.1, (ways, 2)) * (np.arange(ways) % 3 > 0)[:, None]
    together = statics.read_bodies(several[body], programs[program], gravity_tilts[lean])
    for row in range(0, len(body), 7):
        alone = statics.read_bodies(
            several[body[row : row + 1]], programs[program[row]], gravity_tilts[lean[row]]
        )
        assert_same(together[np.array([row])], alone)


def test_work_is_counted() -> None:
    """Of 20 steps five are taken at once as long as the body lies flat: the foot lands after 16."""
    fresh = StaticsPhysics()
    fresh.read([(legs(0.1), np.radians([-30, 0, 0, 0]))] * 5)
    assert (fresh.simulations, fresh.steps) == (5, 5 * len([0, 5, 10, 15, 20, 16, 17, 18, 19, 20]))
    fresh.close()
    fresh.close()


def test_bad_batches_are_refused(statics: StaticsPhysics) -> None:
    body = legs(0.1)
    for angle, other in ((math.nan, 0), (math.inf, 0), (math.inf, -math.inf)):
        with pytest.raises(PhysicsError, match="a motor program must be finite"):
            read_one(statics, body, angle, other, 0, 0)
    with pytest.raises(MorphologyError, match="one angle per motor"):
        read_one(statics, body, 0, 0, 0)
    with pytest.raises(PhysicsError, match=r"equally many touch sensors, not \[0, 4\]"):
        statics.read([(body, np.zeros(4)), (replace(body, parts=()), np.zeros(4))])
    with pytest.raises(PhysicsError, match=r"2 bodies of 4 motors .* not an array of shape \(3,\)"):
        statics.read_bodies(Bodies.of([body] * 2), np.zeros(3))
    with pytest.raises(PhysicsError, match=r"not an array of shape \(3, 4\)"):
        statics.path_margins_of_bodies(Bodies.of([body] * 2), np.zeros((3, 4)))
    with pytest.raises(PhysicsError, match=r"2 bodies need as many stances .* shape \(3,\)"):
        statics.read_bodies(Bodies.of([body] * 2), np.zeros(4), stances=np.zeros(3, dtype=int))
    with pytest.raises(PhysicsError, match="at least one thread, not 0"):
        StaticsPhysics(jobs=0)
    for pace in (0.0, 2 * PACE, math.nan):
        with pytest.raises(PhysicsError, match=r"above 0 and at most 0\.026 rad"):
            StaticsPhysics(pace=pace)


def test_nothing_and_no_parts_can_be_read(statics: StaticsPhysics) -> None:
    assert len(statics.read([])) == 0
    assert len(statics.path_margins([])) == 0
    assert len(statics.read_bodies(Bodies.of([]), np.zeros(0))) == 0
    felt = read_one(statics, Morphology(base=BODY, parts=(), density=1.0))
    assert (felt.clearance[0], felt.valid[0]) == (0.0, True)


PROGRAM = """
from estimator.physics.kernel.compiling import announced, entrance

@entrance
def twice(number):
    return 2 * number

with announced():
    print(twice(1.5))
"""


def start(folder: Path, before: str = "") -> subprocess.Popen[str]:
    """A program that calls a compiled function, whose machine code is kept in its folder."""
    (folder / "program.py").write_text(PROGRAM)
    return subprocess.Popen(
        [sys.executable, "-c", f"{before}\nimport program"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={
            **os.environ,
            "NUMBA_CACHE_DIR": str(folder),
            "PYTHONPATH": f"{folder}:{Path.cwd()}",
        },
    )


def test_the_pause_of_the_first_use_is_explained_once(tmp_path: Path) -> None:
    """Also where two programs begin at the same time: one compiles, and the other waits for it."""
    both = [start(tmp_path) for _ in range(2)]
    printed, spoken = zip(*(process.communicate(timeout=300) for process in both), strict=True)
    assert printed == ("3.0\n", "3.0\n")
    silent, sentence = sorted(spoken)
    assert silent == ""
    assert sentence.count("\n") == 1
    assert "Compiling the statics kernel" in sentence
    (data,), (index,) = tmp_path.rglob("*.nbc"), tmp_path.rglob("*.nbi")
    for damaged in (data, index, None):  # what is damaged is made anew, and then kept
        if damaged is not None:
            damaged.write_bytes(b"\x80")
        result, said = start(tmp_path).communicate(timeout=300)
        assert result == "3.0\n"
        assert said == ("" if damaged is None else sentence)


def test_a_full_cache_is_gone_without(tmp_path: Path) -> None:
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, -1))"
    printed, spoken = start(tmp_path, full).communicate(timeout=300)
    assert printed == "3.0\n"
    assert f"Compiled code cannot be kept in {tmp_path}" in spoken
    assert "(File too large)" in spoken
    assert "Traceback" not in spoken


class WeakServos(StaticsPhysics):
    """A back-end that a user derives."""

    def __init__(self, settings: WorldSettings, *, jobs: int = 1) -> None:
        super().__init__(settings, jobs=jobs, pace=PACE / 2)
        self.share = 1.0

    def read_bodies(self, bodies: Bodies, programs: Array, *how: Any, **options: Any) -> Any:
        return super().read_bodies(bodies, self.share * programs, *how, **options)


def test_a_copy_in_another_process_is_of_the_same_class_with_its_counts(
    random_tree: MakeBody,
) -> None:
    pairs = random_pairs(random_tree, 6, seed=10)
    with WeakServos(WorldSettings(clearance_cap=0.1), jobs=2) as physics:
        physics.share = 0.5
        expected = physics.read(pairs)
        with pickle.loads(pickle.dumps(physics)) as copy:
            assert (type(copy), copy.simulations) == (WeakServos, 6)
            assert np.array_equal(copy.read(pairs).tilt, expected.tilt)
            assert np.array_equal(copy.read(pairs).clearance, expected.clearance)
