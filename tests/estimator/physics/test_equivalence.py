"""Bodies that no sensor can tell apart, and bodies that it can."""

import math
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.body.mounts import BaseMount
from estimator.physics.equivalence import Reference, agree, images, mirrored, turned
from estimator.physics.statics import StaticsPhysics

ALL = ("touch", "tilt", "clearance")
BODY = Morphology(
    base=Base(size=(0.14, 0.14, 0.03), mass=0.3),
    parts=(
        *(
            Part(parent=BASE, mount=leg, hinge=2, length=0.16, radius=0.006, motor=leg, sensor=leg)
            for leg in range(4)
        ),
        Part(parent=0, mount=1, hinge=2, length=0.05, radius=0.006),
    ),
    density=1000.0,
)
PROGRAMS = np.random.default_rng(0).uniform(-0.5, 0.5, (300, 4))


def changed(part: int, **changes: int | float) -> Morphology:
    parts = list(BODY.parts)
    parts[part] = replace(parts[part], **changes)  # type: ignore[arg-type]
    return replace(BODY, parts=tuple(parts))


@pytest.fixture(scope="module")
def reference(statics: StaticsPhysics) -> Reference:
    return Reference(BODY, PROGRAMS, statics, ALL)


def test_the_hinge_of_a_locked_part_cannot_be_felt(reference: Reference) -> None:
    assert reference.is_like(changed(4, hinge=5))


@pytest.mark.parametrize("change", [{"hinge": 3}, {"hinge": 0}, {"mount": 0}, {"length": 0.12}])
def test_what_moves_can_be_felt(reference: Reference, change: dict[str, int | float]) -> None:
    assert not reference.is_like(changed(1, **change))


def test_without_tilt_a_square_body_may_be_turned_and_mirrored(
    reference: Reference, statics: StaticsPhysics
) -> None:
    assert not reference.is_like(turned(BODY, 2))
    assert not reference.is_like(mirrored(BODY))
    blind = Reference(BODY, PROGRAMS, statics, ("touch", "clearance"))
    assert blind.is_like(turned(BODY, 2))
    assert blind.is_like(mirrored(BODY))


def test_without_tilt_a_round_body_may_be_turned_to_wherever_it_has_a_mount(
    statics: StaticsPhysics,
) -> None:
    yaws = (0.0, 2 * math.pi / 3, -2 * math.pi / 3)
    mounts = tuple(
        BaseMount(name="rim", at=(0.07 * math.cos(yaw), 0.07 * math.sin(yaw), 0.0), yaw=yaw)
        for yaw in yaws
    )
    base = Base(size=(0.14, 0.14, 0.03), mass=0.3, mounts=mounts, round=True)
    legs = tuple(
        Part(parent=BASE, mount=leg, hinge=2, length=length, radius=0.006, motor=leg, sensor=leg)
        for leg, length in enumerate((0.16, 0.18, 0.2))
    )
    plate = Morphology(base=base, parts=legs, density=1000.0)
    turns = [tuple(part.mount for part in image.parts) for image in images(plate)]
    assert turns[:3] == [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    blind = Reference(plate, PROGRAMS[:, :3], statics, ("touch", "clearance"))
    assert all(map(blind.is_like, images(plate)))
    square = replace(plate, base=replace(base, round=False))
    assert not Reference(square, PROGRAMS[:, :3], statics, ("touch", "clearance")).is_like(
        turned(square, 4 / 3)
    )


def hanging(body: Morphology) -> Morphology:
    """The body with its legs 20° below its plane."""
    mounts = tuple(replace(mount, elevation=-0.35) for mount in body.base.mounts)
    return replace(body, base=replace(body.base, mounts=mounts))


@pytest.mark.parametrize("quarters", [1, 2, 3])
@pytest.mark.parametrize("body", [BODY, hanging(BODY)], ids=["planar", "hanging"])
def test_a_turned_body_feels_the_same_in_its_own_directions(
    statics: StaticsPhysics, quarters: int, body: Morphology
) -> None:
    straight = statics.read([(body, program) for program in PROGRAMS])
    image = statics.read([(turned(body, quarters), program) for program in PROGRAMS])
    tilt = image.tilt
    for _ in range(quarters):
        tilt = np.column_stack([-tilt[:, 1], tilt[:, 0]])
    assert np.mean(agree(straight, replace(image, tilt=tilt), ALL)) > 0.9  # a trifle decides some
    assert np.mean(agree(straight, image, ALL)) < 0.5


@pytest.mark.parametrize(
    "yawing", [changed(0, hinge=0), hanging(changed(0, hinge=0))], ids=["planar", "hanging"]
)
def test_the_image_in_a_mirror_leans_the_other_way(
    statics: StaticsPhysics, yawing: Morphology
) -> None:
    straight = statics.read([(yawing, program) for program in PROGRAMS])
    image = statics.read([(mirrored(yawing), program) for program in PROGRAMS])
    assert np.mean(agree(straight, replace(image, tilt=image.tilt * (-1, 1)), ALL)) > 0.9
    assert np.mean(agree(straight, image, ALL)) < 0.5
    assert mirrored(mirrored(yawing)) == yawing


def test_a_hundredth_of_the_programs_may_differ(statics: StaticsPhysics) -> None:
    """A fifth part, so short that it touches the ground only when its leg points steeply down."""
    steep = np.array([-0.5, -0.1, 0.2, -0.3])
    longer = changed(4, length=0.1)
    for number, same in ((4, True), (30, False)):
        programs = np.zeros((1000, 4))
        programs[:, 0] = np.linspace(0.1, 0.5, 1000)  # lifts the leg
        programs[:number] = steep
        assert Reference(BODY, programs, statics, ALL).is_like(longer) is same


def test_programs_in_which_a_trifle_decides_say_nothing(statics: StaticsPhysics) -> None:
    balanced = np.tile([-0.3, 0.3, -0.3, 0.3], (20, 1))  # on two opposite feet
    assert not Reference(BODY, balanced, statics, ALL).is_like(BODY)
