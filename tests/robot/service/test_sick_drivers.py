"""Drivers that hang, die or give nonsense, behind a real server: ``stop`` comes through in time."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import pytest

from bench.still_robot import StillRobot, still_robot
from protocol.errors import RobotError
from protocol.transport.client import RobotClient
from protocol.transport.server import Server
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.messages import Ok
from robot.control import watched_thread
from robot.control.jobs import JobQueue
from robot.errors import DeviceTimeoutError, DriverError
from robot.host.clock import WallClock

IN_TIME: Final = 0.25  # s
ALL: Final = (
    "servos.verify",
    "servos.set_counts",
    "servos.release",
    "accelerometer.acceleration",
    "touch.load",
    "distance.check",
)
"""What the control loop calls; each is called by one of the requests of ``Ward.ask``."""


@dataclass
class Ward:
    """A robot in real time, whose drivers can be made sick, and clients of it."""

    robot: StillRobot
    client: RobotClient
    bystander: RobotClient
    free: threading.Event = field(default_factory=threading.Event)
    entered: threading.Event = field(default_factory=threading.Event)
    given: tuple[Any, ...] = ()
    ends: list[object] = field(default_factory=list)

    def make(self, place: str, act: Callable[[], Any]) -> pytest.MonkeyPatch:
        """Has a method of a driver do something else, until it is undone."""
        part, method = place.split(".")
        devices = self.robot.devices
        driver = devices.touch[0] if part == "touch" else getattr(devices, part)
        well = getattr(driver, method)

        def sick(*given: Any) -> Any:
            self.given = given
            return act() or well(*given)

        patch = pytest.MonkeyPatch()
        patch.setattr(driver, method, sick)
        return patch

    def hang(self) -> None:
        self.entered.set()
        assert self.free.wait(60)

    def ask(self, place: str) -> None:
        """The request that meets a driver's method."""
        try:
            if place == "servos.release":
                self.ends.append(self.client.relax())
            elif place.startswith("servos."):
                self.ends.append(self.client.perform(targets(self.robot, -20.0)))
            else:
                self.ends.append(self.client.read())
        except RobotError as error:
            self.ends.append(error)

    def begin(self, place: str) -> threading.Thread:
        self.ends.clear()
        asking = threading.Thread(target=self.ask, args=(place,))
        asking.start()
        return asking

    def stopped_in_time(self) -> RobotError | str:
        """The answer to a stop; asked again where this computer had no time for it."""
        for _ in range(5):
            begun = time.monotonic()
            answer: RobotError | str
            try:
                answer = self.bystander.stop().state
            except RobotError as error:
                answer = error
            if time.monotonic() - begun < IN_TIME:
                return answer
        raise AssertionError("no stop was answered in time")

    def counts(self) -> tuple[int, ...]:
        assert self.robot.servo_board.wait_until_read(self.robot.servos.bytes_written, 10)
        return self.robot.servo_board.pulses()

    def counts_after(self, before: tuple[int, ...], given: Mapping[int, int]) -> tuple[int, ...]:
        """What the board has once an update has gone out, and nothing else."""
        return tuple(given.get(output, count) for output, count in enumerate(before, start=1))


def targets(robot: StillRobot, degrees: float) -> dict[str, float]:
    return {joint.name: math.radians(degrees) for joint in robot.config.joints}


def wait_until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture(scope="module")
def serving() -> Iterator[Ward]:
    log = logging.getLogger("test")
    with (
        still_robot(WallClock(), housekeeping=0.2, log=log) as robot,
        Server(robot.controller, bind="tcp://127.0.0.1:*", telemetry_rate=20.0, log=log) as server,
    ):
        robot.controller.start()
        thread = threading.Thread(target=server.run)
        thread.start()
        with RobotClient(server.endpoint) as client, RobotClient(server.endpoint) as bystander:
            client.acquire()
            yield Ward(robot, client, bystander)
        assert robot.controller.shut_down()
        server.request_stop()
        thread.join()


