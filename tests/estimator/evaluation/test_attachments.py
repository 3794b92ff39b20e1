"""Models beside the truth: what is right, what only looks right, what nobody could get right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.body.limbs import leg_lengths
from estimator.body.morphology import BASE, Morphology, Part
from estimator.errors import TruthError
from estimator.evaluation.attachments import Comparison, Configuration, Indistinguishable, Truth
from estimator.evaluation.length_search import LengthSearch
from estimator.physics.equivalence import Reference, turned
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
        Part(parent=parent, mount=side, hinge=hinge, length=0.16, radius=0.006, motor=row)
        for row, (parent, side, hinge) in enumerate(parts)
    )


QUAD = ((BASE, 0, 2), (BASE, 1, 2), (BASE, 2, 2), (BASE, 3, 2))


class Case:
    """A problem on a robot with one joint to a part, whose body is known."""

    def __init__(
        self,
        folder: Path,
        truth: tuple[Part, ...],
        touch: int | None = None,
        problem: str = "topological",
        names: tuple[str, ...] | None = None,
    ):
        count = len(truth)
        joints = names or numbered(count)
        self.capabilities = robot(joints, count if touch is None else touch)
        self.problem = Problem.load(problem).for_robot(self.capabilities)
        self.genome = Genome(self.problem, self.problem.base(self.capabilities))
        body = self.genome.assemble(truth)
        path = write_urdf(folder / "truth.urdf", body, joints)
        self.truth = Truth.read(path, self.problem, self.capabilities)

    def compare(self, model: tuple[Part, ...]) -> Comparison:
        return Comparison(self.problem, self.genome, self.genome.assemble(model), self.truth)


def wrong(cells: tuple[Configuration, ...]) -> list[tuple[str, str]]:
    return [(item.part, item.trait) for item in cells if not item.right]


def wrong_up_to_equivalence(cells: tuple[Configuration, ...]) -> list[tuple[str, str]]:
    return [(item.part, item.trait) for item in cells if not item.right_up_to_equivalence]


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
    cells = comparison.configurations()
    assert len(cells) == total
    assert sum(item.searched for item in cells) == informative
    assert sum(item.chance for item in cells) == pytest.approx(chance, abs=0.01)
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
        cells = Comparison(problem, genome, model, truth).configurations()
        right.append(sum(item.right for item in cells))
    chance = sum(item.chance for item in cells)
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
    other = replace(parts[row], parent=moved, mount=(parts[row].mount + 1) % 4)
    changed = (*parts[:row], other, *parts[row + 1 :])
    name = f"leg {row + 1}"
    assert wrong(case.compare(changed).configurations()) == [(name, "parent"), (name, "mount")]


def test_three_legs_have_nine_configurations(tmp_path: Path) -> None:
    parts = tree((BASE, 0, 2), (BASE, 1, 0), (BASE, 2, 4))
    cells = Case(tmp_path, parts).compare(parts).configurations()
    assert len(cells) == 9
    assert [item.true for item in cells[3:6]] == ["main body", "front", "yaw_left"]


def test_a_leg_on_a_leg_carries_the_sensors_of_the_true_body(tmp_path: Path) -> None:
    """Three sensors for four legs: they sit where nothing else sits on."""
    truth = tree((BASE, 0, 2), (BASE, 1, 2), (BASE, 2, 2), (1, 0, 2))
    case = Case(tmp_path, truth, touch=3)
    comparison = case.compare(tree(*QUAD))
    cells = comparison.configurations()
    assert wrong(cells) == [("leg 4", "parent"), ("leg 4", "mount")]
    assert [item.true for item in cells[9:11]] == ["leg 2", "left"]
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
    text = path.read_text().replace('<axis xyz="0.0 -1.0 0.0" />', '<axis xyz="0 -1 0.5"/>', 1)
    path.write_text(text)
    case.truth = Truth.read(path, case.problem, case.capabilities)
    comparison = case.compare(tree(*QUAD))
    cells = comparison.configurations(lambda starts: True)
    assert wrong_up_to_equivalence(cells) == [("leg 1", "hinge")]
    assert (cells[2].modelled, cells[2].true) == ("up", "not representable")
    assert sum(item.chance for item in cells) == pytest.approx(3.75 - 1 / 6)
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


RIGID = """
name = "rigid"
density = 1000.0
[motors]
driven = "all"
range_deg = [-30.0, 30.0]
slew_deg_per_s = 60.0
[search]
population = 10
generations = 1
interactions = 1
"""
for _name, _yaw in (("on", 0), ("aslant", 40), ("across", 90)):
    RIGID += f'[[mounts]]\nname = "{_name}"\nat = 1.0\nyaw_deg = {_yaw}\n'
for _name, _parent, _mount, _more in (
    ("leg", 0, "front", "motor = 1"),
    ("other leg", 0, "left", "motor = 2"),
    ("foot", 1, "unknown", "sensor = 1"),
    ("toe", 3, "unknown", ""),
    ("fin", 0, "unknown", ""),
):
    RIGID += f"""
