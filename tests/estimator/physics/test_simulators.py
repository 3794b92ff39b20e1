"""What every simulator must read: geometry that can be done by hand, and joints that hold."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.body.mounts import BaseMount, Hinge, PartMount
from estimator.errors import PhysicsError
from estimator.physics.base import Pair, Physics, WorldSettings
from estimator.physics.mujoco import MuJoCoPhysics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import PredictedReadings
from tests.estimator.physics.four_legs import (
    BELLY,
    BODY,
    RIGHT_ANGLE,
    MakeBody,
    legs,
    plate,
    plate_lean,
    random_pairs,
    read_one,
)

Engine: TypeAlias = type[PyBulletPhysics | MuJoCoPhysics]
ENGINES: dict[str, Engine] = {"pybullet": PyBulletPhysics, "mujoco": MuJoCoPhysics}


@pytest.fixture(scope="module", params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Engine:
    pytest.importorskip(request.param)
    return ENGINES[request.param]


@pytest.fixture(scope="module")
def physics(engine: Engine) -> Iterator[Physics]:
    with engine() as simulator:
        yield simulator


def test_bad_batches_are_refused(physics: Physics) -> None:
    with pytest.raises(PhysicsError, match="must be finite"):
        read_one(physics, legs(0.1), math.nan, 0, 0, 0)
    blind = replace(legs(0.1), parts=())
    with pytest.raises(PhysicsError, match=r"equally many touch sensors, not \[0, 4\]"):
        physics.read([(legs(0.1), np.zeros(4)), (blind, np.zeros(4))])


def test_a_body_at_zero_lies_flat(physics: Physics) -> None:
    felt = read_one(physics, legs(0.22), 0, 0, 0, 0)
    assert felt.tilt == pytest.approx(np.zeros((1, 2)), abs=1e-4)
    assert felt.clearance == pytest.approx([0.0], abs=1e-4)
    assert not felt.touch.any()
    assert felt.speed == pytest.approx([0.0], abs=1e-4)
    assert felt.valid.all()


def test_thick_legs_carry_the_body_at_zero(physics: Physics) -> None:
    felt = read_one(physics, legs(0.22, radius=0.05), 0, 0, 0, 0)
    assert felt.clearance == pytest.approx([0.05 - BELLY], abs=1e-4)
    assert felt.touch.all()


def test_a_plate_on_one_leg_rests_on_its_rim(physics: Physics) -> None:
    """Nothing but the curve of the rim keeps it from falling to a side."""
    # Bullet keeps contacts of a moment ago, which hold a rim that rolls.
    rolled = math.radians(3.0 if isinstance(physics, PyBulletPhysics) else 0.1)
    for turn in (0.0, 0.3):
        lean, clearance = plate_lean()
        felt = read_one(physics, plate(turn), -RIGHT_ANGLE)
        left, ahead = np.sin(felt.tilt[0])
        assert math.asin(math.hypot(left, ahead)) == pytest.approx(lean, abs=math.radians(0.1))
        assert math.atan2(left, ahead) == pytest.approx(turn, abs=rolled)
        assert felt.clearance == pytest.approx([clearance], abs=3e-4)


@pytest.mark.parametrize("radius", [0.006, 0.013])
@pytest.mark.parametrize("pieces", [1, 2])
@pytest.mark.parametrize("length", [0.08, 0.19])
def test_standing_legs_lift_the_belly_by_their_length(
    physics: Physics, radius: float, pieces: int, length: float
) -> None:
    """Whatever the radius: a leg is as long as the way from its joint to its tip."""
    felt = read_one(physics, legs(length, radius=radius, pieces=pieces), *[-RIGHT_ANGLE] * 4)
    assert felt.clearance == pytest.approx([length - BELLY], abs=2e-4)
    assert felt.touch.all()
    assert not felt.touch_doubtful.any()
    assert felt.tilt == pytest.approx(np.zeros((1, 2)), abs=1e-3)


def test_clearance_is_capped(physics: Physics) -> None:
    felt = read_one(physics, legs(0.29), *[-RIGHT_ANGLE] * 4)
    assert felt.clearance == pytest.approx([0.2])
    assert felt.saturated.all()


@pytest.mark.parametrize(("leg", "tilt"), [(0, (1, 0)), (1, (0, 1)), (2, (-1, 0)), (3, (0, -1))])
def test_one_leg_pushes_its_side_up(physics: Physics, leg: int, tilt: tuple[int, int]) -> None:
    """The body rests on the leg's tip and on the opposite lower edge: plane geometry."""
    program, length, radius, down = np.zeros(4), 0.1, 0.006, math.radians(60)
    program[leg] = -down
    felt = read_one(physics, legs(length, radius=radius), *program)
    along = 0.07 + (length - radius) * math.cos(down) + 0.07  # edge to centre of the tip's sphere
    below = (length - radius) * math.sin(down) - BELLY
    angle = math.atan2(below, along) + math.asin(radius / math.hypot(along, below))
    assert felt.tilt[0] == pytest.approx(angle * np.array(tilt), abs=1e-3)
    assert felt.clearance[0] == pytest.approx(0.07 * math.tan(angle), abs=2e-4)
    assert felt.touch[0].tolist() == [side == leg for side in range(4)]


