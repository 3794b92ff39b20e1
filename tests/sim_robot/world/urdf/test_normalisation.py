"""URDF as people have it: what is taken, and as what; all that is wrong, at once."""

from __future__ import annotations

import logging
import math
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from estimator.evaluation.truth.urdf import read_urdf as read_truth
from sim_robot.command_line import main
from sim_robot.errors import BodyError
from sim_robot.simulator.electronics_sets import pc104
from sim_robot.world.body import examine, load_body
from sim_robot.world.sensor_noise import NoiseLevels
from sim_robot.world.simulation import ENGINES, open_world
from sim_robot.world.urdf.declarations import Box, vector
from tests.sim_robot.world.urdf.meshes import CORNERS, binary_stl
from tests.sim_robot.world.urdf.pieces import (
    BASE,
    INERTIAL,
    LEG,
    LIMIT,
    joint,
    taken,
    written,
)


def test_a_joint_without_end_and_without_effort_is_a_strong_servo(tmp_path: Path) -> None:
    body = taken(tmp_path, BASE, LEG, joint("continuous", "base", "leg"))
    (motor,) = body.motors
    assert (motor.lower, motor.upper) == (-math.pi, math.pi)
    assert motor.effort == pytest.approx(2 * 2 * 9.81)
    turning, effort = body.notes
    assert turning.endswith(" is taken as a servo of ±180°")
    assert effort.startswith("joint '")
    assert effort.endswith("': an effort of 0, or none, is taken as a servo of 39.2 N·m")


@pytest.mark.parametrize("above", ["", INERTIAL])
def test_what_the_main_body_is_fixed_to_says_which_way_is_up(tmp_path: Path, above: str) -> None:
    on_edge = '<collision><geometry><box size="0.05 0.14 0.2"/></geometry></collision>'
    turned = '<origin xyz="0.01 0.02 0.03" rpy="0 -1.5707963267948966 0"/>'
    body = taken(
        tmp_path,
        f'<link name="base_link">{above}</link>',
        f'<link name="trunk">{INERTIAL}{on_edge}</link>',
        LEG,
        joint("fixed", "base_link", "trunk", turned),
        joint("revolute", "trunk", "leg", f'<origin xyz="0 0 -0.12"/>{LIMIT}'),
    )
    assert body.base_size == pytest.approx((0.2, 0.14, 0.05))
    (place,) = [one for one in body.robot.joints if one.type == "revolute"]
    assert vector(place.origin.xyz) == pytest.approx((0.12, 0, 0))  # what was below is in front


@pytest.mark.parametrize(("lower", "upper"), [("0", "1.5"), ("-1.5", "0")])
def test_a_limit_may_be_0(tmp_path: Path, lower: str, upper: str) -> None:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="0"/>'
    body = taken(tmp_path, BASE, LEG, joint("revolute", "base", "leg", limit))
    assert (body.motors[0].lower, body.motors[0].upper) == (float(lower), float(upper))
    assert body.notes == ()
    config = pc104(body, NoiseLevels())
    scale = config.joints[0].scale
    assert scale.angle(scale.count(0.0)) == pytest.approx(0.0, abs=1e-9)


def test_links_without_mass_belong_to_what_they_are_fixed_to(tmp_path: Path) -> None:
    place = '<origin xyz="0 0 -0.1" rpy="0 1.5707963267948966 0"/>'
    ball = '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    body = taken(
        tmp_path,
        *('<link name="base_footprint"/>', BASE, LEG),
        joint("fixed", "base_footprint", "base", '<origin xyz="0 0 0.3"/>'),
        joint("revolute", "base", "leg", LIMIT),
        f'<link name="frame">{ball}</link>',
        f'<link name="toe">{INERTIAL.replace("0.002", "1e-4")}{ball}</link>',
        joint("fixed", "leg", "frame", place),
        joint("fixed", "frame", "toe", '<origin xyz="0 0 0.05"/>'),
    )
    assert body.base == "base"
    assert [link.name for link in body.robot.links] == ["base", "leg", "toe"]
    assert body.touch == {"leg": frozenset({"leg", "toe"})}
    leg = body.robot.links[1]
    assert vector(leg.collisions[1].origin.xyz) == pytest.approx((0, 0, -0.1))
    toe = body.robot.joints[-1]
    assert toe.parent.link == "leg"
    assert vector(toe.origin.xyz) == pytest.approx((0.05, 0, -0.1))  # z of the frame is x there
    assert [note.split("'")[1] for note in body.notes] == ["base_footprint", "frame"]


