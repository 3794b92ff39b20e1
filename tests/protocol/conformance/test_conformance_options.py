"""What the conformance suite tries only where it is told to, or given what that needs."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from bench.still_robot import still_robot
from protocol.conformance.raw_connection import SuiteSettings
from protocol.conformance.suite import CheckStatus, run
from protocol.errors import RobotError, RobotUnreachableError
from protocol.rules import server_core
from protocol.rules.at_most_once import Clients
from protocol.rules.robot_interface import Finished, Robot, RobotEvent
from protocol.security.keys import KeyDirectory
from protocol.wire.messages import ErrorReply, RobotRequest
from robot.control.controller import Controller
from robot.host.clock import WallClock
from tests.protocol.conformance.spoilt import Fault, finds_the_client_of_a_stop
from tests.protocol.conformance.trials import failures, quick_clock, serving, skipped
from tests.protocol.transport.faults import FAULTS

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Keyring, Serve


def test_with_keys(calm: Controller, keyring: Keyring) -> None:
    keys = {
        role: KeyDirectory(keyring.client(role, role)).client_keys()
        for role in ("controller", "viewer")
    }
    with serving(calm, keys=keyring.robot) as uri:
        chosen = ["1.2", "1.5", "1.6", "1.13", "1.15", "3.5", "5.2", "5.9", "8.1", "11.1"]
        results = run(SuiteSettings(uri=uri, keys=keys["controller"], move=True), only=chosen)
        assert failures(results) == []
        assert skipped(results) == {"This key is a controller's."}
        results = run(SuiteSettings(uri=uri, keys=keys["viewer"]), only=chosen)
        assert failures(results) == []
        assert skipped(results) == {"This needs --move.", "This key is a viewer's."}
        with pytest.raises(RobotUnreachableError, match="asks for a key"):
            run(SuiteSettings(uri=uri))


def test_silence(serve: Serve, slow_robot: FakeRobot) -> None:
    server = serve(slow_robot, clock=quick_clock)
    settings = SuiteSettings(uri=server.endpoint, slow=True, move=True, clock=quick_clock)
    results = run(settings, only=["5.5", "5.6", "5.7"])
    assert failures(results) == []
    assert skipped(results) == set()


def test_a_silence_that_is_too_short_or_too_long(
    serve: Serve, robot: FakeRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    for expiry, sentence in ((10.0, "was gone after 2"), (60.0, "was kept for 32 s")):
        monkeypatch.setattr("protocol.rules.control.EXPIRY", expiry)
        server = serve(robot, clock=quick_clock)
        settings = SuiteSettings(uri=server.endpoint, slow=True, clock=quick_clock)
        (complaint,) = failures(run(settings, only=["5.7"]))
        assert sentence in complaint


class Orderly:
    """A robot that carries commands out after the reads before them."""

    def __init__(self, robot: Robot):
        self._robot = robot
        self._reads: set[int] = set()
        self._commands: list[tuple[int, RobotRequest]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def submit(self, ticket: int, request: RobotRequest) -> None:
        if request.TYPE == "read":
            self._reads.add(ticket)
        if self._reads and request.TYPE != "read":
            self._commands.append((ticket, request))
        else:
            self._robot.submit(ticket, request)

    def events(self) -> Sequence[RobotEvent]:
        events = list(self._robot.events())
        self._reads -= {event.ticket for event in events if isinstance(event, Finished)}
        while self._commands and not self._reads:
            self._robot.submit(*self._commands.pop(0))
        return events


def test_commands_that_wait_for_reads(calm: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    floods = "protocol.conformance.checks.connections"  # our reads are quick, but on a busy machine
    monkeypatch.setattr(f"{floods}.GRACE", 0.005)
    monkeypatch.setattr(f"{floods}._time_of_a_read", lambda client: 0.0)
    with serving(Orderly(calm)) as uri:
        (told,) = run(SuiteSettings(uri=uri, motion=10.0), only=["5.16"])
    assert told.status is CheckStatus.FAILED, told.sentence
    assert told.sentence.startswith("A clear waited ")


class Interrupted:
    """A robot whose reads, while somebody controls it, go on until a command ends them."""

    def __init__(self, robot: Robot):
        self._robot = robot
        self._controlled = False
        self._reads: list[tuple[int, int]] = []
        self._ended: list[RobotEvent] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def controller_changed(self, client: str | None) -> None:
        self._controlled = client is not None
        self._robot.controller_changed(client)

    def submit(self, ticket: int, request: RobotRequest) -> None:
        if request.TYPE == "read" and self._controlled:
            self._reads.append((ticket, request.id))
            return
        error = RobotError("aborted_read", "A command of the controller ended the read.")
        self._ended += [
            Finished(ticket=read, reply=ErrorReply.of(error, request_id=number))
            for read, number in self._reads
        ]
        self._reads = []
        self._robot.submit(ticket, request)

    def events(self) -> Sequence[RobotEvent]:
        ended, self._ended = self._ended, []
        return [*ended, *self._robot.events()]


@pytest.mark.parametrize(
    ("name", "clause"), [(None, None), ("leaves the id out of errors", "2.12")]
)
def test_reads_that_a_command_ends(
    name: str | None, clause: str | None, calm: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = FAULTS[name][1] if name else Fault()
    fault.patch(monkeypatch)
    monkeypatch.setattr(
        "protocol.conformance.checks.connections._time_of_a_read", lambda client: 0.0
    )
    with serving(Interrupted(calm), fault) as uri:
        results = run(SuiteSettings(uri=uri, patience=1.0), only=["5.16", "2.12"])
    blamed = {each.check.clauses[0] for each in results if each.status is CheckStatus.FAILED}
    assert blamed == ({clause} if clause else set())


@pytest.mark.parametrize(
    "fault",
    [
        ("1.17", Clients, "_same_user", staticmethod(lambda known, user: None)),
        ("1.18", server_core, "MAX_READS", 1000),
    ],
)
def test_what_needs_keys(
    calm: Controller, keyring: Keyring, monkeypatch: pytest.MonkeyPatch, fault: tuple[Any, ...]
) -> None:
    clause, *changed = fault
    keys, others = (
        KeyDirectory(keyring.client(role, role)).client_keys() for role in ("controller", "viewer")
    )
    with serving(calm, keys=keyring.robot) as uri:
        alone = SuiteSettings(uri=uri, keys=keys, patience=1.0)
        both = replace(alone, other_keys=others)
        results = run(both, only=[clause])
        assert {told.status for told in results} == {CheckStatus.PASSED}, results
        monkeypatch.setattr(*changed)
        assert failures(run(both, only=[clause]))
        if clause == "1.17":
            needed = "This needs the keys of another client, --other-keys."
            assert skipped(run(alone, only=[clause])) == {needed}


def test_a_robot_that_refuses_a_stop_with_the_id_of_another(
    calm: Controller, keyring: Keyring
) -> None:
    keys, others = (
        KeyDirectory(keyring.client(name, "controller")).client_keys() for name in ("one", "other")
    )
    fault = Fault(spoil=finds_the_client_of_a_stop)
    with serving(calm, fault, keys=keyring.robot) as uri:
        results = run(SuiteSettings(uri=uri, keys=keys, other_keys=others), only=["1.17"])
    (complaint,) = failures(results)
    assert "stop was answered with unauthorised instead of ok" in complaint


@pytest.fixture
def in_real_time() -> Iterator[Controller]:
    """A robot whose motions take their time; it may be shut down."""
    with still_robot(WallClock(), housekeeping=None, log=logging.getLogger("still")) as robot:
        robot.controller.start()
        yield robot.controller
        assert robot.controller.shut_down()


def test_silence_in_mid_motion(in_real_time: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(in_real_time, clock=quick_clock) as uri:
        settings = SuiteSettings(uri=uri, slow=True, move=True, clock=quick_clock)
        (told,) = run(settings, only=["5.6"])
        assert told.status is CheckStatus.PASSED, told.sentence
        monkeypatch.setattr(Controller, "silence", lambda *_: None)
        (complaint,) = failures(run(settings, only=["5.6"]))
    assert "A motion went on through " in complaint


def test_the_suite_is_no_silent_controller_while_a_motion_tells_of_itself(
    in_real_time: Controller,
) -> None:
    with serving(in_real_time, clock=lambda: time.monotonic() * 7) as uri:
        results = run(SuiteSettings(uri=uri, move=True), only=["7.2"])  # builds on a perform
    assert failures(results) == []


@pytest.mark.parametrize("silent", [False, True])
def test_a_daemon_that_ends(in_real_time: Controller, *, silent: bool) -> None:
    def lose(frame: bytes) -> list[list[bytes]]:
        return [] if silent and b"shutting_down" in frame else [[frame]]

    ending = threading.Thread(target=in_real_time.shut_down)
    with serving(in_real_time, Fault(reply=lose)) as uri:
        settings = SuiteSettings(
            uri=uri, move=True, shut_down=ending.start, patience=0.5, motion=1.5
        )
        (told,) = run(settings, only=["5.14"])
    ending.join()
    assert told.status is (CheckStatus.FAILED if silent else CheckStatus.PASSED), told.sentence
    assert told.sentence == ("The daemon ended without a word." if silent else "")
