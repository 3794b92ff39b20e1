"""Damages of a body: what is left of it is what was asked for, and every engine can simulate it."""

from __future__ import annotations

import logging
import math
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.errors import CommandError
from sim_robot.faults.world_faults import Damage
from sim_robot.world.body import Body, load_body, shipped_bodies
from sim_robot.world.damage import damaged
from sim_robot.world.simulation import ENGINES, open_world
from sim_robot.world.urdf.declarations import Points, Robot

LOG = logging.getLogger("damage")
TRIPOD = load_body(shipped_bodies()["tripod"])
QUADRUPED = load_body(shipped_bodies()["quadruped"])


def reach(body: Body, motor: int) -> tuple[Points, float]:
    """Where the leg of a motor ends with all joints at 0, and how far from its joint, m."""
    name = body.motors[motor - 1].name
    (first,) = (joint for joint in body.robot.joints if joint.name == name)
    frames = {body.base: np.eye(4)}
    own = set[str]()
    for joint in body.robot.joints:
        frames[joint.child.link] = frames[joint.parent.link] @ joint.origin.frame
        if joint is first or joint.parent.link in own:
            own.add(joint.child.link)
    start = frames[first.child.link][:3, 3]
    points = [
        np.mean(shape.bounds(frames[link.name]), axis=0)
        for link in body.robot.links
        if link.name in own
        for shape in link.collisions
    ]
    end = max(points, key=lambda point: float(np.linalg.norm(point - start)))
    return end, float(np.linalg.norm(end - start))


def test_half_a_leg_is_half_as_long_and_half_as_heavy() -> None:
    cut = damaged(TRIPOD, "cut", 1, 50.0)
    (link,) = (one for one in cut.robot.links if one.name == "leg_left")
    (shape,) = link.collisions  # its foot is gone
    assert shape.bounds(np.eye(4))[1][0] == pytest.approx(0.09)
    assert link.mass == pytest.approx(0.04 * 0.09 / 0.186)  # of what its shapes add up to
    assert cut.touch == TRIPOD.touch


def test_a_leg_that_broke_off_above_its_knee_keeps_its_joints_and_its_gauge() -> None:
    cut = damaged(QUADRUPED, "cut", 2, 20.0)
    lower = next(link for link in cut.robot.links if link.name == "lower_front")
    assert not lower.collisions
    assert [motor.name for motor in cut.motors] == [motor.name for motor in QUADRUPED.motors]
    assert cut.touch.keys() == QUADRUPED.touch.keys()


def test_a_longer_leg_has_its_foot_at_its_end() -> None:
    assert reach(damaged(QUADRUPED, "length", 3, 150.0), 3)[1] == pytest.approx(
        1.5 * reach(QUADRUPED, 3)[1]
    )


def test_a_leg_is_bent_as_its_hinge_turns_it() -> None:
    """A positive angle lifts the far end; a leg of 180 mm bent by 60° at its half."""
    end, distance = reach(damaged(TRIPOD, "bent", 1, 60.0), 1)
    assert distance == pytest.approx(0.09 * math.sqrt(3), abs=0.006)
    assert end[2] == pytest.approx(0.09 * math.sin(math.radians(60)), abs=0.01)


def test_a_leg_points_aside_and_a_hinge_is_turned() -> None:
    (was, _), (is_now, _) = reach(TRIPOD, 2), reach(damaged(TRIPOD, "aside", 2, 30.0), 2)
    start = np.array([-0.065, 0.0, 0.0])
    one, other = was - start, is_now - start
    angle = math.degrees(math.acos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))
    assert angle == pytest.approx(30.0, abs=0.1)
    joint = damaged(TRIPOD, "twisted", 1, 90.0).robot.joints[0]
    was_axis = np.array(list(map(float, TRIPOD.robot.joints[0].axis.xyz.split())))
    assert abs(np.array(list(map(float, joint.axis.xyz.split()))) @ was_axis) < 1e-9


def test_a_weight_adds_its_mass_at_the_end() -> None:
    loaded = damaged(TRIPOD, "weight", 1, 100.0)
    (was,) = (link for link in TRIPOD.robot.links if link.name == "leg_left")
    (link,) = (link for link in loaded.robot.links if link.name == "leg_left")
    assert link.mass == pytest.approx(was.mass + 0.1)
    assert link.inertial is not None
    place = float(link.inertial.origin.xyz.split()[0])
    assert place == pytest.approx((0.09 * was.mass + 0.18 * 0.1) / link.mass)
    assert loaded.mass == pytest.approx(TRIPOD.mass + 0.1)


@pytest.mark.parametrize("engine", ENGINES)
def test_each_damage_can_be_simulated_and_felt(engine: str) -> None:
    pytest.importorskip(engine)

    def stand(body: Body) -> list[float]:
        with open_world(TRIPOD, log=LOG, engine=engine) as world:
            world.become(body)
            world.advance_to(0.2)
            world.set_targets([-0.35, -0.35, -0.35])
            world.advance_to(3.0)
            return [*world.up()[:2], world.belly_ray()]

    sound = stand(TRIPOD)
    assert sound == pytest.approx(stand(damaged(TRIPOD, "length", 1, 100.0)), abs=1e-4)
    for fault, amount in (("cut", 60.0), ("length", 70.0), ("bent", 50.0), ("twisted", 60.0)):
        assert stand(damaged(TRIPOD, fault, 1, amount)) != pytest.approx(sound, abs=0.01), fault


@given(
    st.sampled_from(sorted(shipped_bodies())),
    st.sampled_from(sorted(Damage.FAULTS)),
    st.integers(1, 64),
    st.floats(0, 1),
)
@settings(max_examples=40)
def test_any_damage_of_any_body_leaves_a_description_that_can_be_read(
    name: str, fault: str, motor: int, share: float
) -> None:
    body = load_body(shipped_bodies()[name])
    low, high = Damage.FAULTS[fault].amounts
    new = damaged(body, fault, 1 + motor % len(body.motors), low + share * (high - low))
    assert Robot.from_xml(new.urdf).to_xml() == new.robot.to_xml()
    assert all(link.mass > 0 for link in new.robot.links if link.inertial is not None)
    numbers = [
        float(word)
        for element in ElementTree.fromstring(new.urdf).iter()
        for key in ("xyz", "rpy", "size", "value")
        for word in element.get(key, "").split()
    ]
    assert np.isfinite(numbers).all()


def test_what_was_asked_for_is_made_once_and_undone_when_mended() -> None:
    damage = Damage(TRIPOD, damaged)
    assert damage.new_body() is None
    damage.inject("cut", 1, 50.0)
    damage.inject("weight", 2, 80.0)
    body = damage.new_body()
    assert body is not None
    assert body.mass == pytest.approx(TRIPOD.mass + 0.08 - 0.04 * (1 - 0.09 / 0.186))
    assert damage.new_body() is None
    damage.mend()
    assert damage.new_body() == TRIPOD


@pytest.mark.parametrize(
    ("fault", "number", "amount"), [("cut", 1, 0.0), ("cut", 4, 50.0), ("bent", 1, 120.0)]
)
def test_what_cannot_be_is_refused(fault: str, number: int, amount: float) -> None:
    with pytest.raises(CommandError, match="needs"):
        Damage(TRIPOD, damaged).inject(fault, number, amount)
