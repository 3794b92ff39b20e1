"""PyBullet against our own kinematics and against geometry that can be done by hand."""

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Base, Morphology, Part, part_frames
from estimator.errors import PhysicsError
from estimator.physics.base import Pair, Readings, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem

MakeBody = Callable[[np.random.Generator], Morphology]
BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
BELLY = 0.085 / 2
RIGHT_ANGLE = math.radians(90)


def legs(length: float, *, radius: float = 0.006, pieces: int = 1, hinge: int = 2) -> Morphology:
    """Four equal straight legs, each of one or two rigid pieces; the last piece feels touch."""
    upper = [
        Part(
            parent=BASE,
            side=leg,
            hinge=hinge,
            length=length / pieces,
            radius=radius,
            motor=leg,
            sensor=leg if pieces == 1 else None,
        )
        for leg in range(4)
    ]
    lower = [
        replace(part, parent=part.side, side=1, motor=None, sensor=part.side) for part in upper
    ]
    parts = tuple(upper) if pieces == 1 else (*upper, *lower)
    return Morphology(base=BODY, parts=parts, density=1000.0)


def read_one(physics: PyBulletPhysics, body: Morphology, *angles: float) -> Readings:
    return physics.read([(body, np.array(angles))])


def random_pairs(make: MakeBody, count: int, seed: int, motors: int = 8) -> list[Pair]:
    rng = np.random.default_rng(seed)
    pairs = []
    for _ in range(count):
        program = np.zeros(8)
        program[:motors] = np.radians(rng.uniform(-30, 30, motors))
        pairs.append((make(rng), program))
    return pairs


def test_kinematics_agree_link_by_link(physics: PyBulletPhysics, random_tree: MakeBody) -> None:
    engine, client = physics._engine, physics._client
    rng = np.random.default_rng(3)
    for _ in range(100):
        body = random_tree(rng)
        angles = rng.uniform(-np.pi, np.pi, 8)
        number = physics._build(body, body.part_angles(angles))
        for link, angle in enumerate(body.part_angles(angles)):
            engine.resetJointState(number, link, angle, physicsClientId=client)
        base, _ = engine.getBasePositionAndOrientation(number, physicsClientId=client)
        states = engine.getLinkStates(
            number, range(8), computeForwardKinematics=True, physicsClientId=client
        )
        origins, rotations = part_frames(body, angles)
        for link, state in enumerate(states):
            matrix = np.reshape(engine.getMatrixFromQuaternion(state[5]), (3, 3))
            assert np.array(state[4]) - base == pytest.approx(origins[link], abs=1e-5)
            assert matrix == pytest.approx(rotations[link], abs=1e-5)


def test_a_body_at_zero_lies_flat(physics: PyBulletPhysics) -> None:
    felt = read_one(physics, legs(0.22), 0, 0, 0, 0)
    assert felt.tilt == pytest.approx(np.zeros((1, 2)), abs=1e-4)
    assert felt.clearance == pytest.approx([0.0], abs=1e-4)
    assert not felt.touch.any()
    assert felt.speed == pytest.approx([0.0], abs=1e-4)
    assert felt.valid.all()


def test_thick_legs_carry_the_body_at_zero(physics: PyBulletPhysics) -> None:
    felt = read_one(physics, legs(0.22, radius=0.05), 0, 0, 0, 0)
    assert felt.clearance == pytest.approx([0.05 - BELLY], abs=1e-4)
    assert felt.touch.all()


@pytest.mark.parametrize("radius", [0.006, 0.013])
@pytest.mark.parametrize("pieces", [1, 2])
@pytest.mark.parametrize("length", [0.08, 0.19])
def test_standing_legs_lift_the_belly_by_their_length(
    physics: PyBulletPhysics, radius: float, pieces: int, length: float
) -> None:
    """Whatever the radius: a leg is as long as the way from its joint to its tip."""
    felt = read_one(physics, legs(length, radius=radius, pieces=pieces), *[-RIGHT_ANGLE] * 4)
    assert felt.clearance == pytest.approx([length - BELLY], abs=2e-4)
    assert felt.touch.all()
    assert not felt.touch_doubtful.any()
    assert felt.tilt == pytest.approx(np.zeros((1, 2)), abs=1e-3)


