from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

import pytest

from estimator.errors import EstimatorError, InteractionError
from estimator.identification.robot_link import WireLink, open_robot
from estimator.readings.observation import Program
from estimator.storage.records import Ticket
from protocol.errors import BodyschemaError, RobotError, RobotRestartedError
from protocol.wire.messages import ObservationReply, Perform
from tests.estimator.model_robot import ModelRobot, serving

PROGRAM = (0.3, -0.2, 0.1, 0.4)


def ignore(phase: str, fraction: float) -> None:
    """Progress is of no interest."""


def connect(uri: str, first_id: int = 1) -> WireLink:
    return WireLink(uri, client_id="me", first_id=first_id)


def test_an_observation_over_the_wire() -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        link = open_robot(uri, driven=lambda _: (0,), client_id="me", first_id=70)
        assert link.capabilities.robot == "model"
        assert link.recorded is None
        ticket = link.ticket()
        assert ticket is not None
        assert ticket.request_id > 70
        observation = link.perform(0, PROGRAM, ticket, ignore)
        assert observation.angles == PROGRAM
        assert observation.sequence == 1
        assert len(observation.touch) == 4
        link.close()


def test_a_later_connection_is_told_the_outcome_and_the_robot_moves_once() -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        first = connect(uri)
        ticket = first.ticket()
        assert ticket is not None
        observation = first.perform(0, PROGRAM, ticket, ignore)
        first.close()
        second = connect(uri, first_id=1000)
        assert second.outcome(PROGRAM, ticket, ignore) == observation
        second.close()
    assert len(robot.motions) == 1


def test_a_request_that_never_arrived_has_no_outcome_and_moves_nothing() -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        first = connect(uri)
        ticket = first.ticket()
        assert ticket is not None
        first.close()
        second = connect(uri, first_id=1000)
        assert second.outcome(PROGRAM, ticket, ignore) is None
        assert not robot.motions
        second.perform(0, PROGRAM, second.ticket(), ignore)
        second.close()
    assert len(robot.motions) == 1


def test_after_a_restart_of_the_daemon_nobody_knows_the_outcome() -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        link = connect(uri)
        with pytest.raises(RobotRestartedError):
            link.outcome(PROGRAM, Ticket(request_id=1, session="another life"), ignore)
        link.close()
    assert not robot.motions


def test_a_restart_between_two_requests_is_no_reason_to_stop() -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        link = connect(uri)
        link.perform(0, PROGRAM, link.ticket(), ignore)
    with serving(robot, bind=uri):
        link.perform(0, PROGRAM, link.ticket(), ignore)
        link.close()
    assert len(robot.motions) == 2


def test_another_robot_is_not_taken_for_the_one_that_restarted() -> None:
    robot, other = ModelRobot(), ModelRobot()
    other.capabilities = replace(other.capabilities, base_mass=0.4)
    with serving(robot) as uri:
        link = connect(uri)
        link.perform(0, PROGRAM, link.ticket(), ignore)
    with serving(other, bind=uri), closing(link):
        for _ in range(2):
            with pytest.raises(InteractionError, match="restarted, and has other joints, sensors"):
                link.ticket()
    assert not other.motions


def test_a_second_controller_is_refused() -> None:
    with serving(ModelRobot()) as uri:
        first, second = connect(uri), WireLink(uri, client_id="other", first_id=1)
        first.ticket()
        with pytest.raises(BodyschemaError, match="holds the robot"):
            second.ticket()
        first.close()
        second.close()


@pytest.mark.parametrize("uri", ["", "robot", "http://localhost", "file:", "replay:", "tcp:5750"])
def test_what_names_no_robot_is_refused(uri: str) -> None:
    with pytest.raises(EstimatorError, match="names no robot: write tcp://"):
        open_robot(uri, driven=lambda _: (0,), client_id="me", first_id=1)


