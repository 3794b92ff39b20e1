"""Models beside the truth: what is right, what only looks right, what nobody could get right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Morphology, Part
from estimator.errors import TruthError
from estimator.evaluation.attachments import Comparison, Configuration, Truth
from estimator.evaluation.equivalence import Reference, turned
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities
from tests.estimator.model_robot import make_capabilities
from tests.estimator.urdf_bodies import write_urdf

ALL = ("touch", "tilt", "clearance")
QUADRUPED = Path("sim_robot/bodies/quadruped.urdf")
HIPS_AND_KNEES = tuple(
    f"{joint}_{side}" for joint in ("hip", "knee") for side in ("left", "front", "right", "back")
)


def robot(names: tuple[str, ...], touch: int = 4) -> Capabilities:
    model = make_capabilities()
    sensors = (replace(model.sensors[0], count=touch), *model.sensors[1:])
    joints = tuple(replace(model.joints[0], name=name) for name in names)
    return replace(
        model,
        base_size=(0.14, 0.14, 0.085),
        base_mass=0.6,
        joints=joints,
        part_radii=(0.006,) * len(names),
        sensors=sensors,
    )


def numbered(count: int) -> tuple[str, ...]:
    return tuple(f"joint_{number}" for number in range(count))


def tree(*parts: tuple[int, int, int]) -> tuple[Part, ...]:
    """Parts of 16 cm: parent, side and hinge of each."""
    return tuple(
        Part(parent=parent, side=side, hinge=hinge, length=0.16, radius=0.006, motor=row)
        for row, (parent, side, hinge) in enumerate(parts)
    )


QUAD = ((BASE, 0, 2), (BASE, 1, 2), (BASE, 2, 2), (BASE, 3, 2))


class Case:
    """The problem ``topological`` on a robot with one joint to a part, whose body is known."""

    def __init__(self, folder: Path, truth: tuple[Part, ...], touch: int | None = None):
        count = len(truth)
        self.capabilities = robot(numbered(count), count if touch is None else touch)
        self.problem = Problem.load("topological").for_robot(self.capabilities)
        self.genome = Genome(self.problem, self.problem.base(self.capabilities))
        body = self.genome.assemble(truth)
        path = write_urdf(folder / "truth.urdf", body, numbered(count))
        self.truth = Truth.read(path, self.problem, self.capabilities)

    def compare(self, model: tuple[Part, ...]) -> Comparison:
        return Comparison(self.problem, self.genome, self.genome.assemble(model), self.truth)


def wrong(found: tuple[Configuration, ...]) -> list[tuple[str, str]]:
    return [(item.part, item.trait) for item in found if not item.right]


def wrong_up_to_equivalence(found: tuple[Configuration, ...]) -> list[tuple[str, str]]:
    return [(item.part, item.trait) for item in found if not item.right_up_to_equivalence]


@pytest.mark.parametrize(
    ("name", "total", "informative", "chance"),
    [
        ("topological", 12, 11, 3.75),
        ("topological-20", 20, 19, 5.38),
        ("topological-24", 24, 23, 6.05),
    ],
)
def test_what_is_counted(name: str, total: int, informative: int, chance: float) -> None:
    capabilities = robot(HIPS_AND_KNEES)
    problem = Problem.load(name).for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    truth = Truth.read(QUADRUPED, problem, capabilities)
    model = genome.decode(np.random.default_rng(0).random(genome.size))
    comparison = Comparison(problem, genome, model, truth)
    found = comparison.configurations()
    assert len(found) == total
    assert sum(item.searched for item in found) == informative
    assert sum(item.chance for item in found) == pytest.approx(chance, abs=0.01)
    assert not comparison.not_representable
    itself = Comparison(problem, genome, comparison.true_body, truth)
    assert not wrong(itself.configurations())


@pytest.mark.parametrize("name", ["topological", "topological-20", "topological-24"])
def test_chance_is_what_random_models_reach(name: str) -> None:
    capabilities = robot(HIPS_AND_KNEES)
    problem = Problem.load(name).for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    truth = Truth.read(QUADRUPED, problem, capabilities)
    rng = np.random.default_rng(1)
    models = [genome.decode(rng.random(genome.size)) for _ in range(400)]
    right = []
    for model in models:
        found = Comparison(problem, genome, model, truth).configurations()
        right.append(sum(item.right for item in found))
    chance = sum(item.chance for item in found)
    assert np.mean(right) == pytest.approx(chance, abs=0.35)


@pytest.mark.parametrize("seed", range(8))
def test_a_tree_is_right_beside_itself_and_wrong_by_what_is_changed(
    tmp_path: Path, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    parts = tree(
        *(
            (int(rng.integers(BASE, row)), int(rng.integers(4)), int(rng.integers(6)))
            for row in range(6)
        )
    )
    case = Case(tmp_path, parts)
    assert not wrong(case.compare(parts).configurations())
    row = int(rng.integers(1, 6))
    moved = (parts[row].parent + 2) % (row + 1) - 1
    other = replace(parts[row], parent=moved, side=(parts[row].side + 1) % 4)
    changed = (*parts[:row], other, *parts[row + 1 :])
    name = f"leg {row + 1}"
    assert wrong(case.compare(changed).configurations()) == [(name, "parent"), (name, "side")]


def test_three_legs_have_nine_configurations(tmp_path: Path) -> None:
    parts = tree((BASE, 0, 2), (BASE, 1, 0), (BASE, 2, 4))
    found = Case(tmp_path, parts).compare(parts).configurations()
    assert len(found) == 9
    assert [item.true for item in found[3:6]] == ["main body", "front", "yaw_left"]


def test_a_leg_on_a_leg_carries_the_sensors_of_the_true_body(tmp_path: Path) -> None:
    """Three sensors for four legs: they sit where nothing else sits on."""
    truth = tree((BASE, 0, 2), (BASE, 1, 2), (BASE, 2, 2), (1, 0, 2))
    case = Case(tmp_path, truth, touch=3)
    comparison = case.compare(tree(*QUAD))
    found = comparison.configurations()
    assert wrong(found) == [("leg 4", "parent"), ("leg 4", "side")]
    assert [item.true for item in found[9:11]] == ["leg 2", "left"]
    assert [part.sensor for part in comparison.true_body.parts] == [0, None, 1, 2]


def test_knees_that_stay_at_0_make_one_leg_with_their_hips() -> None:
    capabilities = robot(HIPS_AND_KNEES)
    problem = Problem.load("topological").for_robot(capabilities)
    truth = Truth.read(QUADRUPED, problem, capabilities)
    assert [limb.limb.length for limb in truth.rows.values()] == pytest.approx([0.22] * 4)
    literal = Problem.load("topological-20").for_robot(capabilities)
    split = Truth.read(QUADRUPED, literal, capabilities)
    lengths = [limb.limb.length for limb in split.rows.values()]
    assert lengths == pytest.approx([0.095] * 4 + [0.125] * 4)
    assert [limb.limb.length for limb in split.legs.values()] == pytest.approx([0.22] * 4)
    assert [limb.limb.parent for limb in split.rows.values()] == [BASE] * 4 + [0, 1, 2, 3]


def test_parts_that_nobody_names_keep_their_share_of_the_true_length() -> None:
    capabilities = robot(HIPS_AND_KNEES)
    problem = Problem.load("parametric").for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    truth = Truth.read(QUADRUPED, problem, capabilities)
    model = genome.decode(np.full(8, 0.0))  # 1 cm each
    comparison = Comparison(problem, genome, model, truth)
    assert len(comparison.configurations()) == 12
    assert [part.length for part in comparison.true_body.parts] == pytest.approx([0.11] * 8)


def test_a_twisted_hinge_is_nobodys_fault_but_wrong(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    path = tmp_path / "truth.urdf"
    text = path.read_text().replace('<axis xyz="0.0 -1.0 0.0"/>', '<axis xyz="0 -1 0.5"/>', 1)
    path.write_text(text)
    case.truth = Truth.read(path, case.problem, case.capabilities)
    comparison = case.compare(tree(*QUAD))
    found = comparison.configurations(lambda reference: lambda body: True)
    assert wrong_up_to_equivalence(found) == [("leg 1", "hinge")]
    assert (found[2].found, found[2].true) == ("up", "not representable")
    assert sum(item.chance for item in found) == pytest.approx(3.75 - 1 / 6)
    (sentence,) = comparison.not_representable
    assert sentence.startswith("joint_0 has its axis 27 degrees")


def test_a_leg_longer_than_the_problem_allows_is_listed(tmp_path: Path) -> None:
    legs = tree(*QUAD)
    case = Case(tmp_path, (replace(legs[0], length=0.45), *legs[1:]))
    assert case.compare(legs).not_representable == (
        "joint_0 carries a part of 450 mm, and the problem allows 20 to 400 mm",
    )


def test_a_part_on_a_later_row_cannot_be_said(tmp_path: Path) -> None:
    """The robot's second joint carries the first part, and the problem lists it first."""
    capabilities = robot(numbered(2), 2)
    text = Problem.load("topological").source.replace(
        'driven = { 8 = [1, 2, 3, 4], other = "all" }', "driven = [1, 2]"
    )
    part = text[text.index("[[parts]]") :].replace('each = "driven"', "motor = 2")
    backwards = text[: text.index("[[parts]]")] + part.replace('"leg"', '"outer"')
    backwards += part.replace('"leg"', '"inner"').replace("motor = 2", "motor = 1")
    problem = Problem.parse(backwards, "backwards.toml").for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    parts = tree((BASE, 0, 2), (0, 1, 2))
    path = write_urdf(tmp_path / "t.urdf", genome.assemble(parts), numbered(2))
    truth = Truth.read(path, problem, capabilities)
    model = genome.decode(np.full(genome.size, 0.4))
    comparison = Comparison(problem, genome, model, truth)
    assert comparison.not_representable == (
        "joint_1 sits on a part that comes later in the problem",
    )
    assert ("outer", "parent") in wrong(comparison.configurations())


