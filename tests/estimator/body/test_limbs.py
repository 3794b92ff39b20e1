import pytest

from estimator.body.limbs import limbs
from estimator.body.morphology import BASE, Base, Morphology, Part

BODY = Base(size=(0.14, 0.14, 0.05), mass=0.5)


def make(*parts: Part) -> Morphology:
    return Morphology(base=BODY, parts=parts, density=1000.0)


def test_a_leg_with_a_locked_knee_is_one_limb() -> None:
    body = make(
        Part(parent=BASE, mount=0, hinge=2, length=0.095, radius=0.013, motor=1),
        Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.013, motor=0),
        Part(parent=0, mount=1, hinge=2, length=0.125, radius=0.006, sensor=0),
    )
    front, left = limbs(body)
    assert (front.motor, left.motor) == (0, 1)
    assert (front.sensors, left.sensors) == ((), (0,))
    assert [front.length, left.length] == pytest.approx([0.1, 0.22])
    assert (left.parent, left.mount, left.hinge) == (BASE, "left", "up")


def test_a_locked_part_across_does_not_lengthen() -> None:
    body = make(
        Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.006, motor=0),
        Part(parent=0, mount=0, hinge=2, length=0.2, radius=0.006),
    )
    (limb,) = limbs(body)
    assert limb.length == pytest.approx(0.1)


def test_a_driven_knee_makes_two_limbs() -> None:
    body = make(
        Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.006, motor=4),
        Part(parent=0, mount=1, hinge=3, length=0.2, radius=0.006, motor=7),
    )
    upper, lower = limbs(body)
    assert (upper.parent, lower.parent) == (BASE, 4)
    assert [upper.length, lower.length] == pytest.approx([0.1, 0.2])


def test_a_limb_on_a_part_locked_to_the_main_body_sits_on_the_main_body() -> None:
    body = make(
        Part(parent=BASE, mount=1, hinge=2, length=0.1, radius=0.006),
        Part(parent=0, mount=1, hinge=2, length=0.2, radius=0.006, motor=0),
    )
    driven, locked = limbs(body)
    assert (driven.motor, driven.parent) == (0, BASE)
    assert locked.motor is None