def test_clearance_is_capped(physics: PyBulletPhysics) -> None:
    felt = read_one(physics, legs(0.29), *[-RIGHT_ANGLE] * 4)
    assert felt.clearance == pytest.approx([0.2])
    assert felt.saturated.all()


@pytest.mark.parametrize(("leg", "tilt"), [(0, (1, 0)), (1, (0, 1)), (2, (-1, 0)), (3, (0, -1))])
def test_one_leg_pushes_its_side_up(
    physics: PyBulletPhysics, leg: int, tilt: tuple[int, int]
) -> None:
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


def sense(physics: PyBulletPhysics, height: float, turn: list[float]) -> Readings:
    """Reads a body that hangs in the air, turned by a quaternion (x, y, z, w)."""
    body, angles = legs(0.1), [0.0] * 4
    number, engine = physics._build(body, angles), physics._engine
    place = {"physicsClientId": physics._client}
    engine.resetBasePositionAndOrientation(number, [0.3, -0.2, height], turn, **place)
    readings = Readings.empty(1, 4)
    physics._sense(number, body, angles, readings, 0)
    return readings


@pytest.mark.parametrize("seed", range(10))
def test_sensors_follow_their_definitions(physics: PyBulletPhysics, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=4)
    turn /= np.linalg.norm(turn)
    x, y, z, w = turn
    rows = physics._engine.getMatrixFromQuaternion(turn.tolist())
    to_world = np.reshape(rows, (3, 3))
    up = to_world.T @ [0, 0, 1]  # world up, seen from the body
    felt = sense(physics, 0.12, [x, y, z, w])
    assert np.sin(felt.tilt[0]) == pytest.approx([up[1], up[0]], abs=1e-6)
    belly, normal = [0, 0, 0.12] + to_world @ [0, 0, -BELLY], to_world @ [0, 0, -1]
    away = -belly[2] / normal[2] if normal[2] else math.inf
    assert felt.clearance[0] == pytest.approx(away if 0 <= away < 0.2 else 0.2, abs=1e-6)


def test_an_upside_down_body_sees_no_ground(physics: PyBulletPhysics) -> None:
    felt = sense(physics, 0.12, [1.0, 0.0, 0.0, 0.0])
    assert felt.clearance[0] == pytest.approx(0.2)
    assert felt.saturated[0]


def test_a_body_that_flies_apart_is_invalid(physics: PyBulletPhysics) -> None:
    body, angles = legs(0.1), [0.0] * 4
    number, engine = physics._build(body, angles), physics._engine
    engine.resetBaseVelocity(number, [math.nan] * 3, physicsClientId=physics._client)
    readings = Readings.empty(1, 4)
    physics._sense(number, body, angles, readings, 0)
    assert not readings.valid[0]
    assert readings.joint_miss[0] == math.inf


class Moody:
    """PyBullet that now and then refuses a call."""

    def __init__(self, engine: Any, call: str, moods: Iterator[bool]):
        self._engine, self._call, self._moods = engine, call, moods

    def __getattr__(self, name: str) -> Any:
        if name == self._call and next(self._moods, False):
            raise self._engine.error("not today")
        return getattr(self._engine, name)


@pytest.mark.parametrize("call", ["createMultiBody", "stepSimulation", "getLinkStates"])
def test_a_body_that_the_engine_refuses_is_invalid_and_costs_no_other(
    random_tree: MakeBody, call: str
) -> None:
    pairs = random_pairs(random_tree, 3, seed=6)
    with PyBulletPhysics() as physics:
        expected = physics.read(pairs)
        physics._engine = Moody(physics._engine, call, iter([True]))
        felt = physics.read(pairs)
        assert felt.valid.tolist() == [False, True, True]
        assert felt.joint_miss[0] == math.inf
        assert np.array_equal(felt.tilt[1:], expected.tilt[1:])
        assert physics.simulations == 6