@pytest.fixture
def ward(serving: Ward) -> Iterator[Ward]:
    serving.free.clear()
    serving.entered.clear()
    yield serving
    serving.free.set()
    wait_until(lambda: serving.robot.controller._thread.rests)
    if serving.client.status().state in ("stopped", "fault"):
        serving.client.clear()
    serving.client.hold()


@pytest.mark.parametrize("place", ALL)
def test_a_stop_is_answered_while_a_driver_hangs_and_freezes_the_robot_afterwards(
    ward: Ward, place: str
) -> None:
    sick = ward.make(place, ward.hang)
    asking = ward.begin(place)
    assert ward.entered.wait(60)
    unsure = ward.stopped_in_time()
    assert isinstance(unsure, RobotError)
    assert (unsure.code, unsure.retryable) == ("not_confirmed", True)
    wait_until(lambda: "does not turn" in (ward.bystander.status().reason or ""))
    reason = ward.bystander.status().reason or ""
    assert f"does not return from {place.split('.')[1]}" in reason
    before = ward.counts()
    sick.undo()
    ward.free.set()
    asking.join()
    assert ward.bystander.stop().state == "stopped"
    (end,) = ward.ends
    if place == "servos.release":  # its line was under way, and nothing follows it
        assert end == Ok(id=ward.client.next_id - 1, state="relaxed")
        assert set(ward.counts()) == {0}
    else:
        assert isinstance(end, RobotError)
        assert end.code == "aborted_stop"
        # The update that it had been given goes out when it returns, and nothing more.
        given = ward.given[0] if place == "servos.set_counts" else {}
        assert ward.counts() == ward.counts_after(before, given)
    assert ward.client.status().state == "stopped"
    assert "does not turn" not in (ward.client.status().reason or "")


@pytest.mark.parametrize(
    ("place", "kind"),
    [
        ("servos.set_counts", SystemExit),
        ("servos.release", KeyboardInterrupt),
        ("touch.load", GeneratorExit),
        ("accelerometer.acceleration", MemoryError),
    ],
)
def test_whatever_a_driver_raises_the_robot_is_down_and_answers(
    ward: Ward, place: str, kind: type[BaseException], caplog: pytest.LogCaptureFixture
) -> None:
    def leave() -> None:
        raise kind("7\n" * 2_000_000)

    sick = ward.make(place, leave)
    ward.ask(place)
    end = ward.ends[-1]
    assert isinstance(end, RobotError)
    assert end.code == "fault"
    assert f"failed in {place.split('.')[1]}: {kind.__name__}" in end.message
    status = ward.client.status()
    assert (status.state, status.reason) == ("fault", end.message)
    assert ward.stopped_in_time() == "fault"
    with pytest.raises(RobotError) as refused:
        ward.client.read()
    assert refused.value.code == "fault"
    sick.undo()
    assert ward.client.clear().state == "holding"
    faults = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert any(kind.__name__ in line for line in faults)
    assert all(len(line) < 2_000 for line in faults)


def test_a_clear_or_a_look_at_the_idle_board_that_dies_is_a_fault(ward: Ward) -> None:
    def leave() -> None:
        raise SystemExit

    sick = ward.make("servos.verify", leave)
    wait_until(lambda: ward.bystander.status().state == "fault")  # nobody asked for anything
    sick.undo()
    for place in ("servos.read_counts", "distance.start", "touch.load"):
        sick = ward.make(place, leave)
        with pytest.raises(RobotError, match="SystemExit") as refused:
            ward.client.clear()
        assert refused.value.code == "fault"
        assert ward.stopped_in_time() == "fault"
        sick.undo()
    assert ward.client.clear().state == "holding"


