from dataclasses import replace

import numpy as np
import pytest

from estimator.equivalence import equivalent
from estimator.morphology import BASE, Base, Morphology, Part
from estimator.physics.pybullet import PyBulletPhysics

ALL = ("touch", "tilt", "clearance")
BODY = Morphology(
    base=Base(size=(0.14, 0.14, 0.03), mass=0.3),
    parts=tuple(
        Part(parent=BASE, side=leg, hinge=2, length=0.16, radius=0.006, motor=leg, sensor=leg)
        for leg in range(4)
    )
    + (Part(parent=0, side=1, hinge=2, length=0.05, radius=0.006),),
    density=1000.0,
)
PROGRAMS = np.random.default_rng(0).uniform(-0.5, 0.5, (40, 4))


def changed(part: int, **changes: int | float) -> Morphology:
    parts = list(BODY.parts)
    parts[part] = replace(parts[part], **changes)  # type: ignore[arg-type]
    return replace(BODY, parts=tuple(parts))


def verdict(body: Morphology, physics: PyBulletPhysics, *modalities: str) -> bool:
    (found,) = equivalent([body], BODY, PROGRAMS, physics, modalities or ALL)
    return found


def test_the_hinge_of_a_locked_part_cannot_be_felt(physics: PyBulletPhysics) -> None:
    assert verdict(changed(4, hinge=5), physics)


@pytest.mark.parametrize("change", [{"hinge": 3}, {"hinge": 0}, {"side": 1}, {"length": 0.12}])
def test_what_moves_can_be_felt(physics: PyBulletPhysics, change: dict[str, int | float]) -> None:
    assert not verdict(changed(1, **(change | {"side": change.get("side", 0)})), physics)


def test_without_tilt_a_square_body_may_be_turned(physics: PyBulletPhysics) -> None:
    turned = replace(
        BODY, parts=tuple(replace(part, side=(part.side + 2) % 4) for part in BODY.parts[:4])
    )
    straight = replace(BODY, parts=BODY.parts[:4])
    for modalities, same in ((ALL, False), (("touch", "clearance"), True)):
        (found,) = equivalent([turned], straight, PROGRAMS, physics, modalities)
        assert found is same


def test_no_bodies_need_no_physics() -> None:
    assert equivalent([], BODY, PROGRAMS, None, ALL) == []  # type: ignore[arg-type]