def test_a_locked_joint_must_be_in_the_truth(tmp_path: Path) -> None:
    capabilities = robot(HIPS_AND_KNEES)
    problem = Problem.load("topological-20").for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    path = write_urdf(tmp_path / "t.urdf", genome.assemble(tree(*QUAD)), HIPS_AND_KNEES[:4])
    with pytest.raises(TruthError, match="no revolute joint named knee_back, knee_front"):
        Truth.read(path, problem, capabilities)


# --- up to equivalence ----------------------------------------------------------------------------


def only(*allowed: tuple[int, str]) -> Callable[[Morphology], Callable[[Morphology], bool]]:
    """A test of equivalence that lets bodies differ in some cells, whatever their values."""

    def alike(one: Morphology, other: Morphology) -> bool:
        return all(
            getattr(a, trait) == getattr(b, trait) or (row, trait) in allowed
            for row, (a, b) in enumerate(zip(one.parts, other.parts, strict=True))
            for trait in ("parent", "side", "hinge")
        )

    return lambda reference: lambda body: alike(reference, body)


def test_single_cells_are_excused_one_by_one(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    model = tree((BASE, 0, 3), (BASE, 2, 4), (BASE, 2, 2), (0, 3, 2))
    found = case.compare(model).configurations(only((1, "hinge"), (3, "parent")))
    assert wrong(found) == [
        ("leg 1", "hinge"),
        ("leg 2", "side"),
        ("leg 2", "hinge"),
        ("leg 4", "parent"),
    ]
    assert wrong_up_to_equivalence(found) == [("leg 1", "hinge"), ("leg 2", "side")]


def test_cells_that_are_only_right_each_alone_are_not_both_excused(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    one, other = only((1, "hinge")), only((2, "hinge"))

    def same_as(reference: Morphology) -> Callable[[Morphology], bool]:
        return lambda body: one(reference)(body) or other(reference)(body)

    model = tree(QUAD[0], (BASE, 1, 4), (BASE, 2, 4), QUAD[3])
    found = case.compare(model).configurations(same_as)
    assert wrong_up_to_equivalence(found) == [("leg 3", "hinge")]


def programs(motors: int) -> Array:
    return np.radians(np.random.default_rng(0).uniform(-30, 30, (500, motors)))


def test_a_roll_with_nothing_off_its_axis_cannot_be_felt(
    tmp_path: Path, statics: StaticsPhysics
) -> None:
    truth = tree(QUAD[0], (BASE, 1, 4), QUAD[2], QUAD[3])
    case = Case(tmp_path, truth)
    model = tree(QUAD[0], (BASE, 1, 5), (BASE, 2, 3), QUAD[3])
    found = case.compare(model).configurations(
        lambda body: Reference(body, programs(4), statics, ALL).is_like
    )
    assert wrong(found) == [("leg 2", "hinge"), ("leg 3", "hinge")]
    assert wrong_up_to_equivalence(found) == [("leg 3", "hinge")]


def test_a_turned_square_is_as_good_as_the_truth_where_nobody_can_tell(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    quarter = turned(case.genome.assemble(tree(*QUAD)), 1).parts
    comparison = case.compare((*quarter[:3], replace(quarter[3], hinge=3)))

    def blind(reference: Morphology) -> Callable[[Morphology], bool]:
        return lambda body: any(body == turned(reference, quarters) for quarters in range(4))

    def exact(reference: Morphology) -> Callable[[Morphology], bool]:
        return lambda body: body == reference

    assert len(wrong(comparison.configurations())) == 5
    assert len(wrong_up_to_equivalence(comparison.configurations(exact))) == 5
    assert wrong_up_to_equivalence(comparison.configurations(blind)) == [("leg 4", "hinge")]