def test_an_engine_that_is_gone_is_an_error() -> None:
    with PyBulletPhysics() as physics:
        physics._engine.disconnect(physicsClientId=physics._client)
        with pytest.raises(PhysicsError, match="PyBullet is gone: Not connected"):
            read_one(physics, legs(0.1), 0, 0, 0, 0)
        physics._client = -1


def test_joints_hold_their_angles(
    physics: PyBulletPhysics, random_quadruped: MakeBody, random_tree: MakeBody
) -> None:
    """With the true inertia of such light parts, joints miss by whole degrees."""
    quadrupeds = physics.read(random_pairs(random_quadruped, 60, seed=1, motors=4))
    trees = physics.read(random_pairs(random_tree, 60, seed=2))
    for felt in (quadrupeds, trees):
        assert np.degrees(felt.joint_miss).max() < 0.1
        assert felt.valid.all()
        assert np.isfinite(felt.tilt).all()


@pytest.mark.parametrize(("scale", "mass"), [(0.5, 0.1), (1.0, 3.0), (3.0, 27.0)])
def test_joints_hold_their_angles_in_robots_of_any_size(
    physics: PyBulletPhysics,
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

    pairs = random_pairs(random_quadruped, 40, seed=3, motors=4)
    felt = physics.read([sized(pair) for pair in pairs])
    assert np.degrees(felt.joint_miss).max() < 0.1
    felt = physics.read([sized(pair) for pair in random_pairs(random_tree, 40, seed=4)])
    assert np.degrees(felt.joint_miss).max() < 0.1


def test_the_least_inertia_is_no_more_than_needed(
    physics: PyBulletPhysics, random_quadruped: MakeBody
) -> None:
    """It grows with weight, reach and step; a tenth of it is not enough."""
    coarse, fine = WorldSettings(), WorldSettings(step=1 / 240)
    body = legs(0.1)
    heavy = replace(body, base=replace(body.base, mass=2 * body.mass - body.masses.sum()))
    floor = coarse.inertia_floor(body)
    assert coarse.inertia_floor(heavy) == pytest.approx(2 * floor)
    assert fine.inertia_floor(body) == pytest.approx(floor / 16)
    pairs = random_pairs(random_quadruped, 40, seed=3, motors=4)
    with PyBulletPhysics(replace(coarse, least_inertia=coarse.least_inertia / 10)) as light:
        assert not light.read(pairs).valid.all()


def test_a_joint_that_misses_makes_the_reading_invalid(physics: PyBulletPhysics) -> None:
    felt = read_one(physics, legs(0.1, hinge=4), math.radians(310), 0, 0, 0)
    assert not felt.valid[0]  # 300 steps at 60 degrees per second are 300 degrees
    assert np.degrees(felt.joint_miss[0]) == pytest.approx(10, abs=1.1)


def test_v_is_the_speed_of_a_body_that_is_not_at_rest() -> None:
    with PyBulletPhysics(WorldSettings(steps=40)) as short:
        felt = read_one(short, legs(0.2), *[-RIGHT_ANGLE] * 4)
    assert felt.speed[0] > 0.05
    assert not felt.valid[0]


def test_touch_is_doubtful_just_above_the_ground(physics: PyBulletPhysics) -> None:
    """Three legs stand; the fourth is shorter by a gap that a real gauge may or may not feel."""
    for gap, touch, doubtful in ((0.0004, True, True), (0.0015, False, True), (0.01, False, False)):
        body = legs(0.1)
        short = replace(body.parts[0], length=0.1 - gap)
        heavy_right = Part(parent=BASE, side=2, hinge=2, length=0.05, radius=0.02)
        body = replace(body, parts=(short, *body.parts[1:], heavy_right))
        felt = read_one(physics, body, *[-RIGHT_ANGLE] * 4)
        assert felt.touch[0].tolist() == [touch, True, True, True]
        assert felt.touch_doubtful[0, 0] == doubtful


def test_every_gene_changes_some_reading(physics: PyBulletPhysics) -> None:
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
    physics: PyBulletPhysics, random_tree: MakeBody
) -> None:
    pairs = random_pairs(random_tree, 8, seed=4)
    together, backwards = physics.read(pairs), physics.read(pairs[::-1])
    with PyBulletPhysics() as other:
        alone = Readings.concatenate(other.read([pair]) for pair in pairs)
    for name in ("tilt", "clearance", "speed", "joint_miss", "touch"):
        assert np.array_equal(getattr(together, name), getattr(backwards, name)[::-1])
        assert np.array_equal(getattr(together, name), getattr(alone, name))


