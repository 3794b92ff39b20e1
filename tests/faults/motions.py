"""What the scenarios have in common: a board, a daemon on it, a controller, a motion under way."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Final

import serial

from bench.daemons import Simulator, simulator
from bench.still_robot import example_config
from protocol.errors import BodyschemaError, RobotError
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply, Status
from sim_robot.electronics.sv203 import SV203Emulator
from tests.faults.matrix import PROCESSES

DAEMON: Final = "bench.still_robotd"
FAR: Final = -90.0
ZERO: Final = tuple(joint.quantise(0.0) for joint in example_config("").joints)
"""The counts of the zero pose."""


@contextmanager
def servo_board() -> Iterator[SV203Emulator]:
    """A board that belongs to nobody."""
    found = SV203Emulator()
    try:
        yield found
    finally:
        found.close()


def daemon(
    board: SV203Emulator,
    speed: float = 60.0,
    *options: str,
    bind: str = "tcp://127.0.0.1:*",
    environment: Mapping[str, str] | None = None,
) -> AbstractContextManager[Simulator]:
    """A ``robotd`` on the board; speed in degrees per second."""
    own = ("--port", board.port, "--speed", str(speed))
    return simulator(*own, *options, bind=bind, module=DAEMON, environment=environment)


@contextmanager
def controller(uri: str) -> Iterator[RobotClient]:
    """A client in control."""
    with RobotClient(uri, timeout=120) as client:
        client.acquire()
        yield client


class Motion:
    """A motion of the first hip, asked for in a thread of its own; leave it to wait for its end."""

    def __init__(self, client: RobotClient, degrees: float = FAR):
        self._client = client
        self._targets = {joint.name: 0.0 for joint in client.capabilities.joints}
        self._targets["hip_left"] = math.radians(degrees)
        self.end: ObservationReply | BodyschemaError | None = None
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        try:
            self.end = self._client.perform(self._targets)
        except BodyschemaError as error:
            self.end = error

    def __enter__(self) -> Motion:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.join(300)
        assert not self._thread.is_alive()


def wait_until(condition: Callable[[], bool], timeout: float = 120) -> None:
    """Looks again and again."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def wait_for_motion(board: SV203Emulator) -> None:
    """Until the first hip is well on its way from zero downwards."""
    wait_until(lambda: board.pulses()[0] < ZERO[0] - 25)


def pulses_at_last(board: SV203Emulator) -> tuple[int, ...]:
    """The pulses once the board has done all that it was told: it answers in order.

    For a board whose daemon is gone.
    """
    with serial.Serial(board.port, timeout=60) as line:
        line.write(b"BD1RR1\r")
        assert line.read_until(b"\r").endswith(b"\r")
    return board.pulses()


def check(name: str, end: object, status: Status | None = None) -> None:
    """Holds an outcome against the matrix."""
    row = PROCESSES[name]
    if row.code is None:
        assert isinstance(end, ObservationReply), end
    else:
        assert isinstance(end, RobotError), end
        assert end.code == row.code
        assert row.words in end.message
    if status is not None:
        assert status.state == row.state
