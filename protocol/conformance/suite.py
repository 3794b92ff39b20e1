"""Runs the checks and reports which clauses hold."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from importlib import resources
from types import MappingProxyType
from typing import Final

from protocol.conformance.raw_connection import Failed, Skipped, SuiteSettings
from protocol.conformance.registry import CHECKS, Check, Need
from protocol.conformance.robot_under_test import RobotUnderTest
from protocol.errors import RobotUnreachableError
from protocol.transport.connection_probe import probe

for _module in (
    "basics",
    "connections",
    "frames",
    "sessions",
    "control",
    "readings",
    "motion",
):
    importlib.import_module(f"protocol.conformance.checks.{_module}")  # each registers its checks

NOT_CHECKED: Final = MappingProxyType(
    {
        "1.3": "for clients",
        "1.4": "an allowance",
        "1.12": "a robot's address and its options cannot be seen from outside",
        "1.14": "for clients",
        "1.16": "needs the robot's list of keys",
        "3.1": "for clients",
        "3.9": "for clients",
        "4.1": "for clients",
        "4.13": "for clients",
        "5.17": "needs a robot that acts slowly",
        "5.18": "needs a robot whose control loop hangs",
        "6.3": "needs to see the robot",
        "6.4": "needs a robot that acts slowly",
        "8.2": "for clients",
        "9.3": "needs to see the robot",
    }
)
"""Clauses that no check tries, and why."""

_LAST: Final = ("7.5", "8.1", "5.14")  # they look back at all answers; the last ends the daemon
_BUILT_ON: Final = MappingProxyType(
    {
        Need.CONTROL: {Need.CONTROL},
        Need.MOTION: {Need.CONTROL, Need.MOTION},
        Need.TIME: {Need.CONTROL},
    }
)
"""Needs of the basic checks that come before a check, by the check's own need."""

_TAG: Final = re.compile(r"\[(\d+\.\d+)\]")


