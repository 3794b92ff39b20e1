"""A simulated robot whose servos say where they are: what it notices, names and never does."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from protocol.wire.messages import ErrorReply, Hold, ObservationReply, Relax
from robot.control.controller import Controller
from robot.diagnosis.doctor import Doctor
from robot.diagnosis.findings import Finding, Severity
from robot.errors import CommandError, DeviceDataError
from robot.trial.session import Trial
from sim_robot.electronics.feetech import MIN_ANGLE, FeetechEmulator
from sim_robot.faults.fault_panel import FaultSpec
from sim_robot.simulator.daemon import Emulation, emulation, robot_on, switch_on
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NO_NOISE
from tests.robot.trial.person import Person
from tests.sim_robot.simulator.requests import Requests

BODY = load_body(default_body_path())
LOG = logging.getLogger("test")
UP = {motor.name: 0.35 if "hip" in motor.name else 0.0 for motor in BODY.motors}


@contextmanager
def robot(
    electronics: str = "feetech",
) -> Iterator[tuple[Emulation, Controller, Requests]]:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics=electronics
    ) as parts:
        controller = robot_on(parts, LOG, operator=True)
        requests = Requests(controller)
        controller.start()
        try:
            yield parts, controller, requests
        finally:
            controller.shut_down()


def observed(requests: Requests, **targets: float) -> ObservationReply:
    reply = requests.perform(UP | targets)
    assert isinstance(reply, ObservationReply), reply
    return reply


def observed_again(requests: Requests) -> ObservationReply:
    reply = requests.read()
    assert isinstance(reply, ObservationReply), reply
    return reply


@pytest.mark.parametrize("electronics", ["feetech", "dynamixel"])
def test_an_observation_says_where_the_joints_were(electronics: str) -> None:
    with robot(electronics) as (parts, controller, requests):
        reply = observed(requests)
        assert reply.measured is not None
        truth = dict(zip(UP, parts.world.angles(), strict=True))
        assert reply.measured == pytest.approx(truth, abs=math.radians(0.05))
        assert reply.measured == pytest.approx(dict(reply.angles), abs=math.radians(0.2))
        assert reply.off_target is None
        assert controller.snapshot().reason is None
        joint = controller.capabilities.joints[0]
        assert joint.measured_noise == pytest.approx(math.radians(0.05))


@pytest.mark.parametrize(
    ("fault", "kind", "second"),
    [
        ("jammed", "jammed", "jammed"),
        ("dead", "dead", "dead"),
        ("blocked", "blocked or too weak", "blocked"),
    ],
)
def test_a_joint_is_named_within_the_movement_that_shows_it(
    fault: str, kind: str, second: str
) -> None:
    with robot() as (parts, controller, requests):
        observed(requests)
        name = parts.config.joints[1].name
        parts.panel.order(FaultSpec.parse(f"servos.{fault}=2@{parts.panel.interactions + 1}i"))
        reply = observed(requests, **{name: 0.4})
        assert reply.off_target == {name: kind}
        assert f"{name} is {kind}: at " in (controller.snapshot().reason or "")
        assert observed(requests, **{name: 0.5}).off_target == {name: second}
        parts.panel.mend()
        assert observed(requests).off_target is None
        assert controller.snapshot().reason is None


def test_reading_once_more_tells_no_more_until_the_joint_is_in_order() -> None:
    with robot() as (parts, controller, requests):
        observed(requests)
        name = parts.config.joints[1].name
        parts.panel.order(FaultSpec.parse(f"servos.blocked=2@{parts.panel.interactions + 1}i"))
        assert observed(requests, **{name: 0.4}).off_target == {name: "blocked or too weak"}
        assert observed_again(requests).off_target == {name: "blocked or too weak"}
        assert "blocked or too weak: at " in (controller.snapshot().reason or "")
        parts.panel.mend()
        assert observed_again(requests).off_target is None
        assert controller.snapshot().reason is None


def test_a_daemon_that_has_seen_no_movement_calls_no_joint_jammed() -> None:
    with robot() as (parts, _, requests):
        observed(requests)
        name = parts.config.joints[1].name
        parts.panel.order(FaultSpec.parse(f"servos.blocked=2@{parts.panel.interactions + 1}i"))
        observed(requests, **{name: 0.4})
        later = robot_on(parts, LOG, operator=True)
        later_requests = Requests(later)
        later.start()
        try:
            assert observed_again(later_requests).off_target == {name: "blocked or too weak"}
        finally:
            later_requests.stop()  # or both daemons park
            later.shut_down()


def test_a_robot_whose_servos_answer_nothing_notices_nothing_of_it() -> None:
    with robot("pi") as (parts, _, requests):
        parts.panel.order(FaultSpec.parse("servos.jammed=2"))
        reply = observed(requests)
        assert (reply.measured, reply.off_target) == (None, None)


def test_a_robot_that_starts_limp_says_that_it_will_not_leap() -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics="feetech"
    ) as parts:
        reason = robot_on(parts, LOG, operator=False).snapshot().reason
        assert "A hold request holds each joint where it is." in (reason or "")


def test_a_limp_robot_is_held_where_it_lies() -> None:
    with robot() as (parts, _, requests):
        stood = observed(requests, **{name: -0.35 for name in UP if "hip" in name}).angles
        assert requests.ask(Relax).state == "relaxed"
        parts.clock.sleep(2.0)
        before = parts.world.angles()
        assert before != pytest.approx([*stood.values()], abs=math.radians(5))  # it sank
        assert requests.ask(Hold).state == "holding"
        parts.clock.sleep(1.0)
        assert parts.world.angles() == pytest.approx(before, abs=math.radians(0.2))


@pytest.mark.parametrize("electronics", ["feetech", "dynamixel"])
@pytest.mark.parametrize("fault", ["reboot=2", "overload=2", "silent=2", "hot=2"])
def test_a_servo_that_lets_go_in_mid_motion_spoils_the_observation(
    electronics: str, fault: str
) -> None:
    with robot(electronics) as (parts, controller, requests):
        line = next(name for name in parts.electronics.switches if name == electronics)
        parts.panel.order(FaultSpec.parse(f"{line}.{fault}@{parts.clock.now() + 0.3}s"))
        reply = requests.perform(UP)
        assert isinstance(reply, ErrorReply)
        assert reply.code == "fault"
        assert "2" in reply.message
        assert controller.snapshot().state == "fault"


def test_a_joint_is_let_go_moved_by_hand_and_held_where_it_is() -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics="feetech"
    ) as parts:
        switch_on(parts, LOG)
        parts.devices.close()
        parts.world.hold(1.0)
        hanging: list[float] = []
        person = Person(
            parts.clock,
            [
                *("g", 0.5, "g", 1.0, "down", 0.5),
                lambda: hanging.append(parts.world.angles()[0]),
                *("h", 1.0, "right", 1.0, "down", "left", 0.5),
            ],
        )
        Trial(parts.config, parts.buses, person, by_hand=True).run()
        assert math.degrees(hanging[0]) < -60  # as gravity moves it, in the place of a hand
        held, other, *_ = map(math.degrees, parts.world.angles())
        assert held == pytest.approx(math.degrees(hanging[0]) + 1, abs=0.5)
        assert other == pytest.approx(-1, abs=0.2)
        texts = "\n".join(person.seen)
        assert "Support hip_left, then g again lets it go." in texts
        assert "hip_left is limp: h holds it where it is." in texts
        shown = re.findall(r"hip_left +limp is (.*)°  ", texts)
        assert float(shown[-1]) < -60


def test_servos_that_answer_nothing_are_not_moved_by_hand() -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics="pi"
    ) as parts:
        parts.devices.close()
        with pytest.raises(CommandError, match="do not say where they are"):
            Trial(parts.config, parts.buses, Person(parts.clock, []), by_hand=True).run()


def test_servos_that_are_limited_in_their_own_memory_are_refused() -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics="feetech"
    ) as parts:
        servos = parts.electronics.switches["feetech"]
        assert isinstance(servos, FeetechEmulator)
        servos.servos[2].set_word(MIN_ANGLE, 1500)
        parts.devices.servos.forget()
        with pytest.raises(DeviceDataError, match="The servo 3 of hip_right is limited to counts"):
            robot_on(parts, LOG, operator=True)
        findings = examined(parts)
        assert "is limited to counts 1500 to 4095" in findings["joint hip_right"].text
        assert findings["joint hip_right"].verdict is Severity.BAD


@pytest.mark.parametrize(
    ("fault", "words"), [("jammed", "is jammed"), ("dead", "is dead"), (None, "it went there")]
)
def test_the_doctor_names_a_joint_that_does_not_move(fault: str | None, words: str) -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics="feetech"
    ) as parts:
        switch_on(parts, LOG)
        if fault:
            parts.panel.order(FaultSpec.parse(f"servos.{fault}=2"))
        findings = examined(parts, move=True)
        assert words in findings["move hip_front"].text
        assert "7.4 V" in findings["joint hip_left"].text
        assert findings["move hip_left"].verdict is Severity.OK


@pytest.mark.parametrize(
    ("electronics", "fault", "words"),
    [
        ("feetech", "silent", "does not answer"),
        ("feetech", "hot", "reports overheat"),
        ("dynamixel", "silent", "does not answer"),
    ],
)
def test_the_doctor_names_the_joint_of_a_servo_that_fails_and_examines_the_others(
    electronics: str, fault: str, words: str
) -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics=electronics
    ) as parts:
        switch_on(parts, LOG)
        parts.panel.order(FaultSpec.parse(f"{electronics}.{fault}=3"))
        findings = examined(parts, move=True)
    bad = [subject for subject, one in findings.items() if one.verdict is Severity.BAD]
    assert bad == ["joint hip_right"]
    assert re.match(rf"Servo 3 \(\w+\) {words}", findings["joint hip_right"].text)
    assert {f"joint {name}" for name in UP} < findings.keys()
    assert {f"move {name}" for name in UP} - findings.keys() == {"move hip_right"}


@pytest.mark.parametrize("electronics", ["feetech", "dynamixel"])
def test_a_line_on_which_no_servo_answers_is_one_finding_of_the_doctor(electronics: str) -> None:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=LOG, electronics=electronics
    ) as parts:
        parts.panel.order(FaultSpec.parse(f"{electronics}.lost=1"))
        findings = examined(parts)
    bad = [subject for subject, one in findings.items() if one.verdict is Severity.BAD]
    assert bad == ["servo board"]


def examined(parts: Emulation, *, move: bool = False) -> dict[str, Finding]:
    parts.devices.close()
    doctor = Doctor(parts.config, parts.buses, move=move)
    return {one.subject: one for one in doctor.examine()}
