"""The bodies that ship: each is of the subset, and strong enough for every pose that is asked."""

from __future__ import annotations

import itertools
import logging
import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from sim_robot.command_line import main
from sim_robot.errors import BodyError
from sim_robot.world.body import body_path, default_body_path, load_body, shipped_bodies
from sim_robot.world.simulation import open_world

JOINTS = {
    "biped": 4,
    "damaged_leg": 8,
    "hexapod_12": 12,
    "hexapod_18": 18,
    "leg_on_leg": 5,
    "plate": 3,
    "quadruped": 8,
    "three_legs": 3,
    "tripod": 3,
    "twisted_hinge": 4,
    "unequal_legs": 8,
}
SERVO = 1.412  # N·m: the paper's 200 oz-in


def test_what_ships_can_be_named() -> None:
    assert list(shipped_bodies()) == sorted(JOINTS)
    for name, joints in JOINTS.items():
        body = load_body(body_path(name))
        assert body.name == name
        assert len(body.motors) == joints
        assert {motor.effort for motor in body.motors} == {SERVO}


@pytest.mark.parametrize("name", sorted(set(JOINTS) - {"quadruped"}))  # whose own test is longer
def test_a_body_holds_its_poses(name: str) -> None:
    body = load_body(body_path(name))
    driven, joints = 4 if JOINTS[name] == 8 else JOINTS[name], JOINTS[name]
    rng = np.random.default_rng(3)
    if driven <= 4:
        corners = [list(corner) for corner in itertools.product((-30.0, 30.0), repeat=driven)]
    else:
        corners = rng.choice([-30.0, 30.0], (4, driven)).tolist()
    inside = rng.uniform(-30, 30, (4, driven)).tolist()
    with open_world(body, log=logging.getLogger("world")) as world:
        for degrees in corners + inside:
            world.set_targets([0.0] * joints)
            world.lay_down()
            start = world.steps / 240
            pose = [math.radians(value) for value in degrees]
            world.set_targets([*pose, *[0.0] * (joints - driven)])
            world.advance_to(start + 3.0)
            assert math.degrees(world.largest_miss()) < 0.1, degrees


def test_touch_sensors_sit_on_what_carries_nothing() -> None:
    body = load_body(body_path("leg_on_leg"))
    assert list(body.touch) == ["leg_left", "leg_right", "leg_back", "branch"]


def test_a_file_needs_no_name(tmp_path: Path) -> None:
    assert body_path(str(tmp_path / "mine.urdf")) == tmp_path / "mine.urdf"
    with pytest.raises(BodyError, match="octopod: is neither a URDF file nor one of biped, "):
        body_path("octopod")
    with pytest.raises(BodyError, match=r"/n+: cannot be read: File name too long\."):
        load_body(body_path(str(tmp_path / (256 * "n"))))


def test_what_is_wrong_with_a_body_is_told_across_processes() -> None:
    error = BodyError("mine.urdf", "link leg", "has no mass")
    assert str(pickle.loads(pickle.dumps(error))) == "mine.urdf: link leg: has no mass"


def test_the_command_lists_prints_and_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--list-bodies"]) == 0
    assert "three_legs     3 joints, 3 touch sensors" in capsys.readouterr().out
    assert main(["--body", "three_legs", "--print-body"]) == 0
    assert capsys.readouterr().out == shipped_bodies()["three_legs"].read_text(encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["--body", "octopod", "--print-body"])
    assert ended.value.code == 2
    assert "octopod: is neither a URDF file nor" in capsys.readouterr().err


def test_a_body_is_printed_as_it_stands_in_its_file(
    tmp_path: Path, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    text = default_body_path().read_text(encoding="utf-8").partition("?>")[2]
    file = tmp_path / "kaefer.urdf"
    text = f'<?xml version="1.0" encoding="ISO-8859-1"?>\n<!-- für alle -->{text}'
    file.write_text(text, encoding="latin-1")
    assert main(["--body", str(file), "--print-body"]) == 0
    assert capsysbinary.readouterr().out == file.read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('type="revolute"', 'type="prismatic"', "joint 'hip_left'"),
        ('<box size="0.14 0.14 0.085"/>', '<mesh filename="body.stl"/>', "mesh"),
        ('<mass value="0.04"/>', '<mass value="0"/>', "a mass above 0"),
    ],
)
def test_what_leaves_the_subset_ends_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str
) -> None:
    text = shipped_bodies()["three_legs"].read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "mine.urdf"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    assert main(["--body", str(file), "--print-body"]) == 1
    sentence = capsys.readouterr().err
    assert str(file) in sentence
    assert words in sentence
    assert "Traceback" not in sentence