def test_joints_hold_their_angles(
    physics: Physics, random_quadruped: MakeBody, random_tree: MakeBody
) -> None:
    """With the true inertia of such light parts, joints miss by whole degrees."""
    quadrupeds = physics.read(random_pairs(random_quadruped, 30, seed=1, motors=4))
    trees = physics.read(random_pairs(random_tree, 30, seed=2))
    for felt in (quadrupeds, trees):
        assert np.degrees(felt.joint_miss).max() < 0.1
        assert felt.valid.all()
        assert np.isfinite(felt.tilt).all()


@pytest.mark.parametrize(("scale", "mass"), [(0.5, 0.1), (1.0, 3.0), (3.0, 27.0)])
def test_joints_hold_their_angles_in_robots_of_any_size(
    physics: Physics,
    random_quadruped: MakeBody,
    random_tree: MakeBody,
    scale: float,
    mass: float,
) -> None:
    def sized(pair: Pair) -> Pair:
        body, program = pair
        base = Base(size=(0.14 * scale, 0.14 * scale, 0.085 * scale), mass=mass)
        parts = (
            replace(part, length=part.length * scale, radius=part.radius * scale)
            for part in body.parts
        )
        return replace(body, base=base, parts=tuple(parts)), program

    pairs = random_pairs(random_quadruped, 15, seed=3, motors=4)
    felt = physics.read([sized(pair) for pair in pairs])
    assert np.degrees(felt.joint_miss).max() < 0.1
    felt = physics.read([sized(pair) for pair in random_pairs(random_tree, 15, seed=4)])
    assert np.degrees(felt.joint_miss).max() < 0.1


def test_a_joint_that_misses_makes_the_reading_invalid(physics: Physics) -> None:
    felt = read_one(physics, legs(0.1, hinge=4), math.radians(310), 0, 0, 0)
    assert not felt.valid[0]  # 300 steps at 60 degrees per second are 300 degrees
    assert np.degrees(felt.joint_miss[0]) == pytest.approx(10, abs=1.1)


def test_v_is_the_speed_of_a_body_that_is_not_at_rest(engine: Engine) -> None:
    with engine(WorldSettings(steps=40)) as short:
        felt = read_one(short, legs(0.2), *[-RIGHT_ANGLE] * 4)
    assert felt.speed[0] > 0.05
    assert not felt.valid[0]


