"""What the doctor says of a problem before a robot has moved."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from estimator.cli.command_line import app
from estimator.cli.findings import ExaminedItem, Fitness
from estimator.cli.problem_doctor import examine_problem
from protocol.wire.capabilities import Capabilities
from tests.estimator.model_robot import PROBLEM, make_capabilities

ALL = ("touch", "tilt", "clearance")


def examined(
    problem: str | Path, robot: Capabilities | None = None, modalities: tuple[str, ...] = ALL
) -> list[ExaminedItem]:
    return list(examine_problem(str(problem), robot, modalities))


def said(items: list[ExaminedItem], subject: str) -> str:
    return " ".join(item.sentence for item in items if item.subject == subject)


def written(folder: Path, text: str) -> Path:
    file = folder / "problem.toml"
    file.write_text(text, encoding="utf-8")
    return file


def lacking(*modalities: str) -> Capabilities:
    robot = make_capabilities()
    sensors = tuple(one for one in robot.sensors if one.modality not in modalities)
    return replace(robot, sensors=sensors)


def test_bodies_are_counted_and_movements_foreseen() -> None:
    items = examined("topological")
    assert {item.verdict for item in items} == {Fitness.FINE, Fitness.NOTE}
    assert "7,962,624 ways to attach its parts (23 bits) and 4 lengths" in said(items, "bodies")
    # 4! parents, 4 sides and 6 hinges each; found after five or six movements (docs/accuracy.md).
    assert "attachments take about 5 movements" in said(items, "movements")
    assert said(items, "robot") == (
        "None is given: one with 8 joints of ±90°, touch, tilt and clearance and the paper's main "
        "body, 140 x 140 x 85 mm and 0.6 kg, is supposed. With --robot it is yours."
    )


@pytest.mark.parametrize(
    ("legs", "hinge", "ways"),
    [
        (5, "unknown", "933,120 ways to attach its parts (20 bits)"),  # 5! places, six hinges each
        (16, "up", "2.1e+13 ways to attach its parts (44 bits)"),  # 16! places
    ],
)
def test_ways_are_counted_where_each_leg_has_a_mount_of_its_own(
    tmp_path: Path, legs: int, hinge: str, ways: str
) -> None:
    text = re.sub("driven = [^]]*]", 'driven = "all"', PROBLEM[: PROBLEM.index("[[parts]]")])
    text += "share_mounts = false\n" + "".join(
        f'[[mounts]]\nname = "m{leg}"\nat = [{0.07 - 0.14 * leg / legs:.3f}, 0.07, 0.0]\n'
        f'yaw_deg = 90.0\n[[parts]]\nname = "leg {leg}"\nparent = 0\nmount = "unknown"\n'
        f'hinge = "{hinge}"\nlength = [0.05, 0.2]\nradius = 0.005\nmotor = {leg}\n'
        for leg in range(1, legs + 1)
    )
    items = examined(written(tmp_path, text))
    assert f"To be found: {ways} and {legs} lengths" in said(items, "bodies")
    assert "attachments take about" in said(items, "movements")


@pytest.mark.parametrize(
    ("scale", "body"),
    [
        (0.01, "20 x 16 x 11 mm and 0.0013 kg"),
        (1.0, "2000 x 1600 x 1086 mm and 1300 kg"),
    ],
)
def test_the_main_body_that_is_supposed_is_no_larger_than_its_mounts_say(
    tmp_path: Path, scale: float, body: str
) -> None:
    """Legs of half its length or more could not reach the ground past the paper's."""
    corners = [(1.0, 0.8, 45.0), (1.0, -0.8, -45.0), (-1.0, 0.8, 135.0), (-1.0, -0.8, -135.0)]
    text = re.sub(r"^sensor = .*\n", "", PROBLEM, flags=re.MULTILINE)
    text = re.sub("mount = .*", 'mount = "unknown"', text)
    text = re.sub("length = .*", f"length = [{scale}, {4 * scale}]", text)
    text = re.sub("radius = .*", f"radius = {0.1 * scale}", text)
    mounts = "".join(
        f'[[mounts]]\nname = "m{yaw}"\nat = [{scale * x}, {scale * y}, 0.0]\nyaw_deg = {yaw}\n'
        for x, y, yaw in corners
    )
    items = examined(written(tmp_path, f'touch = "outermost"\n{text}{mounts}'))
    assert (
        f"touch, tilt and clearance and a main body that fits its mounts, {body}, is supposed"
        in said(items, "robot")
    )
    assert "a good movement tells" in said(items, "movements")
    assert "nobody can tell" not in said(items, "unknowns")