def test_a_range_without_0_is_counted_from_its_nearest_end(tmp_path: Path) -> None:
    limit = '<limit lower="-2.7" upper="-0.9" effort="1" velocity="1"/>'
    body = taken(tmp_path, BASE, LEG, joint("revolute", "base", "leg", limit))
    (motor,) = body.motors
    assert (motor.lower, motor.upper) == pytest.approx((-1.8, 0.0))
    # About -y by -0.9 rad is about y, the pitch, by 0.9.
    assert vector(body.robot.joints[0].origin.rpy) == pytest.approx((0, 0.9, 0))
    assert body.notes == (
        "joint 'base_leg' turns from -155° to -52°, without 0, where interactions begin; its angle "
        "is counted from -51.6°",
    )


def test_words_of_other_programs_are_ignored_once_and_aloud(tmp_path: Path) -> None:
    limit = LIMIT.replace("<limit", '<limit current="6" dont_collapse="true"')
    leg = LEG.replace("<collision>", "<self_filter><origin/></self_filter><collision>")
    other = LEG.replace('"leg"', '"other"')
    body = taken(
        tmp_path,
        *("<mujoco><compiler/></mujoco>", BASE, leg, other),
        joint("revolute", "base", "leg", limit),
        joint("revolute", "base", "other", limit),
    )
    assert body.notes == (
        "<mujoco> is ignored; likewise <self_filter>, attribute 'current' of <limit>, attribute "
        "'dont_collapse' of <limit>",
    )


@pytest.mark.parametrize(
    ("wrong", "right", "meant"),
    [
        ("<collision>", "<colision>", "<collision>"),
        ('effort="1"', 'efort="1"', "effort"),
        ('xyz="0 -1 0"', 'xzy="0 -1 0"', "xyz"),
    ],
)
def test_a_misspelt_word_is_not_ignored(tmp_path: Path, wrong: str, right: str, meant: str) -> None:
    text = "".join((BASE, LEG, joint("revolute", "base", "leg", LIMIT)))
    text = text.replace(wrong, right)
    if wrong == "<collision>":
        text = text.replace("</collision>", "</colision>")
    with pytest.raises(BodyError, match=f"did you mean '?{meant}'?"):
        taken(tmp_path, text)


def test_a_joint_that_follows_another_is_refused_in_one_sentence(tmp_path: Path) -> None:
    other = LEG.replace('"leg"', '"other"')
    mimic = f'{LIMIT}<mimic joint="base_leg" multiplier="2" offset="0.1"/>'
    file = written(
        tmp_path,
        *(BASE, LEG, other, joint("revolute", "base", "leg", LIMIT)),
        joint("revolute", "base", "other", mimic),
    )
    (fault,) = examine(file)[1]
    assert "joint 'base_other': follows another joint, <mimic>" in str(fault)


@pytest.mark.parametrize("weight", ["0", "0.000001"])
def test_the_main_body_is_the_first_with_a_shape_or_mass(tmp_path: Path, weight: str) -> None:
    dot = INERTIAL.replace('mass value="1"', f'mass value="{weight}"')
    body = taken(
        tmp_path,
        f'<link name="world"/><link name="dot">{dot}</link>',
        *(BASE, LEG, LEG.replace('"leg"', '"arm"')),
        joint("floating", "world", "dot"),
        joint("fixed", "dot", "base", '<origin xyz="0 0 0.3"/>'),
        joint("revolute", "base", "leg", LIMIT),
        joint("revolute", "dot", "arm", f'<origin xyz="0 0.1 0"/>{LIMIT}'),
    )
    assert body.base == "base"
    assert [motor.name for motor in body.motors] == ["base_leg", "dot_arm"]
    lie = {joint.name: vector(joint.origin.xyz) for joint in body.robot.joints}
    where = lie["dot_arm"] if weight == "0" else np.add(lie["dot_base"], lie["dot_arm"])
    assert tuple(where) == pytest.approx((0, 0.1, -0.3))
    assert "floats in 'world', as every robot does here" in body.notes[0]
    assert any("'dot'" in note or "is the main body" in note for note in body.notes[1:])


def test_a_main_body_that_is_only_drawn_is_as_it_is_drawn(tmp_path: Path) -> None:
    red = '<material name="red"><color rgba="1 0 0 1"/></material><texture/>'
    base = BASE.replace("<collision>", '<visual name="v" x="">')
    base = base.replace("</collision>", f"{red}</visual>")
    body = taken(tmp_path, base, LEG, joint("revolute", "base", "leg", LIMIT))
    assert body.base_size == (0.2, 0.1, 0.1)
    assert body.notes == ("link 'base' has no <collision>; its <visual> is taken for one",)


