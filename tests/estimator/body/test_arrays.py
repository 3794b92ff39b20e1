"""Bodies as arrays, against the objects that they stand for."""

import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

from estimator.body.arrays import Bodies
from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.errors import MorphologyError, SearchStateError
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities
from tests.estimator.model_robot import make_capabilities

BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
SMALL = Morphology(
    base=BODY,
    parts=(
        Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.01, motor=0),
        Part(parent=0, mount=1, hinge=4, length=0.2, radius=0.02, sensor=0),
    ),
    density=1000.0,
)


def robot(joints: int, touch: int) -> Capabilities:
    model = make_capabilities()
    return replace(
        model,
        joints=tuple(replace(model.joints[0], name=f"joint_{joint}") for joint in range(joints)),
        part_radii=(0.006,) * joints,
        sensors=(replace(model.sensors[0], count=touch), *model.sensors[1:]),
    )


def assert_same(one: Bodies, two: Bodies) -> None:
    for item in fields(Bodies):
        first, second = getattr(one, item.name), getattr(two, item.name)
        assert np.array_equal(first, second), item.name
        assert first.dtype == second.dtype


@pytest.mark.parametrize(
    ("name", "joints", "touch"),
    [
        ("parametric", 8, 4),
        ("topological", 8, 4),
        ("topological", 5, 5),
        ("topological", 4, 2),  # fewer sensors than legs: they sit where nothing else does
        ("topological-20", 8, 4),
        ("topological-24", 8, 4),
    ],
)
def test_a_population_is_decoded_at_once_as_one_by_one(name: str, joints: int, touch: int) -> None:
    problem = Problem.load(name).for_robot(robot(joints, touch))
    genome = Genome(problem, BODY)
    genes = np.random.default_rng(1).random((40, genome.size))
    genes[0], genes[1] = 0.0, 1.0
    assert_same(genome.bodies(genes), Bodies.of(genome.decode_all(genes)))


def test_parts_may_be_boxes() -> None:
    genome = Genome(Problem.load("topological-24"), BODY)
    bodies = genome.bodies(np.random.default_rng(1).random((4, genome.size)))
    assert bodies.box.tolist() == 4 * [4 * [True] + 4 * [False]]


def test_genes_are_checked() -> None:
    genome = Genome(Problem.load("parametric"), BODY)
    with pytest.raises(SearchStateError, match=r"genomes have 8 genes, not shape \(8,\)"):
        genome.bodies(np.zeros(8))
    for gene in (1.5, np.nan):
        with pytest.raises(SearchStateError, match="every gene must lie in 0 to 1"):
            genome.bodies(np.full((2, 8), gene))


def test_bodies_of_different_sizes_share_arrays() -> None:
    bare = replace(SMALL, parts=())
    bodies = Bodies.of([bare, SMALL, bare])
    assert bodies.count.tolist() == [0, 2, 0]
    assert bodies.motor[1].tolist() == [0, -1]
    assert bodies.sensor[1].tolist() == [-1, 0]
    assert (bodies.motors, bodies.sensors) == (1, 1)
    assert_same(bodies[1:2], Bodies.of([SMALL]))
    assert_same(bodies[np.array([False, True, False])], Bodies.of([SMALL]))
    assert len(Bodies.of([])) == 0


def test_bodies_chosen_from_chosen_ones_are_those_of_the_first() -> None:
    several = [replace(SMALL, density=1000.0 + number) for number in range(6)]
    bodies = Bodies.of(several)
    chosen = bodies[np.array([4, 1, 1, 5])][np.array([True, False, True, True])][::2]
    whole, rows = chosen.origin
    assert whole is bodies
    assert rows.tolist() == [4, 5]
    assert len(chosen) == 2
    for same in (chosen, pickle.loads(pickle.dumps(chosen))):
        assert_same(same, Bodies.of([several[4], several[5]]))
    heavier = chosen.changed(density=2 * chosen.density)
    assert heavier.origin[0] is heavier
    assert bodies.density[4].tolist() == [1004.0, 1004.0]
    assert not hasattr(chosen, "colour")


