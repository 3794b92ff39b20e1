from pathlib import Path

import pytest

from estimator.body.morphology import BASE
from estimator.body.mounts import SIDES
from estimator.errors import TruthError
from estimator.evaluation.truth.body import TrueLimb, true_limbs

LEG = """
<link name="leg"><collision><origin xyz="0.04 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><cylinder radius="0.005" length="0.08"/></geometry></collision></link>
<link name="foot"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
<joint name="ankle" type="fixed"><parent link="leg"/><child link="foot"/>
  <origin xyz="0.08 0 0"/></joint>
"""


def make(
    folder: Path, *, origin: str, axis: str = "0 -1 0", leg: str = LEG, middle: str = "0 0 0"
) -> TrueLimb:
    path = folder / "body.urdf"
    moving, rest = leg.split('<link name="foot">')
    path.write_text(
        f"""<robot name="r"><link name="body"><collision><origin xyz="{middle}"/>
        <geometry><box size="0.2 0.1 0.04"/></geometry></collision></link>
        {moving}
        <joint name="hip" type="revolute"><parent link="body"/><child link="leg"/>
        <origin {origin}/><axis xyz="{axis}"/></joint>
        <link name="foot">{rest}</robot>"""
    )
    (limb,) = true_limbs(path, {"hip": 0})
    return limb


def test_a_foot_that_is_fixed_belongs_to_the_leg(tmp_path: Path) -> None:
    leg = make(tmp_path, origin='xyz="0.1 0 0"')
    assert leg.name == "hip"
    assert leg.limb.length == pytest.approx(0.09)
    assert leg.limb.parent == BASE
    assert (leg.limb.mount, leg.limb.hinge) == ("front", "up")
    assert not leg.not_representable


def test_places_are_counted_from_the_middle_of_the_main_body(tmp_path: Path) -> None:
    leg = make(tmp_path, origin='xyz="0.13 0.01 -0.2"', middle="0.03 0.01 -0.2")
    assert (leg.limb.mount, leg.limb.hinge) == ("front", "up")
    assert not leg.not_representable


@pytest.mark.parametrize(
    ("origin", "mount"),
    [
        ('xyz="0 0.05 0" rpy="0 0 1.5708"', "left"),
        ('xyz="0.1 0 0" rpy="0 0 0"', "front"),
        ('xyz="0 -0.05 0" rpy="0 0 -1.5708"', "right"),
        ('xyz="-0.1 0 0" rpy="0 0 3.14159"', "back"),
        ('xyz="-0.1 0 0" rpy="1 0 3.14159"', "back"),
    ],
)
def test_the_side_does_not_depend_on_how_the_frames_are_turned(
    tmp_path: Path, origin: str, mount: str
) -> None:
    leg = make(tmp_path, origin=origin)
    assert leg.limb.mount == mount
    assert leg.limb.length == pytest.approx(0.09, abs=1e-5)


@pytest.mark.parametrize(
    ("axis", "hinge"),
    [
        ("0 0 1", "yaw_left"),
        ("0 0 -2", "yaw_right"),
        ("0 -1 0", "up"),
        ("0 1 0", "down"),
        ("-1 0 0", "roll_left"),
        ("1 0.01 0", "roll_right"),
    ],
)
def test_each_hinge_is_recognised_on_every_side(tmp_path: Path, axis: str, hinge: str) -> None:
    for place, yaw in (("0 0.05 0", 1.5708), ("0.1 0 0", 0.0), ("-0.1 0 0", 3.14159)):
        leg = make(tmp_path, origin=f'xyz="{place}" rpy="0 0 {yaw}"', axis=axis)
        assert leg.limb.hinge == hinge
        assert not leg.not_representable


@pytest.mark.parametrize(
    ("origin", "axis", "trait", "sentence"),
    [
        ('xyz="0.1 0.03 0"', "0 -1 0", "mount", "sits 30 mm from the nearest place"),
        ('xyz="0.1 0 0" rpy="0 0 0.3"', "0 -1 0", "mount", "points 17 degrees away from front"),
        ('xyz="0 0.05 0"', "0 -1 0", "mount", "sits on the left but points front"),
        ('xyz="0.1 0 0"', "0 -1 0.5", "hinge", "axis 27 degrees from .* up"),
    ],
)
def test_what_no_genome_can_say_is_said(
    tmp_path: Path, origin: str, axis: str, trait: str, sentence: str
) -> None:
    leg = make(tmp_path, origin=origin, axis=axis)
    assert trait in leg.not_representable
    with pytest.raises(ValueError, match=sentence):
        raise ValueError(leg.not_representable[trait])


def test_undriven_knees_lengthen_the_legs_and_driven_ones_are_limbs() -> None:
    path = Path("sim_robot/bodies/quadruped.urdf")
    hips = {f"hip_{side}": index for index, side in enumerate(SIDES)}
    legs = true_limbs(path, hips)
    assert [limb.limb.length for limb in legs] == pytest.approx([0.22] * 4)
    knees = {f"knee_{side}": index + 4 for index, side in enumerate(SIDES)}
    every = true_limbs(path, hips | knees)
    assert [limb.limb.length for limb in every] == pytest.approx([0.095] * 4 + [0.125] * 4)
    assert [limb.limb.parent for limb in every] == [BASE] * 4 + [0, 1, 2, 3]
    assert [limb.limb.mount for limb in every] == [*SIDES, *["front"] * 4]
    assert {limb.limb.hinge for limb in every} == {"up"}
    assert not any(limb.not_representable for limb in every)


def test_a_wide_box_is_as_long_as_it_reaches_away_from_the_body(tmp_path: Path) -> None:
    # Turned about y, its z side of 0.12 m points away; its y side is wider than it is long.
    box = LEG.replace('<cylinder radius="0.005" length="0.08"/>', '<box size="0.02 0.4 0.12"/>')
    leg = make(tmp_path, origin='xyz="0.1 0 0"', leg=box)
    assert leg.limb.mount == "front"
    assert leg.limb.length == pytest.approx(0.04 + 0.06)
    assert not leg.not_representable


def test_another_robots_body_is_refused() -> None:
    with pytest.raises(TruthError, match="no revolute joint named tail: give"):
        true_limbs(Path("sim_robot/bodies/quadruped.urdf"), {"hip_left": 0, "tail": 1})


def test_legs_that_differ_have_their_own_lengths() -> None:
    path = Path(__file__).parents[4] / "sim_robot" / "bodies" / "unequal_legs.urdf"
    hips = {f"hip_{side}": motor for motor, side in enumerate(("left", "front", "right", "back"))}
    lengths = [leg.limb.length for leg in true_limbs(path, hips)]
    assert lengths == pytest.approx([0.22, 0.18, 0.25, 0.155], abs=1e-6)