class LyingRobot(ModelRobot):
    """Answers its first motion with something else than it felt."""

    def __init__(self, **lie: object):
        super().__init__()
        self._lie = lie

    def _observe(self, request: Perform) -> ObservationReply:
        lie, self._lie = self._lie, {}
        return replace(super()._observe(request), **lie)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("lie", "sentence"),
    [
        ({"tilt": (1e300, 0.0)}, "reported a tilt of"),
        ({"clearance": 0.25}, "reported a clearance of 250 mm"),
        ({"touch": (True,)}, "reported 1 touch bits of 4 touch sensors"),
        ({"angles": {"left": 0.0}}, "reported angles of left, but its joints are left, front"),
        ({"saturated_joints": ("knee",)}, "reported knee at an end, but its joints are left"),
        (
            {"angles": {"left": 0.6, "front": -0.2, "right": 0.1, "back": 0.4}},
            "an angle of 34.38° of joint left, which was told to go to 17.19° and has steps of",
        ),
        (
            {"angles": {"left": 0.3, "front": 0.1, "right": -0.2, "back": 0.4}},
            r"an angle of 5.73° of joint front, .*; that is the target of right",
        ),
        ({"angles": {"left": 0.3, "front": -0.2, "right": 0.1, "back": 0.4101}}, "joint back"),
    ],
)
def test_what_cannot_be_is_refused_and_can_be_tried_again(
    lie: dict[str, object], sentence: str
) -> None:
    with serving(LyingRobot(**lie)) as uri:
        link = connect(uri)
        with pytest.raises(RobotError, match=sentence) as refused:
            link.perform(0, PROGRAM, link.ticket(), ignore)
        assert refused.value.retryable
        assert link.perform(0, PROGRAM, link.ticket(), ignore).angles == PROGRAM
        link.close()


def test_the_nearest_step_of_a_servo_is_what_was_asked_for() -> None:
    steps = {"left": 0.31, "front": -0.21, "right": 0.1, "back": 0.4}
    with serving(LyingRobot(angles=steps)) as uri:
        link = connect(uri)
        observation = link.perform(0, PROGRAM, link.ticket(), ignore)
        assert observation.angles == tuple(steps.values())
        link.close()


class FrozenRobot(ModelRobot):
    """Answers every motion with what it felt first, at the robot times that it is given."""

    def __init__(self, times: Sequence[float], *, noise: float, clearance: float = 0.0312):
        super().__init__()
        self.times, self._clearance = list(times), clearance
        sensors = [replace(one, noise=noise) for one in self.capabilities.sensors[1:]]
        self.capabilities = replace(
            self.capabilities, sensors=(self.capabilities.sensors[0], *sensors)
        )

    def _observe(self, request: Perform) -> ObservationReply:
        felt = super()._observe(request)
        time = self.times.pop(0)
        return replace(felt, robot_time=time, tilt=(0.0123, -0.0045), clearance=self._clearance)


def performed_before_refusal(robot: ModelRobot, programs: Sequence[Program]) -> int:
    with serving(robot) as uri, closing(connect(uri)) as link:
        for done, program in enumerate(programs):
            try:
                link.perform(done, program, link.ticket(), ignore)
            except RobotError as error:
                if "the very readings that it reported before" not in str(error):
                    raise
                return done
    return len(programs)


OTHERS = [(0.3, -0.2, 0.1, angle) for angle in (0.0, 0.1, 0.2, 0.3, 0.4)]


@pytest.mark.parametrize(
    ("noise", "clearance", "programs", "done"),
    [
        (0.001, 0.0312, OTHERS, 2),
        (0.001, 0.2, OTHERS, 2),  # the ground out of range, which says nothing
        (0.001, 0.0312, [PROGRAM] * 5, 5),
        (0.001, 0.0312, [*OTHERS[:2], *[OTHERS[1]] * 2, *OTHERS[3:]], 5),
        (0.0, 0.0312, OTHERS, 5),
    ],
)
def test_a_frozen_robot_is_refused_and_one_without_noise_is_not(
    noise: float, clearance: float, programs: list[Program], done: int
) -> None:
    robot = FrozenRobot(range(6), noise=noise, clearance=clearance)
    assert performed_before_refusal(robot, programs) == done


def test_robot_time_runs_forwards_until_the_daemon_restarts() -> None:
    robot = FrozenRobot([19.1, 9.0, 20.0], noise=0.0)
    with serving(robot) as uri:
        link = connect(uri)
        link.perform(0, PROGRAM, link.ticket(), ignore)
        with pytest.raises(RobotError, match=r"a robot time of 9\.00 s, after one of 19\.10 s"):
            link.perform(1, PROGRAM, link.ticket(), ignore)
        link.perform(1, PROGRAM, link.ticket(), ignore)
    robot.times = [1.0]
    with serving(robot, bind=uri):
        link.perform(2, PROGRAM, link.ticket(), ignore)
        link.close()


def test_a_robot_of_millimetres_is_refused() -> None:
    robot = ModelRobot()
    robot.capabilities = replace(robot.capabilities, base_size=(140.0, 140.0, 85.0))
    with serving(robot) as uri, pytest.raises(EstimatorError, match="base_size holds 140 m"):
        open_robot(uri, driven=lambda _: (0,), client_id="me", first_id=1)