def attachments(bodies: Bodies) -> tuple[Array, ...]:
    """What the two parts of each body sit on and turn about, whatever the order of the tables."""
    (first, second), hinges = bodies.mount.T, bodies.hinges[bodies.hinge]
    return bodies.base_mounts[first], bodies.part_mounts[second], hinges[:, 0], hinges[:, 1]


def test_joined_bodies_keep_their_own_mounts_and_hinges() -> None:
    mounts = tuple(replace(mount, yaw=mount.yaw + 0.3) for mount in BODY.mounts)
    askew = replace(SMALL, base=replace(BODY, mounts=mounts), hinges=SMALL.hinges[::-1])
    one, two = Bodies.of([SMALL]), Bodies.of([askew, askew])
    joined, meant = Bodies.joined([one, two, one]), Bodies.of([SMALL, askew, askew, SMALL])
    assert joined.parent.tolist() == meant.parent.tolist()
    for own, other in zip(attachments(joined), attachments(meant), strict=True):
        assert own.tolist() == other.tolist()


ROUND = Base(
    size=(0.2, 0.2, 0.03),
    mass=0.8,
    round=True,
    centre=(0.01, 0.0, -0.004),
    accelerometer=(0.1, 0.2),
)


@pytest.mark.parametrize("base", [BODY, ROUND])
def test_bodies_become_the_objects_that_they_were_made_of(base: Base) -> None:
    bar, shin = SMALL.parts
    legs = (replace(bar, shape="box", zero=0.1, density=800.0), replace(shin, mount=2))
    bodies = Bodies.of([replace(SMALL, base=base), replace(SMALL, base=base, parts=legs)])
    again = Bodies.of(bodies.objects())
    for item in fields(Bodies):
        if item.name not in ("mount", "hinge", "base_mounts", "part_mounts", "hinges"):
            first, second = getattr(bodies, item.name), getattr(again, item.name)
            assert second == pytest.approx(first), item.name
    for first, second in zip(attachments(bodies), attachments(again), strict=True):
        assert second == pytest.approx(first)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("parent", 1, "body 1, part 2: its parent cannot be 1"),
        ("mount", 4, "mount cannot be 4"),
        ("hinge", -1, "hinge cannot be -1"),
        ("motor", -2, "motor cannot be -2"),
        ("length", np.nan, "length cannot be nan"),
        ("length", 1e7, "length cannot be"),
        ("radius", 0.0, "radius cannot be 0.0"),
        ("density", np.inf, "body 1, part 2: its density cannot be inf"),
        ("zero", np.nan, "zero cannot be nan"),
    ],
)
def test_impossible_bodies_are_refused(name: str, value: float, sentence: str) -> None:
    whole = Bodies.of([SMALL])
    array = getattr(whole, name).copy()
    array[0, 1] = value
    with pytest.raises(MorphologyError, match=sentence):
        replace(whole, **{name: array})


def test_impossible_arrays_are_refused() -> None:
    whole = Bodies.of([SMALL])
    with pytest.raises(MorphologyError, match="number of parts cannot be 3"):
        replace(whole, count=np.array([3]))
    with pytest.raises(MorphologyError, match=r"^body 1: its main body cannot be inf"):
        replace(whole, base=np.full((1, 16), np.inf))
    with pytest.raises(
        MorphologyError, match="body 1: its centre of mass, accelerometer or sensors"
    ):
        replace(whole, base=np.where(np.arange(16) < 4, whole.base, np.nan))
    with pytest.raises(MorphologyError, match=r"length of 1 bodies of 2 parts must be float64"):
        replace(whole, length=np.zeros((1, 3)))
    with pytest.raises(MorphologyError, match="mount of 1 bodies"):
        replace(whole, mount=whole.mount.astype(np.int32))
