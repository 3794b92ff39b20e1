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
            f"<robot>{BODY.replace('box size', 'mesh name')}</robot>",
            "a box, a cylinder or a sphere",
        ),
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
