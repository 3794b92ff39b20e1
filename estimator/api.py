"""Runs from a program, and what they know of the body."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeVar

from estimator.errors import EstimatorError
from estimator.exploration.rules import RULES, Rule
from estimator.exploration.situation import Objective
from estimator.identification.listener import Listener
from estimator.identification.order import MethodName, Order
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.identification.paper.search import SEARCHES, Search
from estimator.identification.run import identify as identify_run
from estimator.identification.run import resume as resume_run
from estimator.physics.backends import BACKENDS, on_this_computer
from estimator.physics.base import Physics
from estimator.plugins import Registry
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.modalities import MODALITIES
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.store import RunStore

T = TypeVar("T")

_REGISTRIES: Final[Mapping[str, Registry[Any]]] = MappingProxyType(
    {"physics": BACKENDS, "search": SEARCHES, "objective": OBJECTIVES, "explore": RULES}
)


def identify(
    directory: Path | str,
    *,
    robot: str,
    problem: Path | str,
    method: MethodName = "posterior",
    physics: str | type[Physics] | None = None,
    search: str | type[Search] | None = None,
    objective: str | type[Objective] = "largest",
    explore: str | Rule | None = None,
    sure: float | None = None,
    modalities: Iterable[str] = tuple(MODALITIES),
    interactions: int | None = None,
    population: int | None = None,
    generations: int | None = None,
    full_steps: bool = False,
    seed: int | None = None,
    keys: Path | None = None,
    jobs: int = 1,
    listener: Listener | None = None,
) -> Result:
    """Identifies a robot: acts, senses and models, again and again.

    Args:
        directory: The run directory, which is made; its files are those of ``estimator identify``.
        robot: ``tcp://HOST:PORT``, ``file:READINGS.csv`` or ``replay:DIR``.
        problem: A problem's name, or a TOML file.
        method: ``posterior``, or ``paper``: one population, optimised.
        physics: A name in ``BACKENDS``, or a class of your own; default: the method's.
        search: A name in ``SEARCHES``, or a class, of the method ``paper``; default:
            ``deterministic-crowding``.
        objective: A name in ``OBJECTIVES``, or a class: what that search minimises; exploration
            rules are given it, too.
        explore: A name in ``RULES``, or a function; default: the method's.
        sure: Probability of the attachments, 0 to 1, at which a run of the method ``posterior``
            ends early, if the lengths are known to 5 mm by then.
        modalities: Sensors that count.
        interactions: How often the robot acts; default: the problem's, or all that was recorded.
        population: Models of the method ``paper``, an even number; default: the problem's.
        generations: Of that method, after each interaction; default: the problem's.
        full_steps: Whether to simulate on after a body has come to rest.
        seed: Source of all randomness; default: a new one, which the result names.
        keys: Key directory, where the robot asks for keys.
        jobs: Processor cores. With more than 1 there are worker processes, which import the calling
            program: keep what it starts under ``if __name__ == "__main__":``.
        listener: Hears what happens; default: nobody.

    Returns:
        What ``result.json`` holds.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    order = Order(
        robot=robot,
        problem=str(problem),
        seed=secrets.randbelow(2**32) if seed is None else seed,
        method=method,
        physics=None if physics is None else _name(BACKENDS, physics),
        search=None if search is None else _name(SEARCHES, search),
        objective=_name(OBJECTIVES, objective),
        explore=None if explore is None else _name(RULES, explore),
        sure=sure,
        modalities=tuple(modalities),
        interactions=interactions,
        population=population,
        generations=generations,
        full_steps=full_steps,
        keys=keys,
    )
    with on_this_computer(jobs) as executors:
        return identify_run(
            Path(directory), order, executors, listener or Listener(), report=write_report
        )


def load(directory: Path | str, *, physics: type[Physics] | None = None) -> FittedPosterior:
    """What a run knows of the robot's body, finished or not.

    Args:
        directory: The run directory.
        physics: The class of your own with which the run was started, if there was one.

    Returns:
        The posterior; of a run of the method ``paper`` its population.

    Raises:
        BodyschemaError: There is no run, it is damaged, or nothing was learnt yet.
    """
    _add_those_of(Path(directory), physics=physics)
    with RunStore.open(Path(directory), to_write=False) as store:
        fitted = FittedPosterior.of(store)
    if fitted is None:
        raise EstimatorError(
            f"{directory} has no model yet: go on with `estimator resume {directory}` first"
        )
    return fitted


def resume(
    directory: Path | str,
    *,
    robot: str | None = None,
    physics: type[Physics] | None = None,
    search: type[Search] | None = None,
    objective: type[Objective] | None = None,
    explore: Rule | None = None,
    keys: Path | None = None,
    jobs: int = 1,
    listener: Listener | None = None,
) -> Result:
    """Sees an interrupted run through, as if it had not been interrupted.

    Args:
        directory: The run directory.
        robot: Where the robot is now; default: where it was.
        physics: The class of your own with which the run was started, if there was one. The other
            three likewise.
        search: Such a class.
        objective: Such a class.
        explore: Such a function.
        keys: Key directory, where the robot asks for keys; a run does not remember it.
        jobs: As for ``identify``; the result does not depend on it.
        listener: Hears what happens; default: nobody.

    Returns:
        What ``result.json`` holds.

    Raises:
        BodyschemaError: Something prevents it; the message says what.
    """
    _add_those_of(
        Path(directory), physics=physics, search=search, objective=objective, explore=explore
    )
    with on_this_computer(jobs) as executors:
        return resume_run(
            Path(directory),
            executors,
            listener or Listener(),
            robot=robot,
            keys=keys,
            report=write_report,
        )


def _name(registry: Registry[T], part: T | str) -> str:
    """The name of a part, which is taken in if it is the calling program's."""
    return part if isinstance(part, str) else registry.add(part)


def _add_those_of(directory: Path, **parts: object) -> None:
    """Takes in the calling program's parts of a run, which must be those that it had before."""
    with RunStore.open(directory, to_write=False) as store:
        settings = store.settings
    for kind, part in parts.items():
        was = getattr(settings, kind)
        if part is not None and (given := _REGISTRIES[kind].add(part)) != was:
            raise EstimatorError(
                f"the run was started with the {_REGISTRIES[kind].kind} {was!r}, not {given!r}: "
                "leave that out, or start a new run"
            )