def test_joints_are_counted_after_what_carries_them(tmp_path: Path) -> None:
    foot = LEG.replace('"leg"', '"foot"')
    body = taken(
        tmp_path,
        *(BASE, LEG, foot),
        *(joint("revolute", "leg", "foot", LIMIT), joint("revolute", "base", "leg", LIMIT)),
    )
    assert [motor.name for motor in body.motors] == ["base_leg", "leg_foot"]
    (note,) = body.notes
    assert note.startswith("joint 'leg_foot' stands before the joint that carries it")


ROUND = (
    '<collision><origin rpy="0 1.5707963267948966 0"/><geometry>'
    '<cylinder radius="0.05" length="0.4"/></geometry></collision>'
    '<collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.02"/></geometry></collision>'
)
TURNED = BASE.replace("<geometry>", '<origin xyz="0 0 0.1" rpy="0 0 {}"/><geometry>')


@pytest.mark.parametrize(
    ("base", "size", "middle", "note"),
    [
        (f'<link name="base">{INERTIAL}{ROUND}</link>', (0.4, 0.1, 0.17), (0, 0, 0.035), "rolls"),
        (TURNED.format("0.7853981633974483"), (0.2121, 0.2121, 0.1), (0, 0, 0.1), "rolls"),
        (TURNED.format("1.5707963267948966"), (0.1, 0.2, 0.1), (0, 0, 0.1), "without the turn"),
    ],
)
def test_a_main_body_that_is_not_one_box_is_the_box_around_it_and_what_that_costs_is_said(
    tmp_path: Path,
    base: str,
    size: tuple[float, float, float],
    middle: tuple[float, float, float],
    note: str,
) -> None:
    body = taken(tmp_path, base, LEG, joint("revolute", "base", "leg", LIMIT))
    assert body.base_size == pytest.approx(size, abs=1e-4)
    assert body.base_center == pytest.approx(middle)
    extents = " × ".join(f"{1000 * extent:.0f}" for extent in size)
    (said,) = body.notes
    assert said.startswith("link 'base' is ")
    assert extents in said
    assert note in said
    (box,) = body.robot.links[0].collisions  # what is announced is what is simulated,
    assert box.geometry.shape == Box(size=" ".join(map(repr, body.base_size)))
    printed = tmp_path / "printed.urdf"  # printed, and what scores are taken against
    printed.write_text(body.urdf)
    assert load_body(printed).notes == ()
    assert read_truth(printed).main_body == (body.base_size, body.base_center, False)


@pytest.mark.parametrize("turn", ["0 0 1", "3.141592653589793 0 0"])
def test_an_upright_cylinder_is_a_round_main_body(tmp_path: Path, turn: str) -> None:
    shape = f'<origin xyz="0 0 0.1" rpy="{turn}"/><geometry><cylinder radius="0.07" length="0.03"/>'
    base = f'<link name="base">{INERTIAL}<collision>{shape}</geometry></collision></link>'
    body = taken(tmp_path, base, LEG, joint("revolute", "base", "leg", LIMIT))
    assert body.notes == ()
    assert body.base_size == (0.14, 0.14, 0.03)
    assert body.base_radius == 0.07
    printed = tmp_path / "printed.urdf"
    printed.write_text(body.urdf)
    assert read_truth(printed).main_body == (body.base_size, (0.0, 0.0, 0.1), True)


@pytest.mark.parametrize("values", [("0.7", "-0.2"), ("-1000", "1000"), ("-90", "45"), ("0", "90")])
def test_limits_that_are_hardly_radians_are_cut_and_said_once(
    tmp_path: Path, values: tuple[str, str]
) -> None:
    lower, upper = sorted(map(float, values))
    limit = LIMIT.replace('"-1"', f'"{lower}"').replace('"1" eff', f'"{upper}" eff')
    body = taken(
        tmp_path,
        *(BASE, LEG, LEG.replace('"leg"', '"other"')),
        *(joint("revolute", "base", leg, limit) for leg in ("leg", "other")),
    )
    ends = {(motor.lower, motor.upper) for motor in body.motors}
    assert ends == {(max(lower, -math.pi), min(upper, math.pi))}
    if upper < 1:
        assert body.notes == ()
    else:
        (note,) = body.notes
        assert note == (
            "joint 'base_leg': limit lies beyond 360° and is cut to 180°: URDF has radians; if "
            "degrees are meant, write 1.571 for 90; likewise 'base_other'"
        )


