"""The topological problems as they ship, and problem files that speak of robots in general."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from estimator.body.morphology import BASE
from estimator.errors import ProblemError
from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.physics.base import Physics, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.problem.template import Inventory
from estimator.storage.run_config import RunConfig
from estimator.workplaces import IN_THIS_PROCESS
from protocol.wire.capabilities import Capabilities
from tests.estimator.model_robot import make_capabilities, without_plots

TEXT = Problem.load("topological").source
DRIVEN = 'driven = { 8 = [1, 2, 3, 4], other = "all" }'


def robot(joints: int, touch: int) -> Capabilities:
    model = make_capabilities()
    sensors = (replace(model.sensors[0], count=max(1, touch)), *model.sensors[1:])
    return replace(
        model,
        joints=tuple(
            replace(model.joints[0], name=f"joint_{number}", speed=math.radians(60))
            for number in range(joints)
        ),
        part_radii=(0.006,) * joints,
        sensors=sensors if touch else sensors[1:],
    )


@pytest.mark.parametrize(
    ("name", "parts", "driven", "genes", "length"),
    [
        ("topological", 4, 4, 16, (0.02, 0.40)),
        ("topological-20", 8, 4, 32, (0.01, 0.20)),
        ("topological-24", 8, 8, 32, (0.01, 0.20)),
    ],
)
def test_what_ships_is_the_papers(
    name: str, parts: int, driven: int, genes: int, length: tuple[float, float]
) -> None:
    problem = Problem.load(name)
    search = problem.search
    interactions = 16 if driven == 8 else 9  # the paper moves no knees
    assert (search.population, search.generations, search.interactions) == (300, 40, interactions)
    assert problem.motors.driven == tuple(range(driven))
    assert [part.motor for part in problem.parts[:4]] == [0, 1, 2, 3]
    assert {part.length for part in problem.parts} == {length}
    assert [part.radius for part in problem.parts] == (
        [0.006] * 4 if parts == 4 else [0.013] * 4 + [0.006] * 4
    )
    assert problem.sensors == 4
    genome = Genome(problem, problem.base(robot(8, 4)))
    assert genome.size == genes
    assert [gene.trait for gene in genome.genes[:4]] == ["parent", "mount", "hinge", "length"]
    assert [gene.choices for gene in genome.genes[4:8]] == [2, 4, 6, 0]
    body = genome.decode(np.full(genes, 1.0))
    assert [part.parent for part in body.parts] == [row - 1 for row in range(parts)]
    assert [part.sensor for part in body.parts[-4:]] == [0, 1, 2, 3]


def test_lower_parts_of_the_literal_genome_are_carried_by_locked_knees() -> None:
    problem = Problem.load("topological-20")
    assert [part.motor for part in problem.parts[4:]] == [None] * 4
    assert [part.joint for part in problem.parts] == list(range(8))


@pytest.mark.parametrize(("joints", "driven"), [(1, 1), (3, 3), (4, 4), (5, 5), (7, 7), (8, 4)])
def test_topological_drives_all_joints_of_a_robot_that_is_not_the_papers(
    joints: int, driven: int
) -> None:
    problem = Problem.load("topological").for_robot(robot(joints, driven))
    assert problem.motors.driven == tuple(range(driven))
    assert [part.name for part in problem.parts] == [f"leg {n + 1}" for n in range(driven)]
    assert problem.sensors == driven
    assert problem.source == TEXT
    assert not problem.check_robot(robot(joints, driven), ("touch", "tilt", "clearance"))


def test_a_problem_for_the_same_robot_is_the_same() -> None:
    problem = Problem.load("topological")
    assert problem.for_robot(robot(8, 4)) is problem
    parametric = Problem.load("parametric")
    assert parametric.for_robot(robot(9, 4)).parts == parametric.parts


@pytest.mark.parametrize(
    ("parents", "touch", "sensors"),
    [
        ((-1, -1, -1, -1), 4, [0, 1, 2, 3]),
        ((-1, 0, 1, 2), 4, [0, 1, 2, 3]),  # one each, wherever the parts sit
        ((-1, -1, 0, -1), 3, [None, 0, 1, 2]),  # the first carries the third
        ((-1, -1, -1, 1), 3, [0, None, 1, 2]),
        ((-1, 0, 1, 2), 2, [0, None, None, 1]),  # one outermost part, then the first other
        ((-1, -1, -1, -1), 2, [0, 1, None, None]),
        ((-1, -1, -1, -1), 0, [None] * 4),
    ],
)
def test_touch_sensors_sit_outermost(
    parents: tuple[int, ...], touch: int, sensors: list[int | None]
) -> None:
    capabilities = robot(4, touch)
    problem = Problem.load("topological").for_robot(capabilities)
    genome = Genome(problem, problem.base(capabilities))
    body = genome.decode(np.full(16, 0.5))
    parts = [replace(part, parent=parent) for part, parent in zip(body.parts, parents, strict=True)]
    assert [part.sensor for part in genome.assemble(parts).parts] == sensors
    assert body.sensors == touch


def test_more_sensors_than_legs_are_refused() -> None:
    capabilities = robot(3, 4)
    with pytest.raises(ProblemError, match="has 4 touch sensors, but problem 'topological' descr"):
        Problem.load("topological").for_robot(capabilities).check_robot(capabilities, ("touch",))


@pytest.mark.parametrize(
    ("name", "reason"), [("topological-20", "joint 5"), ("topological-24", "drives joint 5")]
)
def test_eight_parts_need_eight_joints(name: str, reason: str) -> None:
    capabilities = robot(4, 4)
    with pytest.raises(ProblemError, match=f"{reason}.*has only 4 joints: choose another"):
        Problem.load(name).for_robot(capabilities).check_robot(capabilities, ("tilt",))


def test_a_table_without_the_robot_at_hand_is_refused() -> None:
    text = TEXT.replace(DRIVEN, "driven = { 3 = [1, 3] }")
    problem = Problem.parse(text, "mine.toml")  # as good as any, as long as there is no robot
    assert problem.motors.driven == (0, 2)
    assert [part.motor for part in problem.parts] == [0, 2]
    with pytest.raises(ProblemError, match=r"^mine.toml: motors.driven: says nothing of .* 5 joi"):
        problem.for_robot(robot(5, 2))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('other = "all" }', 'others = "all" }', "'others' must be a number of joints or 'other'"),
        ('other = "all" }', 'other = "most" }', ""),
        (DRIVEN, 'driven = "hips"', 'motors.driven: must be a list of joints or "all", not \'hip'),
        (DRIVEN, "driven = { 8 = [] }", "motors.driven"),
        (DRIVEN, "driven = { 8 = [9.5] }", r"motors.driven\[1\]: must be an integer"),
        (DRIVEN, "driven = [1, 1]", "exactly one part"),
        (
            'each = "driven"',
            'each = "joint"',
            r"parts\[1\].each .*: must be \"driven\", not 'joint'",
        ),
        ('each = "driven"', 'each = "driven"\nmotor = 1', r"parts\[1\].motor .*: follows from"),
        ('each = "driven"', 'each = "driven"\nsensor = 1', 'say touch = "outermost"'),
        ('touch = "outermost"', 'touch = "feet"', "touch: .*'outermost'"),
        (
            "length = [0.02, 0.40]",
            "length = [0.40, 0.02]",
            r"parts\[1\].length .*: the lowest must",
        ),
        (
            "radius = 0.006",
            "radius = 0.5",
            r"parts\[1\] .*: radius 0.5 m must lie below the length",
        ),
        ("[-30.0, 30.0]", "[-300.0, 30.0]", "motors.range_deg: must lie within -180 to 180"),
        ("population = 300", "population = 301", "population: must be even, not 301"),
        ('parent = "unknown"', "parent = 1", r"\(leg 1\): its parent 1 is no earlier part"),
    ],
)
def test_wrong_files_are_refused_once_with_key_and_reason(old: str, new: str, reason: str) -> None:
    assert old in TEXT
    wrong = TEXT.replace(old, new, 1)
    if not reason:
        Problem.parse(wrong, "mine.toml")  # what it says of other robots is not looked at yet
        with pytest.raises(ProblemError, match="not 'most'"):
            Problem.parse(wrong, "mine.toml", Inventory(joints=3, touch_sensors=3))
        return
    with pytest.raises(ProblemError, match=f"^mine.toml.*{reason}") as caught:
        Problem.parse(wrong, "mine.toml")
    assert str(caught.value).count("parts[1]") <= 1


LITERAL = Problem.load("topological-20").source


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("locked = 5", "locked = 5\nmotor = 5", r"parts\[5\] .*: a joint is either driven"),
        ("locked = 5", "locked = 1", r"each joint carries one part, but \[1, 2, 3, 4\] are"),
        ("locked = 5", "locked = 6", "each joint carries one part"),
        ("[1, 2, 3, 4]", "[1, 2, 3, 4, 5, 6, 7, 8, 9]", "must move exactly one part"),
        ("[motors]", 'touch = "outermost"\n[motors]', "touch: say where the sensors are either"),
        ('parent = "unknown"', "parent = 3", "its parent 3 is no earlier part: list parents"),
    ],
)
def test_contradictions_are_refused(old: str, new: str, reason: str) -> None:
    assert old in LITERAL
    with pytest.raises(ProblemError, match=reason):
        Problem.parse(LITERAL.replace(old, new, 1), "mine.toml")


def test_parts_in_a_ring_are_refused() -> None:
    ring = LITERAL.replace('parent = "unknown"', "parent = 2", 1)
    ring = ring.replace('name = "part 2"\nparent = "unknown"', 'name = "part 2"\nparent = 1')
    with pytest.raises(ProblemError, match=r"parts\[1\] \(part 1\): its parent 2 is no earlier"):
        Problem.parse(ring, "ring.toml")


def test_some_attachments_may_be_known() -> None:
    """Lower parts that are known to be the uppers' ends."""
    text = LITERAL
    for number in range(1, 5):
        table = f'name = "part {number + 4}"\nparent = "unknown"\nmount = "unknown"'
        assert table in text
        text = text.replace(
            table, table.replace('"unknown"', str(number), 1).replace('"unknown"', '"front"', 1)
        )
    problem = Problem.parse(text, "known.toml")
    genome = Genome(problem, problem.base(robot(8, 4)))
    assert genome.size == 32 - 8
    body = genome.decode(np.full(24, 0.9))
    assert [part.parent for part in body.parts[4:]] == [0, 1, 2, 3]
    assert BASE not in {part.parent for part in body.parts[1:]}


