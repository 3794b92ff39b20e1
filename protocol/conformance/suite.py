"""Runs the checks, and says which clauses hold."""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from enum import Enum
from importlib import resources
from types import MappingProxyType
from typing import Final

from protocol.conformance.bench import Bench, Settings
from protocol.conformance.expectations import Broken, Untried
from protocol.conformance.registry import CHECKS, Check, Need
from protocol.errors import RobotUnreachableError
from protocol.probe import probe

for _module in (
    "transport",
    "frames",
    "sessions",
    "ids",
    "control",
    "readings",
    "motion",
    "waiting",
):
    importlib.import_module(f"protocol.conformance.{_module}")  # each registers its checks

NOT_CHECKED: Final = MappingProxyType(
    {
        "1.3": "for clients",
        "1.4": "an allowance",
        "1.12": "a robot's address and its options cannot be seen from outside",
        "1.14": "for clients",
        "1.16": "needs the robot's list of keys",
        "1.17": "needs two keys",
        "1.18": "needs a robot that reads slowly",
        "3.1": "for clients",
        "3.9": "for clients",
        "4.1": "for clients",
        "4.11": "needs a robot that reads slowly",
        "4.13": "for clients",
        "5.14": "needs the robot to be shut down",
        "5.15": "needs a robot that reads slowly",
        "5.16": "needs a robot that reads slowly",
        "5.17": "needs a robot that acts slowly",
        "6.3": "needs to see the robot",
        "6.4": "needs a robot that acts slowly",
        "8.2": "for clients",
        "9.3": "needs to see the robot",
    }
)
"""Clauses that no check tries, and why."""

_TAG: Final = re.compile(r"\[(\d+\.\d+)\]")


class Verdict(Enum):
    """What became of a check."""

    HOLDS = "holds"
    BROKEN = "broken"
    UNTRIED = "not tried"


@dataclass(frozen=True, kw_only=True)
class Result:
    """A check and what became of it; ``sentence`` says why it is broken or was not tried."""

    check: Check
    verdict: Verdict
    sentence: str = ""


def clauses() -> list[str]:
    """The numbers of all clauses of ``SPEC.md``, in the order of the page."""
    text = resources.files("protocol").joinpath("SPEC.md").read_text("utf-8")
    return list(dict.fromkeys(_TAG.findall(text.partition("\n## 1.")[2])))


def ordered() -> list[Check]:
    """All checks, in the order of their clauses; the table of errors last, as it sees all."""
    place = {clause: index for index, clause in enumerate(clauses())}
    return sorted(CHECKS, key=lambda each: ("8.1" in each.clauses, place[each.clauses[0]]))


def run(
    settings: Settings,
    *,
    only: Collection[str] = (),
    on_result: Callable[[Result], None] = lambda result: None,
) -> list[Result]:
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
    chosen = [each for each in ordered() if not only or set(only) & set(each.clauses)]
    found = probe(settings.uri, settings.keys)
    if not found.fine:
        raise RobotUnreachableError(found.sentence)
    results = []
    with Bench(settings) as bench:
        for result in _run_all(bench, chosen):
            results.append(result)
            on_result(result)
    return results


def _run_all(bench: Bench, chosen: list[Check]) -> Iterator[Result]:
    gone = ""
    for each in chosen:
        reason = gone or _not_allowed(each, bench.settings)
        if reason:
            yield Result(check=each, verdict=Verdict.UNTRIED, sentence=reason)
            continue
        result = _run_one(each, bench)
        if result.verdict is Verdict.BROKEN and not _alive(bench):
            gone = f"The robot does not answer any more, since: {each.title}."
        yield result


def _run_one(each: Check, bench: Bench) -> Result:
    try:
        each.run(bench)
    except Broken as error:
        return Result(check=each, verdict=Verdict.BROKEN, sentence=str(error))
    except Untried as error:
        return Result(check=each, verdict=Verdict.UNTRIED, sentence=str(error))
    finally:
        bench.close_lines()
    return Result(check=each, verdict=Verdict.HOLDS)


def _alive(bench: Bench) -> bool:
    try:
        stranger = bench.stranger()
        stranger.line.send(stranger.request("hello", versions=[1]))
        return bool(stranger.line.socket.poll(math.ceil(bench.settings.patience * 1000)))
    except Broken:
        return False
    finally:
        bench.close_lines()


def _not_allowed(each: Check, settings: Settings) -> str:
    if each.need is Need.MOTION and not settings.move:
        return "This needs --move."
    if each.need is Need.TIME and not settings.slow:
        return "This needs --slow."
    if each.need is Need.KEYS and settings.keys is None:
        return "This needs a robot with keys, and --keys."
    return ""