def test_a_range_in_degrees_without_0_is_refused(tmp_path: Path) -> None:
    limit = LIMIT.replace('"-1"', '"-155"').replace('"1" eff', '"-52" eff')
    with pytest.raises(BodyError, match=r"no angles in radians; for degrees, write -2.705 and -0"):
        taken(tmp_path, BASE, LEG, joint("revolute", "base", "leg", limit))


NINE = INERTIAL.replace("<inertia ", '<inertia ixy="1e-4" iyx="{}" ixz="0" izx="0" izy="0" ')


def test_a_tensor_with_nine_entries_is_taken_if_it_is_symmetric(tmp_path: Path) -> None:
    nine = BASE.replace(INERTIAL, NINE.format("1e-4")), LEG.replace(INERTIAL, NINE.format("1e-4"))
    body = taken(tmp_path, *nine, joint("revolute", "base", "leg", LIMIT))
    inertial = body.robot.links[0].inertial
    assert inertial is not None
    assert inertial.inertia is not None
    assert inertial.inertia.ixy == 1e-4
    assert "iyx" not in body.urdf
    assert body.notes == (
        "link 'base' has all nine entries of its inertia: iyx, izx, izy repeat; likewise 'leg'",
    )
    skew = BASE, LEG.replace(INERTIAL, NINE.format("-1e-4"))
    with pytest.raises(BodyError, match=r"is not symmetric: ixy is 0\.0001, iyx -0\.0001"):
        taken(tmp_path, *skew, joint("revolute", "base", "leg", LIMIT))


TURNS = joint("revolute", "base", "leg", LIMIT)
REWRITTEN = {
    "the place of a mesh": LEG.replace("<geometry>", '<origin xyz="{}"/><geometry>').replace(
        "box size", 'mesh filename="leg.stl" name'
    )
    + TURNS,
    "the scale of a mesh": LEG.replace("box size", 'mesh filename="leg.stl" scale="{}" name')
    + TURNS,
    "a joint that turns without 0": LEG
    + joint("revolute", "base", "leg", '<limit lower="1" upper="2"/><origin xyz="{}"/>'),
    "a range": LEG + joint("revolute", "base", "leg", '<limit upper="1" lower="{}"/>'),
    "the torque of a servo": LEG + joint("continuous", "base", "leg", '<limit effort="{}"/>'),
    "a link without mass": f'{LEG}<link name="foot"/>{TURNS}'
    + joint("fixed", "leg", "foot", '<origin rpy="{}"/>'),
    "what the main body is fixed to": f'{LEG}<link name="root"/>{TURNS}'
    + joint("fixed", "root", "base", '<origin rpy="{}"/>'),
    "a main body that is drawn": f'{LEG}<link name="trunk">{INERTIAL}<visual><origin xyz="{{}}"/>'
    f'<geometry><box size="1 1 1"/></geometry></visual></link>{TURNS}'
    + joint("revolute", "trunk", "base", LIMIT),
}


@pytest.mark.parametrize("what", REWRITTEN)
@pytest.mark.parametrize("text", ["0 0 -0,05", "0, 0, 0.3", "0 0", "", "x"])
def test_nothing_is_rewritten_before_it_is_checked(tmp_path: Path, what: str, text: str) -> None:
    (tmp_path / "leg.stl").write_bytes(binary_stl(CORNERS))
    with pytest.raises(BodyError, match=r"three numbers|a valid number") as caught:
        taken(tmp_path, BASE, REWRITTEN[what].format(text))
    assert "more:" not in str(caught.value)  # nothing else is wrong with it


def test_all_that_is_wrong_is_said_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = LEG.replace('box size="0.2 0.1 0.1"', 'mesh filename="leg.step"')
    (tmp_path / "leg.step").touch()
    file = written(
        tmp_path,
        *(BASE.replace('mass value="1"', 'mass value="-1"'), mesh.replace('ixx="', 'ixx="-')),
        joint("revolute", "base", "leg", LIMIT.replace('"-1"', '"2"')),
        joint("prismatic", "leg", "base"),
        "<jiont/>",
    )
    assert main(["--check", str(file)]) == 1
    lines = capsys.readouterr().out.splitlines()
    words = [
        *("leg.step is .step; write collision meshes as .stl, .obj or .dae", "mass"),
        *("'leg_base': type", "did you mean <joint>?", "'leg': inertia", "2 and 1"),
    ]
    assert len(lines) == len(words)
    assert all(any(word in line for line in lines) for word in words), lines
    with pytest.raises(ValueError, match=r"5 more: sim-robotd --check .*robot\.urdf"):
        load_body(file)