[[parts]]
name = "{_name}"
parent = {_parent}
mount = "{_mount}"
hinge = "up"
length = [0.02, 0.20]
radius = 0.006
{_more}
"""
RIGID_JOINTS = ("joint_0", "joint_1", None, None, None)


def rigid_body() -> tuple[Problem, Genome, Morphology]:
    capabilities = robot(numbered(2), 1)
    problem = Problem.parse(RIGID, "rigid.toml").for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    parts = list(genome.decode(np.zeros(genome.size)).parts)
    for row, mount, length in ((0, 1, 0.09), (1, 0, 0.15), (2, 1, 0.07), (3, 2, 0.03), (4, 3, 0.1)):
        parts[row] = replace(parts[row], mount=mount, length=length)
    return problem, genome, genome.assemble(parts)


def test_parts_that_are_rigid_on_others_are_compared_as_parts_of_their_own(tmp_path: Path) -> None:
    problem, genome, body = rigid_body()
    path = write_urdf(tmp_path / "t.urdf", body, RIGID_JOINTS)
    round_foot = """<link name="ball"><collision><geometry><sphere radius="0.006"/></geometry>
        </collision></link><joint name="tip" type="fixed"><parent link="part_0"/>
        <child link="ball"/><origin xyz="0.084 0 0"/></joint></robot>"""
    path.write_text(path.read_text().replace("</robot>", round_foot))
    truth = Truth.read(path, problem, robot(numbered(2), 1))
    itself = Comparison(problem, genome, body, truth)
    assert not itself.not_representable
    assert not wrong(itself.configurations())
    assert [item.true for item in itself.configurations()[-6:]] == [
        *("leg", "aslant"),
        *("foot", "across"),
        *("main body", "back"),
    ]
    assert itself.true_lengths == pytest.approx(leg_lengths([body])[0])
    assert [part.length for part in itself.true_body.parts] == pytest.approx(
        [part.length for part in body.parts]
    )
    parts = [*body.parts[:2], replace(body.parts[2], mount=2, length=0.05), *body.parts[3:]]
    other = Comparison(problem, genome, genome.assemble(parts), truth)
    assert wrong(other.configurations()) == [("foot", "mount")]
    assert other.true_lengths == pytest.approx(itself.true_lengths)


# --- up to equivalence ----------------------------------------------------------------------------


def only(truth: Morphology, *allowed: tuple[int, str]) -> Indistinguishable:
    """A test of equivalence that lets bodies differ in some cells, whatever their values."""

    def alike(starts: Sequence[Morphology]) -> bool:
        return all(
            getattr(a, trait) == getattr(b, trait) or (row, trait) in allowed
            for row, (a, b) in enumerate(zip(truth.parts, starts[0].parts, strict=True))
            for trait in ("parent", "mount", "hinge")
        )

    return alike


def test_single_cells_are_excused_one_by_one(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    model = tree((BASE, 0, 3), (BASE, 2, 4), (BASE, 2, 2), (0, 3, 2))
    comparison = case.compare(model)
    cells = comparison.configurations(only(comparison.true_body, (1, "hinge"), (3, "parent")))
    assert wrong(cells) == [
        ("leg 1", "hinge"),
        ("leg 2", "mount"),
        ("leg 2", "hinge"),
        ("leg 4", "parent"),
    ]
    assert wrong_up_to_equivalence(cells) == [("leg 1", "hinge"), ("leg 2", "mount")]


def test_cells_that_are_only_right_each_alone_are_not_both_excused(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    comparison = case.compare(tree(QUAD[0], (BASE, 1, 4), (BASE, 2, 4), QUAD[3]))
    one, other = (only(comparison.true_body, (row, "hinge")) for row in (1, 2))
    cells = comparison.configurations(lambda starts: one(starts) or other(starts))
    assert wrong_up_to_equivalence(cells) == [("leg 3", "hinge")]


def felt_alike(
    comparison: Comparison, case: Case, statics: StaticsPhysics, modalities: Sequence[str] = ALL
) -> Indistinguishable:
    """The test of equivalence by what bodies feel."""
    programs = np.radians(np.random.default_rng(0).uniform(-30, 30, (500, 4)))
    reference = Reference(comparison.true_body, programs, statics, modalities)
    return LengthSearch(reference, np.array([rule.length for rule in case.problem.parts])).is_like


def test_a_roll_with_nothing_off_its_axis_cannot_be_felt(
    tmp_path: Path, statics: StaticsPhysics
) -> None:
    truth = tree(QUAD[0], (BASE, 1, 4), QUAD[2], QUAD[3])
    case = Case(tmp_path, truth)
    model = tree(QUAD[0], (BASE, 1, 5), (BASE, 2, 3), QUAD[3])
    comparison = case.compare(tuple(replace(part, length=0.17) for part in model))
    cells = comparison.configurations(felt_alike(comparison, case, statics))
    assert wrong(cells) == [("leg 2", "hinge"), ("leg 3", "hinge")]
    assert wrong_up_to_equivalence(cells) == [("leg 3", "hinge")]


KNEES = (*QUAD, (0, 1, 2), (1, 1, 2), (2, 1, 2), (3, 1, 2))


def with_knees(case: Case, *parts: tuple[int, int, int], **lengths: float) -> tuple[Part, ...]:
    """Parts of ``topological-20``: upper ones of 10 cm, lower ones of 8, but for some lengths."""
    body = case.genome.decode(np.zeros(case.genome.size))
    return tuple(
        replace(
            part,
            parent=parent,
            mount=side,
            hinge=hinge,
            length=lengths.get(f"part_{row}", 0.1 if row <= 4 else 0.08),
        )
        for row, (part, (parent, side, hinge)) in enumerate(
            zip(body.parts, parts, strict=True), start=1
        )
    )


def locked_case(folder: Path, *parts: tuple[int, int, int], **lengths: float) -> Case:
    names = HIPS_AND_KNEES
    blank = Case(folder, tree(*KNEES), touch=4, problem="topological-20", names=names)
    truth = with_knees(blank, *parts, **lengths)
    return Case(folder, truth, touch=4, problem="topological-20", names=names)


def test_a_locked_leg_may_be_divided_otherwise(tmp_path: Path, statics: StaticsPhysics) -> None:
    """Truly part 6 prolongs part 5; in the model both sit on part 1, and part 6 is longer."""
    case = locked_case(tmp_path, *KNEES[:5], (4, 1, 2), *KNEES[6:], part_5=0.06, part_6=0.05)
    model = with_knees(case, *KNEES[:5], (0, 1, 2), *KNEES[6:], part_5=0.03, part_6=0.12)
    comparison = case.compare(model)
    cells = comparison.configurations(felt_alike(comparison, case, statics))
    assert wrong(cells) == [("part 6", "parent")]
    assert not wrong_up_to_equivalence(cells)


def test_lower_parts_that_carry_no_gauge_may_be_exchanged(
    tmp_path: Path, statics: StaticsPhysics
) -> None:
    case = locked_case(tmp_path, *KNEES, part_5=0.06, part_6=0.12)
    exchanged = (*KNEES[:4], (1, 1, 2), (0, 1, 2), *KNEES[6:])
    comparison = case.compare(with_knees(case, *exchanged, part_5=0.1, part_6=0.07))
    blind = felt_alike(comparison, case, statics, ("tilt", "clearance"))
    assert wrong(comparison.configurations()) == [("part 5", "parent"), ("part 6", "parent")]
    assert not wrong_up_to_equivalence(comparison.configurations(blind))
    felt = comparison.configurations(felt_alike(comparison, case, statics))
    assert wrong_up_to_equivalence(felt) == [("part 5", "parent"), ("part 6", "parent")]


@pytest.mark.parametrize(
    ("row", "part"), [(1, (BASE, 1, 0)), (1, (BASE, 0, 2)), (4, (BASE, 0, 2)), (4, (0, 3, 2))]
)
def test_what_no_length_makes_like_the_truth_is_wrong(
    tmp_path: Path, statics: StaticsPhysics, row: int, part: tuple[int, int, int]
) -> None:
    case = locked_case(tmp_path, *KNEES)
    comparison = case.compare(with_knees(case, *KNEES[:row], part, *KNEES[row + 1 :]))
    cells = comparison.configurations(felt_alike(comparison, case, statics))
    assert wrong(cells)
    assert wrong_up_to_equivalence(cells) == wrong(cells)


def test_a_turned_square_is_as_good_as_the_truth_where_nobody_can_tell(tmp_path: Path) -> None:
    case = Case(tmp_path, tree(*QUAD))
    quarter = turned(case.genome.assemble(tree(*QUAD)), 1).parts
    comparison = case.compare((*quarter[:3], replace(quarter[3], hinge=3)))
    images = [turned(comparison.true_body, quarters) for quarters in range(4)]
    assert len(wrong(comparison.configurations())) == 5
    exact = comparison.configurations(lambda starts: starts[0] == images[0])
    assert len(wrong_up_to_equivalence(exact)) == 5
    blind = comparison.configurations(lambda starts: starts[0] in images)
    assert wrong_up_to_equivalence(blind) == [("leg 4", "hinge")]