def test_the_world_of_the_models_can_be_chosen() -> None:
    silent = Problem.parse(TEXT, "mine.toml").settings(robot(4, 4))
    assert (silent.steps, silent.step, silent.friction) == (300, 1 / 60, 0.7)
    chosen = TEXT.replace("[[parts]]", "[world]\nstep_s = 0.01\nfriction = 1.0\n\n[[parts]]")
    settings = Problem.parse(chosen, "mine.toml").settings(robot(4, 4))
    assert (settings.steps, settings.step, settings.friction) == (300, 0.01, 1.0)
    assert settings.clearance_cap == 0.2


def test_readings_by_hand_of_a_robot_with_three_legs(tmp_path: Path) -> None:
    (tmp_path / "readings.csv").write_text(
        "angle_deg_a,angle_deg_b,angle_deg_c,touch_1,touch_2,touch_3,tilt_lr_deg,clearance_mm\n"
        "-20,-20,-20,1,1,1,0,20\n"
        "10,-25,-15,0,1,1,-9,15\n"
    )
    (tmp_path / "robot.json").write_text('{"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6}')
    order = RunConfig(
        robot=f"file:{tmp_path}/readings.csv",
        problem="topological",
        method="paper",
        seed=1,
        population=4,
        generations=1,
    )
    result = identify(tmp_path / "run", order, IN_THIS_PROCESS, Listener(), report=without_plots)
    assert result.complete
    assert result.interactions == 2
    assert [part.joint for part in result.best_models[0].parts] == ["a", "b", "c"]
    assert len(result.searched) == 12