def test_what_is_taken_otherwise_is_said_aloud(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, BASE, LEG, joint("continuous", "base", "leg", LIMIT))
    assert main(["--check", str(file)]) == 0
    assert capsys.readouterr().out == (
        "note: joint 'base_leg' turns without end and is taken as a servo of ±180°.\n"
        "r: 1 joints, touch at leg.\n"
    )
    assert main(["--body", str(file), "--print-body"]) == 0
    printed = tmp_path / "printed.urdf"
    printed.write_text(capsys.readouterr().out)
    again = load_body(printed)
    assert again.notes == ()
    assert again.motors == load_body(file).motors
    assert [item.name for item in read_truth(printed).joints] == ["base_leg"]


@pytest.mark.parametrize(
    ("name", "joints", "sensors"),
    [
        ("laikago/laikago.urdf", 12, 4),
        ("laikago/laikago_toes.urdf", 12, 4),
        ("mini_cheetah/mini_cheetah.urdf", 12, 4),
        ("quadruped/spirit40.urdf", 12, 4),
        ("quadruped/vision60.urdf", 12, 4),
        ("a1/a1.urdf", 12, 4),
        ("aliengo/aliengo.urdf", 12, 4),
    ],
)
def test_robots_of_others_lie_in_both_worlds(name: str, joints: int, sensors: int) -> None:
    data = pytest.importorskip("pybullet_data").getDataPath()
    body, faults = examine(Path(data) / name)
    assert faults == ()
    assert body is not None
    assert (len(body.motors), len(body.touch)) == (joints, sensors)
    attitudes = []
    for engine in ENGINES:
        with open_world(body, log=logging.getLogger("world"), engine=engine) as world:
            world.advance_to(0.5)
            assert world.largest_miss() < math.radians(1)
            attitudes.append(world.up())
    assert np.dot(attitudes[0], attitudes[1]) > 0.99


@pytest.mark.parametrize(
    ("name", "faults", "word"),
    [
        ("r2d2.urdf", 1, "gripper_extension"),
        ("quadruped/minitaur.urdf", 1, "version '0.0'"),
    ],
)
def test_what_cannot_be_had_of_others_is_said(name: str, faults: int, word: str) -> None:
    data = pytest.importorskip("pybullet_data").getDataPath()
    body, found = examine(Path(data) / name)
    assert body is None
    assert len(found) == faults
    assert all(word in str(fault) for fault in found), found


@pytest.mark.parametrize("name", ["a1/a1.urdf", "aliengo/aliengo.urdf"])
def test_joints_counted_from_another_zero_stand_as_in_the_file(tmp_path: Path, name: str) -> None:
    """PyBullet's own reading of the file, its joints at our zeros, has the feet where we have."""
    pybullet = pytest.importorskip("pybullet")
    original = Path(pytest.importorskip("pybullet_data").getDataPath()) / name
    body = load_body(original)
    zeros = {
        name: math.radians(float(note.partition("counted from ")[2].partition("°")[0]))
        for note in body.notes
        if "counted from" in note
        for name in re.findall(r"'(\w+)'", note)
    }
    assert len(zeros) == 4
    rewritten = tmp_path / "body.urdf"
    rewritten.write_text(body.urdf)
    feet = [
        _feet(pybullet, original, zeros, list(body.touch)),
        _feet(pybullet, rewritten, {}, list(body.touch)),
    ]
    assert feet[0] == pytest.approx(feet[1], abs=2e-4)  # the note has a tenth of a degree


def _feet(pybullet: ModuleType, file: Path, angles: dict[str, float], feet: list[str]) -> list[Any]:
    """How far each foot is from each other, m, with all other joints at 0."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(file), physicsClientId=client)
        places = {}
        count = pybullet.getNumJoints(robot, physicsClientId=client)
        for index in range(count):
            info = pybullet.getJointInfo(robot, index, physicsClientId=client)
            angle = angles.get(info[1].decode(), 0.0)
            pybullet.resetJointState(robot, index, angle, physicsClientId=client)
        for index in range(count):
            info = pybullet.getJointInfo(robot, index, physicsClientId=client)
            state = pybullet.getLinkState(
                robot, index, computeForwardKinematics=True, physicsClientId=client
            )
            places[info[12].decode()] = np.array(state[4])
    finally:
        pybullet.disconnect(client)
    return [np.linalg.norm(places[one] - places[other]) for one in feet for other in feet]