def test_work_is_counted() -> None:
    with PyBulletPhysics(WorldSettings(steps=3)) as short:
        short.read([(legs(0.1), np.zeros(4))] * 5)
        assert (short.simulations, short.steps) == (5, 15)


def test_bad_batches_are_refused(physics: PyBulletPhysics) -> None:
    with pytest.raises(PhysicsError, match="must be finite"):
        read_one(physics, legs(0.1), math.nan, 0, 0, 0)
    blind = replace(legs(0.1), parts=())
    with pytest.raises(PhysicsError, match=r"equally many touch sensors, not \[0, 4\]"):
        physics.read([(legs(0.1), np.zeros(4)), (blind, np.zeros(4))])
    crowded = replace(blind, parts=(Part(parent=BASE, side=0, hinge=0, length=1, radius=1),) * 101)
    with pytest.raises(PhysicsError, match="at most 100 parts, not 101"):
        read_one(physics, crowded)
    closed = PyBulletPhysics()
    closed.close()
    closed.close()
    with pytest.raises(PhysicsError, match="closed"):
        closed.read([])


def test_nothing_and_no_parts_can_be_read(physics: PyBulletPhysics) -> None:
    assert len(physics.read([])) == 0
    bare = Morphology(base=BODY, parts=(), density=1000.0)
    felt = read_one(physics, bare)
    assert felt.valid.all()
    assert felt.clearance == pytest.approx([0.0], abs=1e-4)


def test_pybullets_chatter_stays_out_of_our_output() -> None:
    program = """
import numpy as np
from estimator.body.morphology import Base, Morphology
from estimator.physics.pybullet import PyBulletPhysics
body = Morphology(base=Base(size=(0.1, 0.1, 0.1), mass=1.0), parts=(), density=1.0)
with PyBulletPhysics() as physics:
    physics.read([(body, np.zeros(0))])
print("ours")
"""
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    assert printed.stdout == "ours\n"
    assert printed.stderr == ""


@pytest.mark.parametrize("problem", ["parametric", "topological", "topological-24"])
def test_stopping_at_rest_reads_what_all_steps_read(problem: str) -> None:
    genome = Genome(Problem.load(problem), BODY)
    motors = 8 if problem == "topological-24" else 4
    pairs = random_pairs(lambda rng: genome.decode(rng.random(genome.size)), 120, 21, motors)
    with PyBulletPhysics() as usual, PyBulletPhysics(WorldSettings(full_steps=True)) as reference:
        quick, full = usual.read(pairs), reference.read(pairs)
        assert reference.steps == 120 * 300
        assert usual.steps < 0.5 * reference.steps
    assert np.array_equal(quick.valid, full.valid)
    assert np.degrees(np.abs(quick.tilt - full.tilt)).max() < 0.05
    assert 1000 * np.abs(quick.clearance - full.clearance).max() < 0.2
    assert (quick.touch == full.touch).mean() >= 0.995


def test_a_body_reads_the_same_in_a_used_world(random_tree: MakeBody) -> None:
    pairs = random_pairs(random_tree, 40, seed=22)
    with PyBulletPhysics() as used:
        used.read(pairs)
        again = used.read(pairs[::-1])
    for row, pair in enumerate(pairs[::-1]):
        if row % 8 == 0:
            with PyBulletPhysics() as fresh:
                alone = fresh.read([pair])
            assert alone.tilt.tobytes() == again.tilt[row : row + 1].tobytes()
            assert alone.clearance.tobytes() == again.clearance[row : row + 1].tobytes()