class CheckStatus(Enum):
    """Whether the clauses of a check hold."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """The result of a check; ``sentence`` says why a check failed or was skipped."""

    check: Check
    status: CheckStatus
    sentence: str = ""


def clauses() -> list[str]:
    """The numbers of all clauses of ``SPEC.md``, in the order of the page."""
    text = resources.files("protocol").joinpath("SPEC.md").read_text("utf-8")
    return list(dict.fromkeys(_TAG.findall(text.partition("\n## 1.")[2])))


def ordered() -> list[Check]:
    """All checks: the basic ones, then in the order of their clauses, each after what it needs."""
    place = {clause: index for index, clause in enumerate(clauses())}
    in_order: dict[Check, None] = {}

    def add(each: Check) -> None:
        for needed in CHECKS:
            if needed is not each and needed.clauses[0] in each.after:
                add(needed)
        in_order.setdefault(each)

    def rank(each: Check) -> tuple[int, int]:
        first_clause = each.clauses[0]
        if each.basic is not None:
            return 0, 0
        return (2, _LAST.index(first_clause)) if first_clause in _LAST else (1, place[first_clause])

    for each in sorted(CHECKS, key=rank):
        add(each)
    return list(in_order)


def run(
    settings: SuiteSettings,
    *,
    only: Collection[str] = (),
    on_result: Callable[[CheckResult], None] = lambda result: None,
) -> list[CheckResult]:
    """Runs every check that is allowed.

    Args:
        settings: Where the robot is, and what the suite may do.
        only: Numbers of clauses; the checks of others are left out. Empty: all of them.
        on_result: Called after each check.

    Raises:
        ValueError: ``only`` names what is no clause.
        RobotUnreachableError: No connection comes about; it says why.
    """
    if unknown := set(only) - set(clauses()):
        raise ValueError(f"no clauses of SPEC.md: {', '.join(sorted(unknown))}")
    diagnosis = probe(settings.uri, settings.keys)
    if not diagnosis.fine:
        raise RobotUnreachableError(diagnosis.sentence)
    results = []
    with RobotUnderTest(settings) as robot:
        for result in _Suite(robot, only).results():
            results.append(result)
            on_result(result)
    return results


class _Suite:
    """One run of the suite.

    Args:
        robot: The robot under test.
        only: The clauses to try; empty: all of them.
    """

    def __init__(self, robot: RobotUnderTest, only: Collection[str]):
        self._robot = robot
        self._only = set(only)
        self._failed: set[str] = set()  # clauses that do not hold

    def results(self) -> Iterator[CheckResult]:
        """Runs the checks one after the other, and yields their results."""
        wanted_checks = [check for check in ordered() if self._is_wanted(check)]
        needed = {Need.NOTHING}.union(*(_BUILT_ON.get(check.need, ()) for check in wanted_checks))
        for check in ordered():
            if check in wanted_checks:
                yield from self._results_of(check)
            elif check.basic is not None and check.need in needed:
                for result in self._results_of(check):  # what is wanted builds on it
                    if result.status is CheckStatus.FAILED:
                        yield result

    def _is_wanted(self, each: Check) -> bool:
        return not self._only or not self._only.isdisjoint(each.clauses)

    def _results_of(self, each: Check) -> Iterator[CheckResult]:
        reason = _not_allowed(each, self._robot.settings) or self._lacks(each)
        if reason:
            yield CheckResult(check=each, status=CheckStatus.SKIPPED, sentence=reason)
            return
        try:
            each.run(self._robot)
        except Skipped as error:
            yield CheckResult(check=each, status=CheckStatus.SKIPPED, sentence=str(error))
        except Failed as error:
            self._robot.close_connections()
            yield from self._blame(each, error)
        else:
            yield CheckResult(check=each, status=CheckStatus.PASSED)
        finally:
            self._robot.close_connections()

    def _lacks(self, each: Check) -> str:
        if reason := self._robot.dead.get("hello"):
            return reason
        failed_clauses = [clause for clause in each.after if clause in self._failed]
        return f"Because {', '.join(failed_clauses)} failed." if failed_clauses else ""

    def _blame(self, each: Check, error: Failed) -> Iterator[CheckResult]:
        """Reports a failure under the clause that does not hold: the check's own or another."""
        # Where answers come twice, each may have been taken for the answer to what came next.
        clause = error.clause or ("7.5" if self._robot.noted["7.5"] else each.clauses[0])
        reason = f"Because {clause} failed."
        if clause in each.clauses:
            yield CheckResult(check=each, status=CheckStatus.FAILED, sentence=str(error))
        else:
            if clause not in self._failed:
                blamed = replace(each, clauses=(clause,), title=f"Seen while trying: {each.title}")
                yield CheckResult(check=blamed, status=CheckStatus.FAILED, sentence=str(error))
            yield CheckResult(check=each, status=CheckStatus.SKIPPED, sentence=reason)
        if each.basic is not None:
            self._robot.dead[each.basic] = reason
        elif clause not in self._failed:
            self._look_again(each)
        self._failed.add(clause)

    def _look_again(self, since: Check) -> None:
        """Finds out, after a failure, which basic requests the robot still answers."""
        robot = self._robot
        robot.use_new_names()
        for check in CHECKS:
            if check.basic is None or check.need is not Need.NOTHING or check.basic in robot.dead:
                continue
            try:
                check.run(robot)
            except Skipped:
                pass
            except Failed:
                subject = "The robot" if check.basic == "hello" else f"A {check.basic}"
                verb = "does not answer" if check.basic == "hello" else "is not answered"
                robot.dead[check.basic] = f"{subject} {verb} any more, since: {since.title}."
            finally:
                robot.close_connections()


def _not_allowed(each: Check, settings: SuiteSettings) -> str:
    if each.need is Need.MOTION and not settings.move:
        return "This needs --move."
    if each.need is Need.TIME and not settings.slow:
        return "This needs --slow."
    if each.need is Need.KEYS and settings.keys is None:
        return "This needs a robot with keys, and --keys."
    return ""
