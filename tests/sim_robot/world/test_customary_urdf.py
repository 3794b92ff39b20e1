"""URDF as people have it: what is taken, and as what; all that is wrong, at once."""

from __future__ import annotations

import logging
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from estimator.evaluation.truth.urdf import read_urdf as read_truth
from sim_robot.cli.command_line import main
from sim_robot.simulator.pc104_set import configure
from sim_robot.world.body import Body, examine, load_body
from sim_robot.world.engines import ENGINES, open_world
from sim_robot.world.sensor_noise import NoiseLevels
from sim_robot.world.urdf import Box, vector

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
BOX = '<collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision>'
BASE = f'<link name="base">{INERTIAL}{BOX}</link>'
LEG = f'<link name="leg">{INERTIAL}{BOX}</link>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
CORNERS = [(-0.01, 0.0, 0.0), (0.03, 0.0, 0.0), (0.0, 0.01, -0.2)]


def joint(kind: str, parent: str, child: str, inside: str = "") -> str:
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="0 -1 0"/>{inside}</joint>'
    )


def written(folder: Path, *parts: str) -> Path:
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    return file


def taken(folder: Path, *parts: str) -> Body:
    return load_body(written(folder, *parts))


def test_a_joint_without_end_and_without_effort_is_a_strong_servo(tmp_path: Path) -> None:
    body = taken(tmp_path, BASE, LEG, joint("continuous", "base", "leg"))
    (motor,) = body.motors
    assert (motor.lower, motor.upper) == (-math.pi, math.pi)
    assert motor.effort == pytest.approx(2 * 2 * 9.81)
    assert [note.split(" is ")[-1] for note in body.notes] == [
        "taken as a servo of ±180°",
        "taken as a servo of 39.2 N·m",
    ]


@pytest.mark.parametrize(("lower", "upper"), [("0", "1.5"), ("-1.5", "0")])
def test_a_limit_may_be_0(tmp_path: Path, lower: str, upper: str) -> None:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="0"/>'
    body = taken(tmp_path, BASE, LEG, joint("revolute", "base", "leg", limit))
    assert (body.motors[0].lower, body.motors[0].upper) == (float(lower), float(upper))
    assert body.notes == ()
    config = configure(body, port="nowhere", levels=NoiseLevels())
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
        f'<link name="frame">{ball}</link><link name="toe">{INERTIAL}{ball}</link>',
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


def binary_stl(corners: list[tuple[float, float, float]]) -> bytes:
    numbers = [0.0, 0.0, 1.0, *(value for corner in corners for value in corner)]
    return bytes(80) + struct.pack("<I12fH", 1, *numbers, 0)


def text_stl(corners: list[tuple[float, float, float]]) -> bytes:
    lines = "".join("vertex {} {} {}\n".format(*corner) for corner in corners)
    return f"solid leg\nfacet normal 0 0 1\nouter loop\n{lines}endloop\nendfacet\n".encode()


def obj(corners: list[tuple[float, float, float]]) -> bytes:
    return ("".join("v {} {} {}\n".format(*corner) for corner in corners) + "f 1 2 3\n").encode()


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.stl", binary_stl(CORNERS)), ("a.STL", text_stl(CORNERS)), ("a.obj", obj(CORNERS))],
)
@pytest.mark.parametrize("prefix", ["meshes/", "package://my_robot/meshes/", "file://meshes/"])
def test_a_mesh_is_taken_as_the_box_around_it(
    tmp_path: Path, name: str, content: bytes, prefix: str
) -> None:
    folder = tmp_path / "my_robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / name).write_bytes(content)
    mesh = f'mesh filename="{prefix}{name}" scale="2 2 1"'
    mesh = LEG.replace('box size="0.2 0.1 0.1"', mesh)
    body = taken(folder, BASE, mesh, joint("revolute", "base", "leg", LIMIT))
    (collision,) = body.robot.links[1].collisions
    assert isinstance(collision.geometry.shape, Box)
    assert vector(collision.geometry.shape.size) == pytest.approx((0.08, 0.02, 0.2), abs=1e-6)
    assert vector(collision.origin.xyz) == pytest.approx((0.02, 0.01, -0.1), abs=1e-6)
    assert body.notes[0].endswith(f"{name} is taken as the box around it, 80 × 20 × 200 mm")


def test_a_main_body_of_any_shapes_is_announced_as_the_box_around_them(tmp_path: Path) -> None:
    shapes = (
        '<collision><origin rpy="0 1.5707963267948966 0"/><geometry>'
        '<cylinder radius="0.05" length="0.4"/></geometry></collision>'
        '<collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.02"/></geometry></collision>'
    )
    base = f'<link name="base">{INERTIAL}{shapes}</link>'
    body = taken(tmp_path, base, LEG, joint("revolute", "base", "leg", LIMIT))
    assert body.base_size == pytest.approx((0.4, 0.1, 0.17))
    assert body.base_center == pytest.approx((0, 0, 0.035))
    assert "400 × 100 × 170 mm" in body.notes[0]


def test_all_that_is_wrong_is_said_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = LEG.replace('box size="0.2 0.1 0.1"', 'mesh filename="leg.dae"')
    (tmp_path / "leg.dae").touch()
    file = written(
        tmp_path,
        *(BASE.replace('mass value="1"', 'mass value="-1"'), mesh.replace('ixx="1"', 'ixx="-1"')),
        joint("revolute", "base", "leg", LIMIT.replace('"-1"', '"0.2"')),
        joint("prismatic", "leg", "base"),
        "<loop/>",
    )
    assert main(["--check", str(file)]) == 1
    lines = capsys.readouterr().out.splitlines()
    words = [
        *("leg.dae is .dae; write collision meshes as .stl or .obj", "mass"),
        *("'leg_base': type", "<loop>", "'leg': inertia", "must hold 0"),
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
        ("a1/a1.urdf", 4, "must hold 0"),
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
