"""Problem files: what ships, and how wrong ones are refused."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.errors import ProblemError
from estimator.problem.operators import GaussianMutation, UniformCrossover
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities, Joint, Sensor
from tests.estimator.model_robot import PROBLEM, make_capabilities

TEXT = Problem.load("parametric").source
NAMES = ("hip_left", "hip_front", "hip_right", "hip_back", "knee_l", "knee_f", "knee_r", "knee_b")


def robot() -> Capabilities:
    return Capabilities(
        robot="quadruped",
        software="test 1",
        config_hash="0",
        base_size=(0.14, 0.14, 0.085),
        base_mass=0.6,
        part_radii=(0.013,) * 4 + (0.006,) * 4,
        joints=tuple(
            Joint(name=name, lower=-1.6, upper=1.2, speed=math.radians(60), resolution=0.01)
            for name in NAMES
        ),
        sensors=(
            Sensor(modality="touch", unit="bool", count=4, noise=0.0, rate=50.0),
            Sensor(modality="tilt", unit="rad", count=2, noise=0.005, rate=50.0),
            Sensor(modality="clearance", unit="m", count=1, noise=0.001, rate=50.0, upper=0.15),
        ),
        telemetry="tcp://*:5751",
        telemetry_rate=2.0,
    )


def test_parametric_is_the_papers() -> None:
    problem = Problem.load("parametric")
    search = problem.search
    assert (search.population, search.generations, search.interactions) == (100, 10, 4)
    assert problem.motors.driven == (0, 1, 2, 3)
    assert [part.length for part in problem.parts] == [(0.01, 0.20)] * 8
    assert [part.motor for part in problem.parts] == [0, 1, 2, 3, None, None, None, None]
    assert [part.sensor for part in problem.parts] == [None] * 4 + [0, 1, 2, 3]


def test_a_file_is_read_and_remembers_its_text(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = TEXT.replace(
        'crossover = { kind = "blend", alpha = 0.5 }', 'crossover = { kind = "uniform" }'
    ).replace("sigma = 0.05", "sigma = 0.1, rate = 0.5")
    path.write_text(text, "utf-8")
    problem = Problem.load(str(path))
    assert problem.source == text
    operators = problem.search.operators()
    assert operators.crossover == UniformCrossover()
    assert operators.mutation == GaussianMutation(sigma=0.1, rate=0.5)


def test_a_missing_problem_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"no problem named 'parametrik': give one of .*param"):
        Problem.load("parametrik")
    with pytest.raises(ProblemError, match=r"none\.toml cannot be read: No such file"):
        Problem.load(str(tmp_path / "none.toml"))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ProblemError, match="no UTF-8 text"):
        Problem.load(str(tmp_path / "binary.toml"))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("[search]", "[search", "no valid TOML"),
        ("density", "weight", "density: is missing; weight: is no key"),
        ("density = 1000.0", 'density = "water"', "density: .*number"),
        ("density = 1000.0", "density = inf", "density: .*finite"),
        ("population = 100", "population = 99", "search.population: must be even, not 99"),
        ("population = 100", "population = 0", "search.population"),
        ("generations = 10", "generations = 2.5", "search.generations"),
        ('= { kind = "blend"', '= { kind = "blond"', "search.crossover: .*'uniform', 'blend'"),
        ("alpha = 0.5", "alpha = -1", "search.crossover.blend.alpha: must be at least 0, not -1"),
        ("alpha = 0.5", "alpha = inf", "search.crossover.blend.alpha: must be finite"),
        ("alpha = 0.5", "rate = 1.5", "search.crossover.blend.rate: must be at most 1, not 1.5"),
        ("alpha = 0.5", "alfa = 0.5", "alfa"),
        ("sigma = 0.05", "rate = -0.1", "mutation.gaussian.rate: must be at least 0, not -0.1"),
        ("sigma = 0.05", "sigma = -1.0", "mutation.gaussian.sigma: must be at least 0, not -1.0"),
        ("driven = [1, 2, 3, 4]", "driven = []", "motors.driven"),
        ("driven = [1, 2, 3, 4]", "driven = [0, 1, 2, 3, 4]", r"driven\[1\]: .*at least 1, not 0"),
        ("driven = [1, 2, 3, 4]", "driven = [1, 2, 3, 4, 5]", "exactly one part"),
        ("driven = [1, 2, 3, 4]", "driven = [1, 2, 3, 3, 4]", "exactly one part"),
        ("[-30.0, 30.0]", "[30.0, -30.0]", "motors.range_deg: the lowest must lie below"),
        ("slew_deg_per_s = 60.0", "slew_deg_per_s = 0.0", "motors.slew_deg_per_s"),
        ('"left upper"', '"front upper"', "a name of its own"),
        ("parent = 0", "parent = 9", r"parts\[1\] \(left upper\): its parent 9 is no earlier"),
        ("parent = 0", "parent = 1", "its parent 1 is no earlier part"),
        ("parent = 0", "parent = -1", r"parts\[1\].parent .*: must be 0 \(the main body\)"),
        ("parent = 0\n", "", r"parts\[1\].parent .*: is missing"),
        ('mount = "left"', 'mount = "above"', "'back', 'unknown', not 'above'"),
        ('mount = "left"', 'mount = "{above}"', "'back', 'unknown', not '{above}'"),
        ("[0.01, 0.20]", '"{0}"', r"must be a number or \[lowest, highest\], not '{0}'"),
        (
            'hinge = "up"',
            'hinge = "ball"',
            "parts.1..hinge .left upper.: must be one of 'yaw_left'",
        ),
        ("[0.01, 0.20]", "[0.20, 0.01]", r"parts\[1\].length .*: the lowest must lie below"),
        ("[0.01, 0.20]", "[0.10, 0.10]", r"parts\[1\].length .*: the lowest must lie below"),
        ("[0.01, 0.20]", "[0.0, 0.20]", "must lie in 0.0001"),
        ("[0.01, 0.20]", "[10, 200]", "0.0001 to 10 m"),
        ("[0.01, 0.20]", "[0.01]", r"must be a number or \[lowest, highest\]"),
        ("[0.01, 0.20]", "true", "must be a number"),
        ("radius = 0.013", "radius = -0.013", r"parts\[1\].radius .* 0.0001 to 10 m, not -0.013"),
        ("[-30.0, 30.0]", "30.0", r"range_deg: must be \[lowest, highest\], like \[-30, 30\], not"),
        ('kind = "blend", ', "", "search.crossover: must say of which 'kind' it is"),
        ("driven = [1, 2, 3, 4]", "driven = 3", "motors.driven: must be a list, .*, not 3"),
        ("density = 1000.0", "density = 1000.0\nhinges = 1", r"with \[\[hinges\]\] above each"),
        ("density = 1000.0", "density = 1000.0\nworld = 1", "world: must be a table of keys and"),
        (
            "radius = 0.013",
            'radius = 0.013\nshape = "cube"',
            r"parts\[1\].shape .left upper.: must be 'capsule' or 'box', not",
        ),
        ("sensor = 1", "sensor = 2", "sensors must be numbered 1, 2"),
        ("sensor = 1", "sensor = 1.0", r"parts\[5\].sensor .*: must be an integer"),
    ],
)
def test_wrong_files_are_refused_with_key_and_reason(old: str, new: str, reason: str) -> None:
    assert old in TEXT
    with pytest.raises(ProblemError, match=f"^mine.toml.*{reason}"):
        Problem.parse(TEXT.replace(old, new, 1), "mine.toml")


def test_parts_that_are_all_wrong_are_not_said_to_be_missing() -> None:
    with pytest.raises(ProblemError) as refusal:
        Problem.parse(TEXT.replace("[0.01, 0.20]", "[10, 200]"), "mine.toml")
    assert str(refusal.value).count("must lie in") == 8
    assert "at least one" not in str(refusal.value)


def test_what_only_the_papers_method_looks_at_may_be_left_out() -> None:
    text = TEXT.replace("population = 100", "").replace("generations = 10", "")
    settings = Problem.parse(text, "mine.toml").search
    assert (settings.population, settings.generations) == (100, 10)


def test_an_editors_byte_order_mark_is_no_part_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(TEXT, encoding="utf-8-sig")
    assert Problem.load(str(tmp_path / "mine.toml")).parts == Problem.parse(TEXT, "mine.toml").parts


def test_a_problem_must_leave_something_to_be_found() -> None:
    with pytest.raises(ProblemError, match="nothing to be found"):
        Problem.parse(TEXT.replace("[0.01, 0.20]", "0.1"), "known.toml")


def test_what_no_reading_can_show_is_nothing_to_be_found() -> None:
    known = TEXT.replace("[0.01, 0.20]", "0.1")

    def with_unknown(part: str, trait: str) -> str:
        rows = rf'(name = "{part}"\n(?:.*\n)*?{trait} = ).*'
        return re.sub(rows, r'\1"unknown"', known, count=1)

    for text in (
        with_unknown("left lower", "hinge"),  # no motor moves it
        with_unknown("left upper", "parent"),  # it can sit on the main body alone
    ):
        with pytest.raises(ProblemError, match="nothing to be found"):
            Problem.parse(text, "hidden.toml")
    for text in (with_unknown("left upper", "hinge"), with_unknown("left lower", "parent")):
        assert Problem.parse(text, "open.toml").parts


def test_random_programs_move_only_driven_joints_within_range_and_limits() -> None:
    problem = Problem.load("parametric")
    rng = np.random.default_rng(0)
    stiff = replace(robot().joints[1], lower=math.radians(-10))
    limited = replace(robot(), joints=(robot().joints[0], stiff, *robot().joints[2:]))
    programs = np.degrees([problem.random_program(rng, limited) for _ in range(400)])
    assert programs.shape == (400, 8)
    assert not programs[:, 4:].any()
    assert programs[:, 0].min() == pytest.approx(-30, abs=1)
    assert programs[:, 0].max() == pytest.approx(30, abs=1)
    assert -10 <= programs[:, 1].min() < -9


def test_what_the_robot_makes_public_is_taken_from_it() -> None:
    problem = Problem.load("parametric")
    assert problem.base(robot()).mass == 0.6
    settings = problem.settings(robot())
    assert settings.clearance_cap == 0.15
    assert settings.slew == pytest.approx(math.radians(60))
    blind = replace(robot(), sensors=robot().sensors[:2])
    assert problem.settings(blind).clearance_cap == 0.2


def test_a_fitting_robot_raises_no_eyebrows() -> None:
    assert not Problem.load("parametric").check_robot(robot(), ("touch", "tilt", "clearance"))


def test_a_robot_that_differs_is_reported() -> None:
    other = replace(robot(), part_radii=(0.013,) * 4 + (0.012,) * 4)
    slow = replace(robot().joints[0], speed=math.radians(30))
    other = replace(other, joints=(slow, *robot().joints[1:]))
    sentences = Problem.load("parametric").check_robot(other, ("tilt",))
    assert sentences == (
        "joint hip_left moves at 30.0 degrees per second, the models at 60",
        "the robot states a radius of 12.0 mm for left lower, front lower, right lower, "
        "back lower, and the problem 6.0 mm: write radius = 0.012 there, or its lengths will be "
        "wrong",
    )


@pytest.mark.parametrize(
    ("upper", "lower", "differs", "contradicts"),
    [(13, 6, 0, 0), (13, 7, 1, 0), (13, 9, 1, 1), (20, 6, 1, 0)],
)
def test_a_radius_far_from_the_robots_is_a_contradiction_where_it_touches_the_ground(
    upper: int, lower: int, differs: int, contradicts: int
) -> None:
    problem = Problem.load("parametric")
    stated = replace(robot(), part_radii=(upper / 1000,) * 4 + (lower / 1000,) * 4)
    assert len(problem.differences(stated)) == differs
    assert len(problem.contradictions(stated)) == contradicts


def test_a_robot_that_states_no_radius_differs_in_none() -> None:
    silent = replace(robot(), part_radii=None)
    assert not Problem.load("parametric").check_robot(silent, ("touch", "tilt", "clearance"))


def test_a_robot_that_cannot_serve_is_refused() -> None:
    problem, sensors = Problem.load("parametric"), robot().sensors
    with pytest.raises(ProblemError, match="drives joint 4, but robot 'quadruped' has only 3"):
        problem.check_robot(
            replace(robot(), joints=robot().joints[:3], part_radii=(0.01,) * 3), ("tilt",)
        )
    far = replace(robot().joints[2], lower=1.0)
    with pytest.raises(ProblemError, match=r"outside the limits of joint 'hip_right', 57\.3 to"):
        problem.check_robot(
            replace(robot(), joints=(*robot().joints[:2], far, *robot().joints[3:])), ("tilt",)
        )
    slow = Problem.parse(TEXT.replace("slew_deg_per_s = 60.0", "slew_deg_per_s = 5.0"), "slow.toml")
    with pytest.raises(ProblemError, match="30 degrees at 5 degrees per second take 6 s, and a"):
        slow.check_robot(robot(), ("tilt",))
    with pytest.raises(ProblemError, match="has no clearance sensor"):
        problem.check_robot(replace(robot(), sensors=sensors[:2]), ("tilt", "clearance"))
    with pytest.raises(ProblemError, match=r"no sensors.*start robotd without --dry"):
        problem.check_robot(replace(robot(), sensors=()), ("tilt",))
    three = replace(sensors[0], count=3)
    with pytest.raises(ProblemError, match="has 3 touch sensors, but problem 'parametric' desc"):
        problem.check_robot(replace(robot(), sensors=(three, *sensors[1:])), ("touch",))


@pytest.mark.parametrize("value", ["[" * 5000, "9" * 400, "9" * 5000])
def test_what_no_parser_should_meet_is_a_sentence(value: str) -> None:
    with pytest.raises(ProblemError, match="is no valid TOML"):
        Problem.parse(f"density = {value}", "test")


@pytest.mark.parametrize("driven", ['"all"', '{ other = "all" }', '{ 3 = "all" }'])
def test_all_joints_may_be_driven_with_explicit_parts(driven: str) -> None:
    head, *parts = PROBLEM.split("[[parts]]")
    text = "[[parts]]".join([head.replace("[1, 2, 3, 4]", driven), *parts[:3]])
    problem = Problem.parse(text, "test")
    assert problem.motors.driven == (0, 1, 2)
    robot = make_capabilities()
    with pytest.raises(ProblemError, match=r"motors\.driven"):
        problem.for_robot(robot)
    three = replace(robot, joints=robot.joints[:3], part_radii=None)
    assert len(problem.for_robot(three).parts) == 3


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("density = 1000.0", "density = 1e6", r"density: must lie in 1 to 25000 kg/m³"),
        ("density = 1000.0", "density = 0.001", r"density: must lie in 1 to 25000 kg/m³"),
        ("[0.05, 0.25]", "[50.0, 250.0]", r"parts\[1\]\.length .*: must lie in 0\.0001 to 10 m"),
        ("[0.05, 0.25]", "[0.00005, 0.00025]", r"parts\[1\]\.length .*: must lie in 0\.0001 to"),
        ("radius = 0.006", "radius = 6e-6", r"parts\[1\]\.radius .*: must lie in 0\.0001 to 10 m"),
        ("radius = 0.006", "radius = 13.0", r"parts\[1\]\.radius .*: must lie in 0\.0001 to 10 m"),
    ],
)
def test_slips_of_the_unit_are_refused(old: str, new: str, sentence: str) -> None:
    with pytest.raises(ProblemError, match=sentence):
        Problem.parse(PROBLEM.replace(old, new, 1), "test")
