"""A robot without a body, a clock stepped by hand, and a server on a free port."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from bench.still_robot import still_robot
from protocol.errors import RobotError
from protocol.rules.robot_interface import Finished, Progressed, RobotEvent, Snapshot
from protocol.security.keys import ROBOT, KeyDirectory, KnownPeer, read_public
from protocol.transport.server import Server
from protocol.wire.capabilities import Capabilities, Joint, Sensor
from protocol.wire.messages import (
    Clear,
    ErrorReply,
    ObservationReply,
    Ok,
    Perform,
    Read,
    RobotRequest,
    State,
    Stop,
)
from robot.control.controller import Controller
from tests.protocol.rules.core_bench import ServerCoreBench
from tests.robot.stepped import SteppedClock


def make_capabilities(**changes: Any) -> Capabilities:
    joints = tuple(
        Joint(name=name, lower=-0.6, upper=0.6, speed=1.0, resolution=0.012) for name in ("a", "b")
    )
    sensors = (
        Sensor(modality="touch", unit="bool", count=4, noise=0.0, rate=100.0),
        Sensor(modality="tilt", unit="rad", count=2, noise=0.005, rate=100.0),
        Sensor(modality="clearance", unit="m", count=1, noise=0.001, rate=20.0, upper=0.2),
    )
    usual = Capabilities(
        robot="fake",
        software="fake 1",
        config_hash="0",
        base_size=(0.14, 0.14, 0.05),
        base_mass=0.5,
        part_radii=(0.013, 0.006),
        joints=joints,
        sensors=sensors,
        telemetry="unset",
        telemetry_rate=1.0,
    )
    return replace(usual, **changes)


class HandClock:
    """A clock that moves only when told."""

    def __init__(self, now: float = 1000.0):
        self.now = now

    def __call__(self) -> float:
        return self.now


class FakeRobot:
    """Answers at once; a manual one leaves motions under way until told to end them."""

    def __init__(self, *, manual: bool = False):
        self.capabilities = make_capabilities()
        self.manual = manual
        self.state = State.IDLE
        self.sequence = 0
        self.silences = 0
        self.controllers: list[str | None] = []
        self.motions: list[Perform] = []
        self.begun = threading.Semaphore(0)  # one for each motion begun
        self.silenced = threading.Event()
        self.freed = threading.Event()
        self.broken = False
        self._under_way: dict[int, Perform] = {}
        self._events: list[RobotEvent] = []
        self._lock = threading.Lock()
        self._notify: Callable[[], None] = lambda: None

    def submit(self, ticket: int, request: RobotRequest) -> None:
        if self.broken:
            raise KeyError("a bug")
        if isinstance(request, Perform):
            if self.state is State.STOPPED:
                raise RobotError("stopped", "The robot is stopped.")
            if self._under_way:
                raise RobotError("busy", "The robot is moving.")
            self.motions.append(request)
            self._under_way[ticket] = request
            self.state = State.MOVING
            if not self.manual:
                self.progress("moving", 0.5)
                self.complete()
            self.begun.release()
            return
        if isinstance(request, Read):
            self.emit(Finished(ticket=ticket, reply=self.observe(request.id)))
            return
        abort = {"stop": "aborted_stop", "hold": "aborted_hold", "relax": "aborted_relax"}
        if request.TYPE in abort:
            self.abort(abort[request.TYPE])
        self.state = State.STOPPED if isinstance(request, Stop) else State.HOLDING
        self.emit(Finished(ticket=ticket, reply=Ok(id=request.id, state=self.state.value)))

    def silence(self, reason: str) -> None:
        self.reason = reason
        self.silences += 1
        self.abort("aborted_silent")
        self.silenced.set()

    def controller_changed(self, client: str | None) -> None:
        self.controllers.append(client)
        if client is None:
            self.freed.set()

    def snapshot(self) -> Snapshot:
        return Snapshot(
            state=self.state,
            robot_time=1.5,
            sequence=self.sequence,
            angles={"a": 0.0, "b": 0.0},
        )

    def events(self) -> list[RobotEvent]:
        with self._lock:
            events, self._events = self._events, []
        return events

    def set_notify(self, notify: Callable[[], None]) -> None:
        self._notify = notify

    # --- for tests --------------------------------------------------------------------------------

    def observe(self, request_id: int) -> ObservationReply:
        self.sequence += 1
        return ObservationReply(
            id=request_id,
            sequence=self.sequence,
            robot_time=1.5,
            monotonic=2.5,
            angles={"a": 0.1, "b": 0.2},
            saturated_joints=(),
            touch=(True, False, True, False),
            tilt=(0.1, -0.1),
            clearance=0.05,
            clearance_saturated=False,
            settled=True,
            settle_time=0.5,
            samples=20,
        )

    def progress(self, phase: str, fraction: float) -> None:
        for ticket in self._under_way:
            self.emit(Progressed(ticket=ticket, phase=phase, fraction=fraction, robot_time=1.0))

    def complete(self) -> None:
        under_way, self._under_way = self._under_way, {}
        self.state = State.HOLDING
        for ticket, request in under_way.items():
            self.emit(Finished(ticket=ticket, reply=self.observe(request.id)))

    def abort(self, code: str) -> None:
        under_way, self._under_way = self._under_way, {}
        if under_way:
            self.state = State.HOLDING
        for ticket, request in under_way.items():
            error = RobotError(code, "The motion ended early.")
            reply = ErrorReply.of(error, request_id=request.id)
            self.emit(Finished(ticket=ticket, reply=reply))

    def emit(self, event: RobotEvent) -> None:
        with self._lock:
            self._events.append(event)
        self._notify()


class Keyring:
    """Key directories of one robot and of those whom it knows."""

    def __init__(self, folder: Path):
        self._folder = folder
        self.robot = folder / "robot"
        self._public = KeyDirectory(self.robot).create("robot")

    def stranger(self, name: str) -> Path:
        """A client that knows the robot, but not the other way round."""
        keys = KeyDirectory(self._folder / name)
        keys.create(name)
        keys.add(KnownPeer(name="robot", public=read_public(self._public)[1], role=ROBOT))
        return keys.path

    def client(self, name: str, role: str) -> Path:
        """A client that the robot knows."""
        path = self.stranger(name)
        self.add(name, role)
        return path

    def add(self, name: str, role: str) -> None:
        public = KeyDirectory(self._folder / name).pair().public
        KeyDirectory(self.robot).add(KnownPeer(name=name, public=public, role=role))

    def remove(self, name: str) -> None:
        KeyDirectory(self.robot).remove(name)


Serve: TypeAlias = Callable[..., Server]


@pytest.fixture(scope="session")
def capabilities() -> Capabilities:
    return make_capabilities()


@pytest.fixture
def bench(capabilities: Capabilities) -> ServerCoreBench:
    return ServerCoreBench(capabilities)


@pytest.fixture
def hand_clock() -> HandClock:
    return HandClock()


@pytest.fixture
def robot() -> FakeRobot:
    return FakeRobot()


@pytest.fixture
def slow_robot() -> FakeRobot:
    return FakeRobot(manual=True)


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    return Keyring(tmp_path)


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Starts servers in threads; closes them, and joins the threads, at the end."""
    with ExitStack() as stack:

        def start(robot: FakeRobot, **options: Any) -> Server:
            server = Server(robot, bind=options.pop("bind", "tcp://127.0.0.1:*"), **options)
            thread = threading.Thread(target=server.run, name="server")
            thread.start()
            stack.callback(thread.join)
            stack.callback(server.close)
            return server

        yield start


@pytest.fixture(scope="module")
def controller() -> Iterator[Controller]:
    """A robot's control loop on still electronics, whose clock runs as fast as it can."""
    with still_robot(SteppedClock(), housekeeping=None, log=logging.getLogger("still")) as robot:
        robot.controller.start()
        yield robot.controller
        assert robot.controller.shut_down()


@pytest.fixture
def calm(controller: Controller) -> Controller:
    """The same, at rest, whatever the test before did."""
    if controller.snapshot().state not in ("idle", "holding"):
        controller.submit(0, Clear(id=0, client="test", session="s"))
        while not list(controller.events()):
            threading.Event().wait(0.005)
    return controller
