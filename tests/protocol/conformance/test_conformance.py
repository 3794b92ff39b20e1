"""The conformance suite: our own robots pass, and each broken rule is found."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest

from bench.daemons import simulator
from protocol.conformance.__main__ import main
from protocol.conformance.raw_connection import SuiteSettings
from protocol.conformance.registry import CHECKS
from protocol.conformance.suite import NOT_CHECKED, CheckStatus, clauses, run
from robot.control.controller import Controller
from tests.protocol.conformance.spoilt import Fault, replies
from tests.protocol.conformance.trials import failures, serving, skipped
from tests.protocol.transport.faults import FAULTS

if TYPE_CHECKING:
    pass


# --- robots of ours -------------------------------------------------------------------------------


def test_our_daemon_holds_every_clause(calm: Controller) -> None:
    with serving(calm) as uri:
        results = run(SuiteSettings(uri=uri, move=True, far=True))
    assert failures(results) == []
    assert skipped(results) == {
        "This needs --slow.",
        "This needs a robot with keys, and --keys.",
        "This needs --shutdown.",
    }
    assert len(results) == len(CHECKS)


def test_without_move_it_never_moves(calm: Controller) -> None:
    seen = []

    class Watched:
        """The robot, and what reaches it."""

        def __getattr__(self, name: str) -> Any:
            return getattr(calm, name)

        def submit(self, ticket: int, request: Any) -> None:
            seen.append(request.TYPE)
            calm.submit(ticket, request)

    with serving(Watched()) as uri:
        results = run(SuiteSettings(uri=uri))
    assert failures(results) == []
    assert set(seen) == {"read", "stop", "clear"}


def test_the_simulated_robot_as_a_user_runs_it() -> None:
    with simulator("--electronics", "feetech") as robot:
        done = subprocess.run(
            [sys.executable, "-m", "protocol.conformance", robot.uri, "--move"],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert " 0 failed" in done.stdout


# --- robots of strangers --------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAULTS)
def test_a_robot_that(name: str, calm: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    clause, fault = FAULTS[name]
    fault.patch(monkeypatch)
    with serving(calm, fault) as uri:
        move = fault.move
        settings = SuiteSettings(uri=uri, move=move, far=move, patience=0.5, motion=10.0)
        results = run(settings, only=[clause])
    assert failures(results)


@pytest.mark.parametrize(
    "name",
    [
        "leaves the id out of errors",
        "leaves a field out",
        "counts the ids of answers",
    ],
)
def test_one_fault_is_one_broken_clause_and_soon_told(
    name: str, calm: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    clause, fault = FAULTS[name]
    fault.patch(monkeypatch)
    begun = time.monotonic()
    with serving(calm, fault) as uri:
        results = run(SuiteSettings(uri=uri, patience=2.0))
    assert {each.check.clauses[0] for each in results if each.status is CheckStatus.FAILED} == {
        clause
    }
    assert f"Because {clause} failed." in skipped(results)
    assert time.monotonic() - begun < 60


def test_each_clause_that_is_checked_without_time_or_keys_has_a_fault() -> None:
    tried = {each.clauses[0] for each in CHECKS if each.need.value not in ("time", "keys")}
    elsewhere = {"5.14", "5.16"}  # below
    assert tried - {clause for clause, _ in FAULTS.values()} - elsewhere == {
        "4.5",
        "5.8",
        "5.13",
        "6.2",
    }


def test_answers_that_come_twice_are_no_other_fault(calm: Controller) -> None:
    with serving(calm, FAULTS["answers twice"][1]) as uri:
        results = run(SuiteSettings(uri=uri, patience=0.5), only=["3.3", "4.4", "4.6", "7.5"])
    assert {each.check.clauses[0] for each in results if each.status is CheckStatus.FAILED} == {
        "7.5"
    }


def test_a_robot_that_hangs_is_given_up(calm: Controller) -> None:
    gone: list[bool] = []

    def lose(parts: list[bytes]) -> list[bytes] | None:
        if b"dance" in parts[-1]:
            gone.append(True)
        return None if gone else parts

    with serving(calm, Fault(request=lose)) as uri:
        begun = time.monotonic()
        results = run(SuiteSettings(uri=uri, patience=0.2))
        assert time.monotonic() - begun < 60
    assert 1 <= len(failures(results)) <= 3
    assert any("does not answer any more, since" in sentence for sentence in skipped(results))


def test_a_robot_in_use_is_left_alone(calm: Controller) -> None:
    from protocol.transport.client import RobotClient

    with serving(calm) as uri, RobotClient(uri, software="estimator") as owner:
        owner.acquire()
        results = run(SuiteSettings(uri=uri, move=True), only=["5.4", "5.9", "5.11", "7.4", "6.1"])
        assert {result.status for result in results} == {CheckStatus.SKIPPED}
        assert skipped(results) == {f"The robot is held by {owner.client_id}."}
        assert owner.status().state in ("idle", "holding")
        owner.stop()
        owner.release()
        results = run(SuiteSettings(uri=uri, move=True), only=["5.4", "5.11"])
        assert skipped(results) == {"The robot is stopped, and was left so."}
        owner.acquire()
        owner.clear()


@pytest.mark.parametrize("says_angles", [False, True])
def test_a_limp_robot_has_no_angles(calm: Controller, *, says_angles: bool) -> None:
    from protocol.transport.client import RobotClient

    angles = dict.fromkeys(calm.snapshot().angles, 0.0)
    with_angles = replies("observation", lambda f: f | {"angles": angles})
    with (
        serving(calm, with_angles if says_angles else None) as uri,
        RobotClient(uri, software="estimator") as owner,
    ):
        owner.acquire()
        owner.relax()
        owner.release()
        results = run(SuiteSettings(uri=uri), only=["7.7"] if says_angles else ())
        owner.acquire()
        owner.hold()
    assert len(failures(results)) == says_angles


# --- the page and the suite -----------------------------------------------------------------------


def test_every_clause_is_tried_or_named_with_a_reason() -> None:
    tried = {clause for each in CHECKS for clause in each.clauses}
    assert tried | NOT_CHECKED.keys() == set(clauses())
    assert not tried & NOT_CHECKED.keys()


def test_clauses_are_numbered_in_the_order_of_the_page() -> None:
    numbers = [tuple(map(int, clause.split("."))) for clause in clauses()]
    assert numbers == sorted(numbers)
    for section in {section for section, _ in numbers}:
        in_section = [number for place, number in numbers if place == section]
        assert in_section == list(range(1, len(in_section) + 1))


def test_the_command(calm: Controller, capsys: pytest.CaptureFixture[str]) -> None:
    with serving(calm) as uri:
        assert main([uri, "--only", "2.5,2.6"]) == 0
        out = capsys.readouterr().out
        assert "2.5         passed" in out
        assert "2 checks passed, 0 failed, 0 were skipped" in out
        assert main([uri, "--only", "99.1"]) == 1
        assert "no clauses of SPEC.md: 99.1" in capsys.readouterr().err
    with serving(calm, FAULTS["takes any version"][1]) as uri:
        assert main([uri, "--only", "3.3"]) == 1
        out = capsys.readouterr().out
        assert "3.3         failed     Versions that are not spoken are unsupported_version" in out
        assert "hello was answered with welcome instead of unsupported_version" in out


def test_verbose_shows_each_frame_in_hex_and_what_it_says(
    calm: Controller, capsys: pytest.CaptureFixture[str]
) -> None:
    with serving(calm) as uri:
        assert main([uri, "--only", "1.2", "--verbose"]) == 0
    lines = capsys.readouterr().out.splitlines()
    sent = next(n for n, line in enumerate(lines) if line.startswith("connection 1 sent: "))
    assert lines[sent].endswith(" bytes " + re.findall(r"[0-9a-f]+$", lines[sent])[0])
    assert bytes.fromhex(lines[sent].rpartition(" ")[2])[1:6] == b"\xa4type"
    assert lines[sent + 1].startswith('    {"type": "hello", "id": 4503599627370496, "client": ')
    assert any("received: " in line for line in lines)
    assert any('"type": "welcome"' in line for line in lines)
    assert any("sent part 1 of 2: 0 bytes " in line for line in lines)
    assert any(line.startswith("    no frame: ") for line in lines)


def test_nobody_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tcp://127.0.0.1:1"]) == 1
    assert "Nothing listens at tcp://127.0.0.1:1" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["nosuchcommand now", " "])
def test_a_command_that_is_not_there_is_told_before_anything_is_tried(
    command: str, calm: Controller, capsys: pytest.CaptureFixture[str]
) -> None:
    with serving(calm) as uri:
        assert main([uri, "--only", "5.14", "--shutdown", command]) == 1
    seen = capsys.readouterr()
    assert f"--shutdown: {command!r} begins with no command" in seen.err
    assert not seen.out
