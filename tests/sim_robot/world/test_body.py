"""Bodies: the default is the paper's, and what leaves the subset is refused with a sentence."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_robot.errors import BodyError
from sim_robot.world.body import default_body_path, load_body

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.002" iyy="0.002" izz="0.002"/></inertial>'
BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
BASE = f'<link name="base">{INERTIAL}{BOX}</link>'
LEG = f'<link name="leg">{INERTIAL}</link>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def joint(name: str = "hip", kind: str = "revolute", limit: str = LIMIT, child: str = "leg") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="base"/><child link="{child}"/>'
        f'<axis xyz="0 -1 0"/>{limit}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


def refused(tmp_path: Path, text: str) -> str:
    file = tmp_path / "body.urdf"
    file.write_text(text)
    with pytest.raises(BodyError) as caught:
        load_body(file)
    assert str(file) in str(caught.value)
    return str(caught.value)


def test_the_default_body_is_table_1_and_2() -> None:
    body = load_body(default_body_path())
    assert body.base_size == (0.14, 0.14, 0.085)
    assert [motor.name for motor in body.motors] == [
        f"{joint}_{side}"
        for joint in ("hip", "knee")
        for side in ("left", "front", "right", "back")
    ]
    assert [motor.radius for motor in body.motors] == [0.013] * 4 + [0.006] * 4
    assert list(body.touch) == [f"lower_{side}" for side in ("left", "front", "right", "back")]
    degrees = [(math.degrees(m.lower), math.degrees(m.upper)) for m in body.motors]
    assert degrees == [pytest.approx((-96, 74))] * 4 + [pytest.approx((-96, 94))] * 4


@pytest.mark.parametrize(("below", "flat"), [("0.04", True), ("0.06", False)])
def test_a_body_stands_whose_legs_reach_below_it(tmp_path: Path, below: str, flat: bool) -> None:
    file = tmp_path / "body.urdf"
    leg = LEG.replace("</link>", f"{BOX.replace('0.1 0.1 0.1', '0.02 0.02 0.02')}</link>")
    low = joint().replace("<axis", f'<origin xyz="0 0 -{below}"/><axis')
    file.write_text(robot(BASE, leg, low))
    assert load_body(file).lies_flat is flat
    assert load_body(default_body_path()).lies_flat


def test_visuals_and_hints_are_dropped(tmp_path: Path) -> None:
    file = tmp_path / "body.urdf"
    leg = LEG.replace("</link>", '<visual><geometry><mesh filename="x.stl"/></geometry></visual>')
    file.write_text(robot(BASE, f"{leg}</link>", joint(), '<gazebo reference="leg"/>'))
    body = load_body(file)
    assert "mesh" not in body.urdf
    assert [motor.radius for motor in body.motors] == [None]  # nothing is known of it


def test_fixed_links_belong_to_the_sensor_of_what_moves_them(tmp_path: Path) -> None:
    file = tmp_path / "body.urdf"
    foot = f'<link name="foot">{INERTIAL}{BOX}</link>'
    fixed = joint("ankle", "fixed", "", "foot").replace('parent link="base"', 'parent link="leg"')
    file.write_text(robot(BASE, LEG, foot, joint(), fixed))
    assert load_body(file).touch == {"leg": frozenset({"leg", "foot"})}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot name='r'>", ["not valid XML"]),
        ("<sdf/>", ["<robot>"]),
        (robot(BASE), ["1 to 24 revolute joints", "not 0"]),
        (robot(BASE, LEG), ["exactly one link", "base, leg"]),
        (robot(BASE, LEG, joint(kind="prismatic")), ["joint 'hip'", "type", "revolute"]),
        (robot(BASE, LEG, joint(kind="floating")), ["joint 'hip'", "type"]),
        (robot(BASE, LEG, joint(limit="")), ["joint 'hip'", "<limit>"]),
        (
            robot(BASE, LEG, joint(limit=LIMIT.replace("-1", "1.2"))),
            ["joint 'hip'", "lower", "1.2"],
        ),
        (robot(BASE, LEG, joint(limit='<limit effort="1"/>')), ["joint 'hip'", "0 and 0"]),
        (robot(BASE, LEG, joint(child="arm")), ["joint 'hip'", "'arm'", "not a link"]),
        (robot(BASE, LEG, joint(), joint("knee")), ["joint 'knee'", "already hangs"]),
        (robot(BASE, LEG, joint(), joint()), ["joint 'hip'", "share this name"]),
        (robot(BASE, BASE, LEG, joint()), ["link 'base'", "share this name"]),
        (robot(BASE, '<link name="leg"/>', joint()), ["link 'leg'", "<inertial>"]),
        (
            robot(BASE, LEG.replace('mass value="1"', 'mass value="0"'), joint()),
            ["link 'leg'", "mass", "above 0"],
        ),
        (
            robot(BASE.replace('box size="0.1 0.1 0.1"', 'mesh filename="a.stl"'), LEG, joint()),
            ["link 'base'", "mesh", "a.stl is not there"],
        ),
        (
            robot(BASE.replace("0.1 0.1 0.1", "0.1 nan 0.1"), LEG, joint()),
            ["link 'base'", "finite"],
        ),
        (robot(BASE.replace("0.1 0.1 0.1", "0.1 200 0.1"), LEG, joint()), ["200 m", "metres"]),
        (
            robot(BASE, LEG, joint().replace("<axis", '<origin xyz="0 -55 0"/><axis')),
            ["joint 'hip': origin", "55 m", "metres"],
        ),
        (
            robot(BASE, LEG.replace('mass value="1"', 'mass value="1200"'), joint()),
            ["link 'leg'", "1200 kg", "kilograms"],
        ),
        (robot(BASE.replace(BOX, ""), LEG, joint()), ["link 'base'", "must have a shape"]),
        (robot(BASE.replace("</geometry>", "<sphere radius='1'/></geometry>"), LEG, joint()), []),
        (robot(BASE, LEG, joint().replace("0 -1 0", "0 0 0")), ["joint 'hip'", "axis"]),
    ],
)
def test_what_leaves_the_subset_is_refused(tmp_path: Path, text: str, words: list[str]) -> None:
    sentence = refused(tmp_path, text)
    assert all(word in sentence for word in words), sentence


def test_a_ring_is_refused(tmp_path: Path) -> None:
    foot = f'<link name="foot">{INERTIAL}</link>'
    knee = joint("knee", child="foot").replace('parent link="base"', 'parent link="leg"')
    back = joint(child="leg").replace('parent link="base"', 'parent link="foot"')
    assert "form a ring" in refused(tmp_path, robot(BASE, LEG, foot, knee, back))


def test_motors_are_in_document_order_whatever_stands_between_the_joints(tmp_path: Path) -> None:
    file = tmp_path / "body.urdf"
    limbs = [
        f'<link name="leg{n}">{INERTIAL}</link>{joint(f"hip{n}", child=f"leg{n}")}'
        for n in range(8)
    ]
    file.write_text(robot(BASE, *limbs))
    assert [motor.name for motor in load_body(file).motors] == [f"hip{n}" for n in range(8)]


def test_25_motors_are_too_many(tmp_path: Path) -> None:
    legs = [f'<link name="leg{n}">{INERTIAL}</link>' for n in range(25)]
    joints = [joint(f"hip{n}", child=f"leg{n}") for n in range(25)]
    assert "not 25" in refused(tmp_path, robot(BASE, *legs, *joints))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BodyError, match="cannot be read"):
        load_body(tmp_path / "nowhere.urdf")


def many(count: int) -> str:
    links = "".join(f'<link name="l{number}">{INERTIAL}</link>' for number in range(count))
    joints = "".join(joint(f"j{n}", "fixed", "", child=f"l{n}") for n in range(count))
    return links + joints


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (robot(BASE, LEG, joint()).replace('name="r"', f'name="{"r" * 65}"'), "robot: name: names"),
        (robot(BASE, LEG, joint()).replace('name="r"', f'name="{"r" * 100_000}"'), "200 character"),
        (robot(BASE, LEG, joint()).replace('"r"', f'"r" version="{"1" * 201}"'), "200 characters"),
        (robot(BASE, LEG, joint(), many(99)), "must have at most 100 links, not 101"),
        (f"<!DOCTYPE robot><robot name='r'>{BASE}</robot>", "<!DOCTYPE>: is no part of URDF"),
        (
            f'<!DOCTYPE r [<!ENTITY e "x">]><robot name="r">{BASE}{LEG}{joint()}&e;</robot>',
            "leave it out, and entities",
        ),
        (robot(BASE, "&none;"), "is not valid XML"),
    ],
)
def test_what_pybullet_or_the_parser_would_die_of_is_refused(
    tmp_path: Path, text: str, sentence: str
) -> None:
    assert sentence in refused(tmp_path, text)


def test_processing_instructions_are_skipped(tmp_path: Path) -> None:
    file = tmp_path / "body.urdf"
    file.write_text(f"<?pi?>{robot('<?pi?>', BASE, LEG, joint(), '<?pi more?>')}<?pi?>")
    assert [motor.name for motor in load_body(file).motors] == ["hip"]