def test_a_driver_that_hangs_for_long_takes_the_robot_down_for_everybody(
    ward: Ward, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(watched_thread, "PATIENCE", 0.5)
    sick = ward.make("servos.set_counts", ward.hang)
    asking = ward.begin("servos.set_counts")
    assert ward.entered.wait(60)
    asking.join()  # the robot answers in the driver's place
    before = ward.counts()  # by now the board has all that was sent before the driver hung
    (end,) = ward.ends
    assert isinstance(end, RobotError)
    assert end.code == "fault"
    assert "the driver of the SV203 does not return from set_counts" in end.message
    status = ward.bystander.status()
    assert (status.state, status.reason) == ("fault", end.message)
    with TelemetrySubscriber(ward.bystander.telemetry_endpoint) as telemetry:
        assert telemetry.next(10).state == "fault"
    for _ in range(3):
        unsure = ward.stopped_in_time()
        assert isinstance(unsure, RobotError)
        assert unsure.code == "not_confirmed"
        assert "SV203" in unsure.message
    for refused in (ward.client.clear, ward.client.read, ward.client.hold):
        with pytest.raises(RobotError, match="does not turn"):
            refused()
    sick.undo()
    ward.free.set()
    wait_until(lambda: "the control loop turns again" in caplog.text)
    assert ward.stopped_in_time() == "fault"  # it stays down, and goes no further
    assert ward.counts() == ward.counts_after(before, ward.given[0])
    faults = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert ["does not return from set_counts" in line for line in faults] == [True]
    assert "refused: stop" not in caplog.text  # it is in force
    assert ward.client.clear().state == "holding"
    ward.client.perform(targets(ward.robot, 0.0))


@pytest.mark.parametrize(
    ("place", "bad"),
    [
        ("accelerometer.acceleration", math.nan),
        ("touch.load", math.nan),
        ("touch.load", math.inf),
        ("distance.distance", math.nan),
        ("distance.distance", -math.inf),
    ],
)
def test_a_sample_that_is_not_finite_is_a_fault(ward: Ward, place: str, bad: float) -> None:
    sick = ward.make(place, lambda: (0.0, bad, 1.0) if "acc" in place else bad)
    before = ward.client.status().sequence
    ward.ask(place)
    sick.undo()
    (end,) = ward.ends[-1:]
    assert isinstance(end, RobotError)
    assert end.code == "fault"
    assert "no finite number" in end.message
    assert ward.client.clear().state == "holding"
    assert ward.client.status().sequence == before


def test_the_death_of_the_control_thread_is_known_and_answered(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    log = logging.getLogger("test")
    with (
        still_robot(WallClock(), housekeeping=None, log=log) as robot,
        Server(robot.controller, bind="tcp://127.0.0.1:*", log=log) as server,
    ):
        robot.controller.start()
        thread = threading.Thread(target=server.run)
        thread.start()
        with RobotClient(server.endpoint) as client, RobotClient(server.endpoint) as bystander:
            client.acquire()
            before, take = robot.servo_board.pulses(), JobQueue.take

            def die(*values: Any) -> None:
                monkeypatch.setattr(JobQueue, "take", take)
                raise SystemExit("a bug of ours")

            monkeypatch.setattr(JobQueue, "take", die)
            with pytest.raises(RobotError, match="The control loop has ended: SystemExit") as ended:
                client.hold()
            assert ended.value.code == "fault"
            assert bystander.status().state == "fault"
            assert bystander.stop().state == "fault"
            for refused in (client.clear, client.read, client.hold):
                with pytest.raises(RobotError, match="Start the daemon again") as error:
                    refused()
                assert error.value.code == "fault"
            assert robot.servo_board.pulses() == before
        assert not robot.controller.shut_down()  # so that the exit status is no success
        server.request_stop()
        thread.join()
    assert "the control loop ended" in caplog.text


def test_closing_waits_for_no_driver_and_closes_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    free, closed = threading.Event(), []
    log = logging.getLogger("test")
    with still_robot(WallClock(), housekeeping=None, log=log) as robot:
        devices = robot.devices

        def leave() -> None:
            raise SystemExit(0)

        with monkeypatch.context() as sick:
            sick.setattr(devices.accelerometer, "close", leave)
            sick.setattr(devices.distance, "close", lambda: closed.append("distance"))
            with pytest.raises(DriverError, match="analogue failed in close: SystemExit: 0"):
                devices.close()
        assert closed == ["distance"]
        with monkeypatch.context() as sick:
            sick.setattr("robot.drivers.guard.CLOSING", 0.1)
            sick.setattr(devices.servos, "close", lambda: free.wait(60))
            with pytest.raises(DeviceTimeoutError, match="SV203 does not return from close"):
                devices.close()
            free.set()