def test_touch_is_doubtful_just_above_the_ground(physics: Physics) -> None:
    """Three legs stand; the fourth is shorter by a gap that a real gauge may or may not feel."""
    for gap, touch, doubtful in (
        (0.0004, True, True),
        (0.0015, False, True),
        (0.005, False, False),
    ):
        body = legs(0.1)
        short = replace(body.parts[0], length=0.1 - gap)
        # Heavy enough that no other pose is stable.
        heavy_right = Part(parent=BASE, mount=2, hinge=2, length=0.1, radius=0.02)
        body = replace(body, parts=(short, *body.parts[1:], heavy_right))
        felt = read_one(physics, body, *[-RIGHT_ANGLE] * 4)
        assert felt.touch[0].tolist() == [touch, True, True, True]
        assert felt.touch_doubtful[0, 0] == doubtful


def test_every_gene_changes_some_reading(physics: Physics) -> None:
    genome = Genome(Problem.load("parametric"), BODY)
    rng = np.random.default_rng(5)
    programs = [np.concatenate([np.radians(rng.uniform(-30, 30, 4)), np.zeros(4)]) for _ in "1234"]
    middle = np.full(genome.size, 0.6)

    def readings(genes: Array) -> Array:
        felt = physics.read([(genome.decode(genes), program) for program in programs])
        return np.column_stack([felt.tilt, felt.clearance])

    before = readings(middle)
    for gene in range(genome.size):
        longer = middle.copy()
        longer[gene] = 0.8
        assert np.abs(readings(longer) - before).max() > 1e-3, genome.genes[gene]


def test_a_reading_depends_on_its_own_pair_only(
    engine: Engine, physics: Physics, random_tree: MakeBody
) -> None:
    pairs = random_pairs(random_tree, 8, seed=4)
    together, backwards = physics.read(pairs), physics.read(pairs[::-1])
    with engine() as other:
        alone = PredictedReadings.concatenate(other.read([pair]) for pair in pairs)
    for name in ("tilt", "clearance", "speed", "joint_miss", "touch"):
        assert np.array_equal(getattr(together, name), getattr(backwards, name)[::-1])
        assert np.array_equal(getattr(together, name), getattr(alone, name))


def test_work_is_counted(engine: Engine) -> None:
    with engine(WorldSettings(steps=3)) as short:
        short.read([(legs(0.1), np.zeros(4))] * 5)
        assert (short.simulations, short.steps) == (5, 15)


def test_nothing_and_no_parts_can_be_read(physics: Physics) -> None:
    assert len(physics.read([])) == 0
    bare = Morphology(base=BODY, parts=(), density=1000.0)
    felt = read_one(physics, bare)
    assert felt.valid.all()
    assert felt.clearance == pytest.approx([0.0], abs=1e-4)


@pytest.mark.parametrize("problem", ["parametric", "topological", "topological-24"])
def test_stopping_at_rest_reads_what_all_steps_read(engine: Engine, problem: str) -> None:
    genome = Genome(Problem.load(problem), BODY)
    motors = 8 if problem == "topological-24" else 4
    pairs = random_pairs(lambda rng: genome.decode(rng.random(genome.size)), 30, 21, motors)
    with engine() as usual, engine(WorldSettings(full_steps=True)) as reference:
        quick, full = usual.read(pairs), reference.read(pairs)
        assert reference.steps == 30 * 300
        assert usual.steps < 0.5 * reference.steps
    assert np.array_equal(quick.valid, full.valid)
    assert np.degrees(np.abs(quick.tilt - full.tilt)).max() < 0.05
    assert 1000 * np.abs(quick.clearance - full.clearance).max() < 0.2
    assert (quick.touch == full.touch).mean() >= 0.995


def test_with_fine_steps_a_pose_that_stays_reads_what_all_steps_read(engine: Engine) -> None:
    genome = Genome(Problem.load("topological"), BODY)
    pairs = random_pairs(lambda rng: genome.decode(rng.random(genome.size)), 15, 22, 4)
    world = WorldSettings(step=1 / 240, steps=1200, rest_window=0.3)
    with engine(world) as usual, engine(replace(world, full_steps=True)) as reference:
        quick, full = usual.read(pairs), reference.read(pairs)
        assert 15 * 0.3 * 240 < usual.steps < 0.25 * reference.steps
    assert np.array_equal(quick.valid, full.valid)
    assert np.degrees(np.abs(quick.tilt - full.tilt)).max() < 0.05
    assert 1000 * np.abs(quick.clearance - full.clearance).max() < 0.1
    assert np.array_equal(quick.touch, full.touch)


