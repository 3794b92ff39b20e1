"""Starts runs, continues them, and connects them to robot and physics."""

from __future__ import annotations

import secrets
import uuid
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final, TypeAlias, TypeVar

from pydantic import ValidationError

from estimator.errors import EstimatorError, InteractionError, RunDirectoryError
from estimator.exploration.rules import RULES
from estimator.identification.loop import go_through
from estimator.identification.method import Listener, Method
from estimator.identification.next_program import next_program
from estimator.identification.paper.method import PaperMethod
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.identification.paper.search import SEARCHES
from estimator.identification.posterior_method import PosteriorMethod
from estimator.identification.record_link import is_record
from estimator.identification.robot_link import RobotLink, lasting_properties, open_robot
from estimator.parameters.rows import packages
from estimator.physics.backends import BACKENDS, REFERENCE
from estimator.plugins import packages_named_when_failing
from estimator.problem.problem import Problem
from estimator.problem.values import complaint
from estimator.readings.modalities import MODALITIES, check_modalities
from estimator.storage.records import first_id
from estimator.storage.run_config import MethodName, RunConfig, RunSettings
from estimator.storage.store import RunStore
from estimator.workplaces import Executors
from protocol.wire.capabilities import Capabilities

Summary = TypeVar("Summary")
METHODS: Final[Mapping[MethodName, type[Method]]] = MappingProxyType(
    {"posterior": PosteriorMethod, "paper": PaperMethod}
)
"""The methods by name, the default first."""

Report: TypeAlias = Callable[[RunStore], Summary]
"""Writes a run's files beside its database, and returns a summary of the run."""


@packages_named_when_failing()
def identify(
    directory: Path,
    config: RunConfig,
    executors: Executors,
    listener: Listener,
    *,
    keys: Path | None = None,
    report: Report[Summary],
) -> Summary:
    """Starts a run and continues it to its end.

    Nothing is left behind when the robot cannot be reached or does not fit the problem.

    Args:
        directory: Directory of the run, which is made.
        config: What is asked of the run.
        executors: Executors that do the work.
        listener: Hears what happens.
        keys: Key directory, where the robot asks for keys.
        report: Called after each iteration and at the end, for what is returned.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    stated = Problem.load(config.problem)
    named = None if config.modalities is None else check_modalities(config.modalities)
    METHODS[config.method].check(config)
    _check_names(config)
    client_id = str(uuid.uuid4())
    link = open_robot(
        config.robot,
        driven=_driven(stated),
        client_id=client_id,
        first_id=first_id(0),
        keys=keys,
    )
    with closing(link):
        problem = stated.for_robot(link.capabilities)
        modalities = named or tuple(
            name for name in MODALITIES if link.capabilities.sensor(name) is not None
        )
        for sentence in problem.check_robot(link.capabilities, modalities):
            listener.say(f"Note: {sentence}.")
        settings = _settings(config, problem, modalities, link)
        with RunStore.create(directory, settings, link.capabilities, client_id) as store:
            return _work(store, executors, lambda: link, listener, report=report)


@packages_named_when_failing()
def resume(
    directory: Path,
    executors: Executors,
    listener: Listener,
    *,
    robot: str | None = None,
    keys: Path | None = None,
    report: Report[Summary],
) -> Summary:
    """Continues an interrupted run to its end, as if it had not been interrupted.

    Args:
        directory: The run directory.
        executors: Executors that do the work.
        listener: Hears what happens.
        robot: Where the robot is now; default: where it was.
        keys: Key directory, where the robot asks for keys; a run does not remember it.
        report: Called after each iteration and at the end, for what is returned.

    Raises:
        BodyschemaError: Something prevents that; the message says what.
    """
    with RunStore.open(directory) as store:
        _compare_packages(store, listener)
        uri = robot or store.settings.robot
        connect = partial(reconnect, store, uri, listener, keys=keys)
        return _work(store, executors, connect, listener, report=report)


def reconnect(
    store: RunStore,
    uri: str,
    listener: Listener,
    *,
    keys: Path | None = None,
    outside_run: bool = False,
) -> RobotLink:
    """Connects to the robot of a run that exists already.

    Args:
        store: The run.
        uri: Where the robot is now.
        listener: Hears if the robot's configuration has changed.
        keys: Key directory, where the robot asks for keys.
        outside_run: Whether to connect as a new client, so that what is done belongs to no run.

    Raises:
        InteractionError: Another robot answers there, or a record has changed.
        RunDirectoryError: There is no such record.
        BodyschemaError: The robot cannot be reached.
    """
    was = store.capabilities
    kind, _, place = uri.partition(":")
    if is_record(uri) and not Path(place).exists():
        raise RunDirectoryError(
            f"{place}, where the readings of {store.directory} come from, is not there: add "
            f"--robot {kind}: and the place where it lies now."
        )
    link = open_robot(
        uri,
        driven=_driven(store.problem),
        client_id=str(uuid.uuid4()) if outside_run else store.client_id,
        first_id=first_id(0) if outside_run else store.new_connection(),
        keys=keys,
    )
    now = link.capabilities
    if lasting_properties(was) != lasting_properties(now):
        link.close()
        raise InteractionError(
            f"The robot at {uri} ({now.robot}) has other joints, sensors or another main body "
            f"than the one of this run ({was.robot}): start a new run with it."
        )
    if was.config_hash != now.config_hash:
        listener.say("Note: the robot's configuration has changed since the run was started.")
    if is_record(uri) and kind == store.settings.robot.partition(":")[0]:
        _check_unchanged(uri, store, link)
    return link


def _check_unchanged(uri: str, store: RunStore, record: RobotLink) -> None:
    """Refuses a record that no longer says what the run has read there."""
    for number, item in enumerate(store.interactions()):
        if item.observation is not None and item.observation != record.perform(
            number, item.program, None, lambda phase, fraction: None
        ):
            raise InteractionError(
                f"{uri}, interaction {number + 1}: is no longer what this run has read there: "
                "start a new run with the record as it is now."
            )


def _driven(problem: Problem) -> Callable[[Capabilities], Collection[int]]:
    return lambda capabilities: problem.for_robot(capabilities).motors.driven


def _packages(physics: str, search: str, objective: str, explore: str) -> dict[str, str]:
    """Version by name of the packages from outside that decide a run's outcome too."""
    return {
        **BACKENDS.package(physics),
        **SEARCHES.package(search),
        **OBJECTIVES.package(objective),
        **RULES.package(explore),
        **packages(),
    }