def test_mounts_on_one_side_say_nothing_of_the_main_bodys_size(tmp_path: Path) -> None:
    mount = '\n[[mounts]]\nname = "{0}"\nat = [0.01, 0.0, 0.05]\nyaw_deg = 90.0\n'
    text = PROBLEM + "".join(map(mount.format, ("left", "front", "right", "back")))
    robot = said(examined(written(tmp_path, text)), "robot")
    assert "and a main body that fits its mounts, 140 x 140 x 100 mm and 0.71 kg, is" in robot


def test_what_is_allowed_is_counted_where_mounts_are_not_shared() -> None:
    # 6! places of legs on the body, three on each leg, and four hinges a part
    assert f"{720 * 3**6 * 4**12:.1e} ways" in said(examined("hexapod-12"), "bodies")


def test_ways_that_are_estimated_are_called_so(tmp_path: Path) -> None:
    """A part sits in front of the body or of others, where others sit on any side."""
    text = PROBLEM.replace("[[parts]]", "share_mounts = false\n[[parts]]", 1)
    for name, parent, mount in (("left", 0, "unknown"), ("front", 1, "unknown")):
        text = text.replace(
            f'parent = 0\nmount = "{name}"', f'parent = {parent}\nmount = "{mount}"'
        )
    text = text.replace('parent = 0\nmount = "right"', 'parent = "unknown"\nmount = "front"')
    text = text.replace('hinge = "up"', 'hinge = "unknown"')
    bodies = said(examined(written(tmp_path, text)), "bodies")
    (thousands,) = re.findall(r"To be found: about (\d\d),000 ways", bodies)
    # the last part's mount is taken; the third leaves a mount less to one of the first, or to none
    places = 2 * 4 + 3 * 3 + 3 * 4
    assert int(thousands) == pytest.approx(places * 6**4 / 1000, abs=1)


def test_the_hinges_of_locked_parts_show_nowhere() -> None:
    items = examined("topological-20")
    assert (
        "nobody can tell: hinge of part 5, hinge of part 6, hinge of part 7, hinge of part 8."
        in (said(items, "unknowns"))
    )


def test_what_a_missing_sensor_would_tell_is_said() -> None:
    items = examined("topological", modalities=("touch", "clearance"))
    assert "turned by a quarter or a half, or mirrored" in said(items, "unknowns")
    assert "With an accelerometer a movement would tell" in said(items, "sensors")
    assert "show what nothing shows now: sides, and which way" in said(items, "sensors")
    assert "With a distance sensor" not in said(items, "sensors")


@pytest.mark.parametrize(
    ("lost", "offered"),
    [
        ("touch", "With touch sensors"),
        ("tilt", "With an accelerometer"),
        ("clearance", "With a distance sensor"),
    ],
)
def test_a_robot_that_lacks_a_sensor_is_told_what_it_would_bring(
    tmp_path: Path, lost: str, offered: str
) -> None:
    text = re.sub(r"^sensor = .*\n", "", PROBLEM, flags=re.MULTILINE)
    file = written(tmp_path, 'touch = "outermost"\n' + text)
    items = examined(file, lacking(lost))
    assert said(items, "sensors").startswith(f"{offered} a movement would tell ")
    assert said(items, "robot") == ""