def test_a_bar_rests_on_its_edges(physics: Physics, statics: StaticsPhysics) -> None:
    """Four bars 100 mm wide, wider than the main body is high, each turned about its own axis."""
    turned = legs(0.2, radius=0.05, hinge=4)
    bars = replace(turned, parts=tuple(replace(part, shape="box") for part in turned.parts))
    for degrees in (0.0, 20.0, 45.0):
        angle = math.radians(degrees)
        edge = 0.05 * (math.cos(angle) + math.sin(angle)) - BELLY
        for back_end in (physics, statics):
            felt = read_one(back_end, bars, *[angle] * 4)
            assert felt.clearance == pytest.approx([edge], abs=2e-4)
            assert felt.touch.all()
            round_one = read_one(back_end, turned, *[angle] * 4)
            assert round_one.clearance == pytest.approx([0.05 - BELLY], abs=2e-4)


def test_bodies_of_bars_rest_where_statics_has_them(
    engine: Engine, statics: StaticsPhysics, random_quadruped: MakeBody
) -> None:
    pairs = []
    for body, program in random_pairs(random_quadruped, 20, seed=23, motors=4):
        upper = [replace(part, shape="box") for part in body.parts[:4]]
        pairs.append((replace(body, parts=(*upper, *body.parts[4:])), program))
    sure = statics.path_margins(pairs) > np.radians(2)
    by_statics = statics.read(pairs)
    with engine(WorldSettings(step=1 / 240, steps=1200)) as simulator:
        simulated = simulator.read(pairs)
    assert sure.sum() > 8
    assert simulated.tilt[sure] == pytest.approx(by_statics.tilt[sure], abs=2e-3)
    assert simulated.clearance[sure] == pytest.approx(by_statics.clearance[sure], abs=3e-4)


def test_a_body_that_does_not_lie_flat_rests_before_it_moves(
    engine: Engine, statics: StaticsPhysics
) -> None:
    corners = [
        BaseMount(name="", at=(x, y, 0.0), yaw=0.0, elevation=-math.pi / 6)
        for x, y in ((0.09, 0.06), (0.09, -0.06), (-0.09, 0.06), (-0.09, -0.06))
    ]
    backward, forward, left, right = ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0, 0, 1.0), (0, 0, -1.0))
    axes = (backward, backward, forward, right, left, backward, left, backward)
    lengths = (0.095, 0.051, 0.127, 0.102, 0.068, 0.096, 0.089, 0.127)
    body = Morphology(
        base=Base(size=(0.14, 0.14, 0.085), mass=0.6, mounts=tuple(corners)),
        parts=tuple(
            Part(
                parent=BASE if row < 4 else row - 4,
                mount=row if row < 4 else 0,
                hinge=row,
                length=length,
                radius=0.01 if row < 4 else 0.008,
                motor=row,
            )
            for row, length in enumerate(lengths)
        ),
        part_mounts=(PartMount(name="end", fraction=1.0, yaw=0.0),),
        hinges=tuple(Hinge(name="", axis=axis) for axis in axes),
        density=1500.0,
    )
    program = np.radians([27.9, -26.5, 15.4, 17.2, -28.6, -5.6, 2.7, 18.1])
    assert not body.lies_flat
    assert legs(0.1).lies_flat
    pair = (body, program)
    assert statics.path_margins([pair]) > np.radians(5)
    with engine(WorldSettings(step=1 / 240, steps=1200)) as simulator:
        assert simulator.read([pair]).tilt == pytest.approx(statics.read([pair]).tilt, abs=0.01)