def _compare_packages(store: RunStore, listener: Listener) -> None:
    settings = store.settings
    current = _packages(settings.physics, settings.search, settings.objective, settings.explore)
    if current != settings.plugins:
        listener.say(
            f"Note: the run was started with {_in_words(settings.plugins)}, and goes on with "
            f"{_in_words(current)}."
        )


def _in_words(packages: Mapping[str, str]) -> str:
    return ", ".join(map(" ".join, packages.items())) or "no plug-in"


def _check_names(config: RunConfig) -> None:
    """Refuses names that no implementation has, before the robot is asked for anything."""
    if config.explore is not None:
        RULES.check(config.explore)
    if config.search is not None:
        SEARCHES.check(config.search)
    if config.objective is not None:
        OBJECTIVES.check(config.objective)


def _settings(
    config: RunConfig, problem: Problem, modalities: tuple[str, ...], link: RobotLink
) -> RunSettings:
    """Settings of a run, in which what its config left open is decided."""
    recorded, interactions = link.recorded, config.interactions
    if interactions is None:
        interactions = problem.search.interactions if recorded is None else len(recorded)
    elif recorded is not None and interactions > len(recorded):
        raise EstimatorError(
            f"{config.robot} holds {len(recorded)} interactions, not {interactions}: ask for fewer"
        )
    method = METHODS[config.method]
    decided = {
        "physics": method.PHYSICS,
        "explore": method.RULE,
        "search": next(iter(SEARCHES.own)),
        "objective": next(iter(OBJECTIVES.own)),
        "seed": secrets.randbelow(2**32),
        "population": problem.search.population,
        "generations": problem.search.generations,
        **config.model_dump(exclude_none=True),
        "interactions": interactions,
        "modalities": modalities,
    }
    parts = {name: str(decided[name]) for name in ("physics", "search", "objective", "explore")}
    try:
        return RunSettings(
            **decided,
            problem_text=problem.source,
            reference=REFERENCE,
            plugins=_packages(**parts),
        )
    except ValidationError as error:
        raise EstimatorError(complaint(error, "such a run cannot be")) from error


def _work(
    store: RunStore,
    executors: Executors,
    connect: Callable[[], RobotLink],
    listener: Listener,
    *,
    report: Report[Summary],
) -> Summary:
    with ExitStack() as stack:
        method = METHODS[store.settings.method](store, executors, listener, stack)
        rule, jobs = store.settings.explore, executors.threads
        go_through(
            store,
            method,
            choose=lambda: next_program(
                store, rule, method.posterior(), physics=method.choosing, jobs=jobs
            ),
            connect=connect,
            listener=listener,
            after_iteration=lambda: report(store),
        )
    return report(store)
