"""Every device fault of the matrix, injected into a real ``sim-robotd`` while it works."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from bench.daemons import simulator
from protocol.errors import RobotError
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply
from sim_robot.faults.control_socket import FaultClient
from tests.faults.devices import ADAPTER, DEVICES, DISTANCE
from tests.faults.matrix import DeviceRow
from tests.faults.pi_devices import GPIO_DEVICES, PI_DEVICES
from tests.faults.servo_devices import SERVO_DEVICES

# Rests on three feet, the fourth in the air, and always the same: not every pose is as stable.
POSE = {"hip_left": -40.0, "hip_front": -25.0, "hip_back": -25.0}


@dataclass
class Patient:
    """A robot, its controller and whoever breaks it."""

    client: RobotClient
    faults: FaultClient
    reference: ObservationReply
    pulses: list[int]

    def perform(self) -> ObservationReply:
        joints = self.client.capabilities.joints
        targets = {joint.name: math.radians(POSE.get(joint.name, 0.0)) for joint in joints}
        return self.client.perform(targets)

    def outcome(self) -> ObservationReply | RobotError:
        try:
            return self.perform()
        except RobotError as error:
            return error

    def sequence(self) -> int:
        return self.client.status().sequence


MATRIX: dict[str, Mapping[str, tuple[DeviceRow, ...]]] = {
    "pc104": DEVICES,
    "pi": PI_DEVICES | {section: DEVICES[section] for section in (DISTANCE, ADAPTER)},
    **SERVO_DEVICES,
    "gpio": GPIO_DEVICES,
}
CRAWLER = Path(__file__).parents[2] / "docs" / "robots" / "crawler" / "robot.toml"
OPTIONS = {"gpio": ("--config", str(CRAWLER))}


def rows(wanted: Callable[[DeviceRow], bool]) -> list[ParameterSet]:
    found = (
        (electronics, row)
        for electronics, sections in MATRIX.items()
        for section in sections.values()
        for row in section
    )
    return [
        pytest.param(electronics, row, id=f"{electronics}-{row.injected}")
        for electronics, row in found
        if wanted(row)
    ]


class Hospital:
    """A robot with each set of electronics, started when it is first wanted."""

    def __init__(self, stack: ExitStack):
        self._stack = stack
        self._patients: dict[str, Patient] = {}

    def admit(self, electronics: str) -> Patient:
        if electronics not in self._patients:
            options = ("--noise", "none", "--control", "tcp://127.0.0.1:*")
            own = OPTIONS.get(electronics, ("--electronics", electronics))
            process = self._stack.enter_context(simulator(*options, *own))
            client = self._stack.enter_context(RobotClient(process.uri))
            client.acquire()
            faults = FaultClient(process.control)
            patient = Patient(client, faults, reference=None, pulses=[])  # type: ignore[arg-type]
            patient.reference = patient.perform()
            patient.pulses = faults.report()["pulses"]
            self._patients[electronics] = patient
        return self._patients[electronics]


@pytest.fixture(scope="module")
def hospital() -> Iterator[Hospital]:
    with ExitStack() as stack:
        yield Hospital(stack)


@pytest.fixture
def electronics() -> str:
    return "pc104"


@pytest.fixture
def patient(hospital: Hospital, electronics: str) -> Iterator[Patient]:
    robot = hospital.admit(electronics)
    yield robot
    robot.faults.mend()
    if robot.client.status().state == "fault":
        robot.client.clear()


def inject(row: DeviceRow, patient: Patient) -> None:
    now = patient.faults.report()["robot_time"]
    start = f"@{now + row.after:.6f}s" if row.after else ""
    patient.faults.inject(row.injected + start)
    if row.mended_first:
        patient.faults.mend()


def refused(patient: Patient, ask: str) -> RobotError:
    with pytest.raises(RobotError) as error:
        patient.perform() if ask == "perform" else getattr(patient.client, ask)()
    return error.value


def clear(patient: Patient) -> str:
    """Clears; the first code of a mended input may be the very one at which it was stuck."""
    try:
        return patient.client.clear().state
    except RobotError as error:
        if "is stuck" not in error.message:
            raise
        return patient.client.clear().state


@pytest.mark.parametrize(
    ("electronics", "row"), rows(lambda row: bool(row.code) and not row.sometimes)
)
def test_a_fault_takes_the_robot_down_until_it_is_cleared(row: DeviceRow, patient: Patient) -> None:
    before = patient.sequence()
    inject(row, patient)
    error = refused(patient, "perform")
    assert error.code == row.code
    assert row.words in error.message
    status = patient.client.status()
    assert status.state == row.state
    assert row.words in (status.reason or "")
    for ask in ("perform", "read", "hold", "relax"):
        assert refused(patient, ask).code == "fault"
    if row.lasts:
        assert refused(patient, "clear").code == "fault"
        assert patient.client.status().state == row.state
    assert (0 not in patient.faults.report()["pulses"]) != row.limp  # stiff, all the time
    patient.faults.mend()
    assert clear(patient) == "holding"
    assert patient.client.status().reason is None
    check_health(patient, after=before)


@pytest.mark.parametrize(("electronics", "row"), rows(lambda row: row.sometimes))
def test_what_comes_through_is_true(row: DeviceRow, patient: Patient) -> None:
    sentences = []
    for _ in range(6):
        before = patient.sequence()
        inject(row, patient)
        end = patient.outcome()
        patient.faults.mend()
        if isinstance(end, RobotError):
            sentences.append(end.message)
            assert end.code == row.code
            assert patient.sequence() == before
            patient.client.clear()
        else:  # a servo may have leapt and thrown the body over, but this is how it lies now
            assert patient.faults.report()["pulses"] == patient.pulses
            assert same(end, patient.client.read())
    assert any(row.words in sentence for sentence in sentences)
    check_health(patient, after=patient.sequence())


@pytest.mark.parametrize(("electronics", "row"), rows(lambda row: not row.code))
def test_what_is_not_noticed_is_answered_with_what_was_felt(
    row: DeviceRow, patient: Patient
) -> None:
    inject(row, patient)
    before = patient.sequence()
    observation = patient.perform()
    assert observation.sequence == before + 1
    assert observation.angles == patient.reference.angles  # what was commanded
    assert patient.client.status().state == row.state
    # A fault that changes what is measured shows in the reading, which is not smoothed over.
    assert same(observation, patient.reference) == (
        not row.injected.startswith(("servos.", "daq.", "gpio.", "body.", "sensors.", "ground."))
    )
    patient.faults.mend()
    check_health(patient, after=observation.sequence)


def check_health(patient: Patient, *, after: int) -> None:
    observation = patient.perform()
    assert observation.sequence == after + 1
    assert same(observation, patient.reference)
    assert observation.robot_time > patient.reference.robot_time
    assert patient.faults.report()["pulses"] == patient.pulses


def same(one: ObservationReply, other: ObservationReply) -> bool:
    return (
        one.angles == other.angles
        and one.touch == other.touch
        and one.tilt == pytest.approx(other.tilt, abs=math.radians(0.3))
        and one.clearance == pytest.approx(other.clearance, abs=2e-3)
    )


def test_a_brown_out_is_noticed_by_a_reading_too(patient: Patient) -> None:
    patient.perform()
    patient.faults.inject("servo_board.brown_out")
    assert "it was reset" in refused(patient, "read").message