def test_the_manual_tells_the_truth() -> None:
    manual = Path("docs/problems.md").read_text("utf-8")
    example = manual.split("```toml\n")[1].split("```")[0]
    problem = Problem.parse(example, "mine.toml")
    genome = Genome(problem, problem.base(robot(3, 3)))
    assert [gene.name for gene in genome.genes] == [
        "length of left leg",
        "hinge of front leg",
        "length of front leg",
    ]
    assert not problem.check_robot(robot(3, 3), ("touch", "tilt", "clearance"))
    changes = (
        ("length = 0.18", "length = [0.4, 0.02]"),
        ("parent = 0", "parent = 3"),
        ("population = 40", "population = 99"),
        ("driven = [1, 2, 3]", "driven = [1, 2, 3, 4]"),
    )
    for old, new in changes:
        with pytest.raises(ProblemError) as caught:
            Problem.parse(example.replace(old, new, 1), "mine.toml")
        assert f"estimator: {caught.value}\n" in manual
    library = resources.files("estimator") / "problem" / "library"
    for file in library.iterdir():
        assert f"`{file.name.removesuffix('.toml')}`" in manual.split("## A complete example")[0]


def test_the_manual_tells_of_mounts_and_hinges() -> None:
    manual = Path("docs/problems.md").read_text("utf-8")
    example, tables, tail = (block.split("```")[0] for block in manual.split("```toml\n")[1:4])
    head, _, rest = example.partition("[motors]")
    text = f"{head}{tables}\n[motors]{rest}"
    alone = text.partition("[[parts]]")[0].replace("[1, 2, 3]", "[1]") + tail
    problem = Problem.parse(alone, "mine.toml")
    body = Genome(problem, problem.base(robot(3, 3))).decode(np.zeros(1))
    assert body.place(0) == (-0.07, 0.02, 0.0)
    known = text.replace('hinge = "up"', 'hinge = "aslant"')
    doubled = re.sub(r'mount = "(left|front|back)"', 'mount = "left front"', known)
    zero = text.replace("axis = [0.0, -1.0, 1.0]", "axis = [0, 0, 0]")
    for wrong in (text, doubled, zero):
        with pytest.raises(ProblemError) as caught:
            Problem.parse(wrong, "mine.toml")
        assert f"estimator: {caught.value}\n" in manual


@pytest.mark.parametrize("joints", [1, 5, 18, 24])
def test_all_joints_of_any_robot_may_be_driven(joints: int) -> None:
    problem = Problem.load("topological").for_robot(robot(joints, min(joints, 6)))
    assert problem.motors.driven == tuple(range(joints))
    assert len(problem.parts) == joints
    assert problem.program_range(robot(joints, 6)).shape == (joints, 2)
    fixed = Problem.load("hexapod-18")
    if joints != 18:
        with pytest.raises(
            ProblemError, match=r"^hexapod-18: .*each driven joint must move exactly"
        ):
            fixed.for_robot(robot(joints, 6))


def here(name: str, settings: WorldSettings) -> Physics:
    return PyBulletPhysics(settings)
