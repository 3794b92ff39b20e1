from pathlib import Path

import pytest

from estimator.errors import TruthError
from estimator.evaluation.truth.urdf import read_urdf

BODY = '<link name="body"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'
LEG = '<link name="leg"/>'


def joint(kind: str = "revolute", parent: str = "body", child: str = "leg", more: str = "") -> str:
    return (
        f'<joint name="hip" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}'
        "</joint>"
    )


def test_what_does_not_shape_a_body_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "body.urdf"
    visual = '<visual><geometry><mesh filename="x.stl"/></geometry></visual>'
    path.write_text(
        f'<robot name="r"><material name="red"/>{joint()}{BODY.replace("<coll", visual + "<coll")}'
        f"{LEG}</robot>"
    )
    urdf = read_urdf(path)
    assert urdf.root == "body"
    assert [item.name for item in urdf.joints] == ["hip"]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "is no XML file"),
        ("<robot", "is no XML file"),
        ("<body/>", "is no URDF file"),
        (f"<!DOCTYPE robot><robot>{BODY}</robot>", "DOCTYPE is no part of URDF"),
        (f"<!DOCTYPE r [<!ENTITY e 'x'>]><robot>{BODY}&e;</robot>", "DOCTYPE is no part of URDF"),
        (f"<robot>{BODY}&e;</robot>", "is no XML file"),
        ("<robot/>", "links: .*required"),
        (f"<robot>{BODY}<link/></robot>", "link number 2: name: .*required"),
        (f"<robot>{BODY}{BODY}</robot>", "two links are named body"),
        (f"<robot>{BODY}{LEG}</robot>", "no joint holds leg"),
        (f"<robot>{BODY}{LEG}{joint('prismatic')}</robot>", "joint hip: type: .* or 'revolute'"),
        (f"<robot>{BODY}{LEG}{joint(parent='tail')}</robot>", "its parent tail is unknown"),
        (f"<robot>{BODY}{LEG}{joint(child='tail')}</robot>", "its child tail must be a link"),
        (f"<robot>{BODY}{LEG}{joint(parent='leg', child='body')}{joint()}</robot>", "no main body"),
        (f"<robot>{BODY}{LEG}{joint(more='<axis xyz=`0 0 0`/>')}</robot>", "has no direction"),
        (f"<robot>{BODY}{LEG}{joint(more='<axis xyz=`0 0`/>')}</robot>", "xyz"),
        (f"<robot>{BODY}{LEG}{joint(more='<origin xyz=`0 0 nan`/>')}</robot>", "finite numbers"),
        (
            f"<robot>{BODY.replace('box size', 'mesh filename')}</robot>",
            "mesh.*: is unknown here: give",
        ),
        (
            f"<robot>{BODY.replace('collision', 'colision')}</robot>",
            "colision.*: is unknown here: give",
        ),
        (
            f"<robot>{BODY}{LEG}{joint(more='<axis xzy=`0 0 1`/>')}</robot>",
            "xzy: is unknown here: give",
        ),
        (
            f"<robot>{BODY.replace('</geom', '<sphere radius=`1`/></geom')}</robot>",
            "must be one box, cyl",
        ),
        (f"<robot>{BODY.replace('1 1 1', '1 -1 1')}</robot>", "must be three numbers above 0"),
        (
            f"<robot>{BODY.replace('<geom', '<origin rpy=`0 0 1`/><geom')}</robot>",
            "must be one box or cylinder, not t",
        ),
        (
            f"<robot>{BODY.replace('box size', 'sphere radius').replace('1 1 1', '1')}</robot>",
            "must be one box or cylinder, not",
        ),
        (
            f"<robot xmlns:xacro='http://www.ros.org/wiki/xacro'>{BODY}<xacro:arm/></robot>",
            "is xacro, of which URDF is made first: xacro FILE > robot.urdf",
        ),
        (f"<robot>{BODY}{LEG}{joint(more='<origin xyz=`0 0 ${h}`/>')}</robot>", "is xacro"),
        ("<robot>" + "<link/>" * 30_000 + "</robot>", "has more than 20000 elements"),
        ("<robot>" + "<link/>" * 600_000, "has more than 4 MiB"),
        (
            f"<robot>{BODY.replace('1 1 1', '1 1 wide')}</robot>",
            "must be three finite numbers",
        ),
        (
            f"<robot>{BODY}<link name='leg'><inertial><mass value='0'/></inertial></link>"
            f"{joint()}</robot>",
            "link leg: inertial.mass.value: .*greater than 0",
        ),
    ],
)
def test_what_is_no_truth_is_refused_with_the_file(
    tmp_path: Path, content: str, sentence: str
) -> None:
    path = tmp_path / "body.urdf"
    path.write_text(content.replace("`", '"'))
    with pytest.raises(TruthError, match=sentence) as caught:
        read_urdf(path)
    assert str(path) in str(caught.value)


def test_an_absent_file_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match="cannot be read"):
        read_urdf(tmp_path / "nowhere.urdf")


def test_processing_instructions_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "body.urdf"
    path.write_text(f"<?pi?><robot><?pi?>{joint()}{BODY}<?pi more?>{LEG}</robot><?pi?>")
    assert [item.name for item in read_urdf(path).joints] == ["hip"]


def test_what_people_also_write_is_skipped(tmp_path: Path) -> None:
    tensor = "<inertia ixx='1' iyx='0'/>"
    inertial = f"<inertial><origin xyz='1 0 0'/><mass value='1'/>{tensor}</inertial>"
    path = tmp_path / "body.urdf"
    limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/><dynamics damping='1'/>"
    path.write_text(
        f"<robot name='r' version='1.0'>{BODY.replace('<coll', f'{inertial}<coll')}{LEG}"
        f"{joint(more=limit)}<transmission/><gazebo reference='leg'/></robot>"
    )
    assert read_urdf(path).main_body == ((1, 1, 1), (0, 0, 0), False)
