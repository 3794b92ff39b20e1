import math
from dataclasses import replace

import pytest
from pydantic import ValidationError

from estimator.posterior.model.noise import Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.readings.observation import Observation, by_joint_name, touched
from protocol.wire import messages
from tests.estimator.model_robot import make_capabilities


def wire(**changes: object) -> messages.ObservationReply:
    reply = messages.ObservationReply(
        id=1,
        sequence=3,
        robot_time=2.0,
        monotonic=1.0,
        angles={"back": 0.4, "front": 0.2, "left": 0.1, "right": 0.3},
        saturated_joints=("back",),
        touch=(True, False, False, True),
        tilt=(0.1, -0.1),
        clearance=0.05,
        clearance_saturated=False,
        settled=True,
        settle_time=0.5,
        samples=20,
    )
    return replace(reply, **changes)  # type: ignore[arg-type]


def test_joints_come_in_motor_order_whatever_the_wire_says() -> None:
    observation = Observation.from_wire(wire(), make_capabilities())
    assert observation.angles == (0.1, 0.2, 0.3, 0.4)
    assert by_joint_name(observation.angles, make_capabilities()) == wire().angles
    assert (observation.touch, observation.tilt, observation.clearance) == (
        (True, False, False, True),
        (0.1, -0.1),
        0.05,
    )


def test_a_joint_is_where_it_was_measured_and_else_where_it_was_sent() -> None:
    reply = wire(measured={"left": 0.05, "back": 0.41}, off_target={"left": "sagging"})
    observation = Observation.from_wire(reply, make_capabilities())
    assert observation.measured == (0.05, None, None, 0.41)
    assert observation.taken == (0.05, 0.2, 0.3, 0.41)
    assert observation.angles == (0.1, 0.2, 0.3, 0.4)
    assert observation.off_target == {"left": "sagging"}
    assert Observation.from_wire(wire(), make_capabilities()).taken == (0.1, 0.2, 0.3, 0.4)
    data = SensorData.of([observation], ("tilt",), cap=0.2)
    assert data.programs.tolist() == [[0.05, 0.2, 0.3, 0.41]]


def test_the_play_of_a_measured_joint_widens_the_noise_of_what_leans_on_it() -> None:
    robot = make_capabilities()
    loose = replace(
        robot, joints=tuple(replace(joint, measured_noise=0.02) for joint in robot.joints)
    )
    tight, wide = Noise.announced(robot), Noise.announced(loose)
    assert wide.tilt == pytest.approx(math.hypot(tight.tilt, 0.02))
    assert wide.clearance == pytest.approx(math.hypot(tight.clearance, 0.02 * 0.07))


def test_a_reading_that_was_not_taken_stays_absent() -> None:
    observation = Observation.from_wire(
        wire(touch=None, tilt=None, clearance=None), make_capabilities()
    )
    assert observation.touch == (None, None, None, None)
    assert observation.tilt == (None, None)
    assert observation.clearance is None


def test_json_brings_it_back_exactly() -> None:
    observation = Observation.from_wire(wire(clearance=1 / 3), make_capabilities())
    assert Observation.model_validate_json(observation.model_dump_json()) == observation


def test_a_reading_that_is_no_number_cannot_exist() -> None:
    with pytest.raises(ValidationError):
        Observation(angles=(0.0,), clearance=float("nan"))


def test_whether_a_limb_touched_is_unknown_where_no_sensor_said() -> None:
    silent = Observation(angles=(0.0,), touch=(True, None))
    assert touched((1,), [silent]) is None
    assert touched((1,), [silent, Observation(angles=(0.0,), touch=(True, False))]) is False
    assert touched((1,), [Observation(angles=(0.0,), touch=())]) is None