def test_more_unknowns_than_movements_can_tell_is_bad(tmp_path: Path) -> None:
    text = PROBLEM.replace('hinge = "up"', 'hinge = "unknown"').replace(
        "interactions = 2", "interactions = 1"
    )
    items = examined(written(tmp_path, re.sub('mount = ".*"', 'mount = "unknown"', text)))
    (bad,) = [item for item in items if item.verdict is Fitness.BAD]
    assert "so many unknowns are more than these can tell. Give identify --interactions" in (
        bad.sentence
    )


def test_without_sensors_nothing_is_learnt(tmp_path: Path) -> None:
    text = re.sub(r"^sensor = .*\n", "", PROBLEM, flags=re.MULTILINE)
    items = examined(written(tmp_path, text), lacking(*ALL))
    assert items[-1].verdict is Fitness.BAD
    assert "has no sensors, so nothing can be learnt from it" in items[-1].sentence


@pytest.mark.parametrize(
    ("robot", "modalities", "none"),
    [
        (None, ("touch",), "touch"),
        (lacking("touch", "clearance"), ("touch", "clearance"), "touch or clearance"),
    ],
)
def test_where_only_missing_sensors_count_others_are_asked_for(
    tmp_path: Path, robot: Capabilities | None, modalities: tuple[str, ...], none: str
) -> None:
    text = re.sub(r"^sensor = .*\n", "", PROBLEM, flags=re.MULTILINE)
    (item,) = examined(written(tmp_path, text), robot, modalities)
    assert item.verdict is Fitness.BAD
    assert item.sentence == f"The robot has no {none} sensor: give other --modalities."


def test_a_part_that_cannot_move_what_is_felt_is_found_out(tmp_path: Path) -> None:
    """Legs too thin and short to lift anything, and an accelerometer alone."""
    text = re.sub(r"^sensor = .*\n", "", PROBLEM, flags=re.MULTILINE)
    text = text.replace("range_deg = [-30.0, 30.0]", "range_deg = [0.0, 30.0]")
    items = examined(written(tmp_path, text), lacking("touch", "clearance"))
    (bad,) = [item for item in items if item.verdict is Fitness.BAD]
    assert bad.sentence == "By tilt no movement tells anything of the body."


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--problem", "parametric"], 0, "lengths take about 4; the problem makes 4."),
        (["--problem", "no-such"], 1, "there is no problem named 'no-such'"),
        (["--problem", "parametric", "--modalities", "smell"], 1, "not smell"),
        ([], 2, "give --robot, --problem, or both"),
    ],
)
def test_the_command_line_says_it(arguments: list[str], code: int, words: str) -> None:
    result = CliRunner().invoke(app, ["doctor", *arguments])
    assert result.exit_code == code
    assert words in " ".join(result.output.split())


def test_a_problem_that_does_not_fit_the_robot_is_bad() -> None:
    robot = replace(make_capabilities(), joints=make_capabilities().joints[:2], part_radii=None)
    items = examined("parametric", robot)
    assert [item.verdict for item in items] == [Fitness.BAD]
    assert "has only 2 joints" in items[0].sentence


def test_what_the_robots_calibration_tightens_is_told(tmp_path: Path) -> None:
    robot = make_capabilities()
    first, *others = robot.joints
    known = replace(
        robot,
        joints=(replace(first, zero_sigma=0.003, travel_sigma=0.5), *others),
        sensors=tuple(replace(one, zero_sigma=0.001, gain_sigma=0.004) for one in robot.sensors),
    )
    items = examined(written(tmp_path, f"{PROBLEM}\n[uncertain]\ndistance_gain = 0.1\n"), known)
    assert said(items, "calibration") == (
        "The robot announces its own: accelerometer_deg to 0.21 (2 rows), accelerometer_gain to "
        "0.004, distance_mm to 1, zero_deg to 0.17."
    )
    assert not said(examined(written(tmp_path, PROBLEM), robot), "calibration")
