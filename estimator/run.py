"""Starts runs, continues them, and connects them to robot and physics."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from estimator.error import check_modalities
from estimator.errors import EstimatorError, InteractionError
from estimator.listener import Listener
from estimator.loop import Identification
from estimator.physics.base import Physics
from estimator.physics.base import Settings as PhysicsSettings
from estimator.physics.pool import MakePhysics, PhysicsPool
from estimator.physics.pybullet import PyBulletPhysics
from estimator.problem import Problem
from estimator.records import RunSettings
from estimator.report.files import write_report
from estimator.report.result import Result
from estimator.robot_link import open_robot
from estimator.robot_link.base import RobotLink
from estimator.store import RunStore, first_id
from protocol.capabilities import Capabilities

OpenPhysics = Callable[[str, PhysicsSettings], Physics]
"""Makes the back-end of a given name for a given world."""

_BACKENDS: Final[dict[str, Callable[[PhysicsSettings], MakePhysics]]] = {
    "pybullet": lambda settings: partial(PyBulletPhysics, settings),
}
BACKENDS: Final = tuple(_BACKENDS)


@dataclass(frozen=True, kw_only=True)
class Order:
    """What a person asks of a new run; ``None`` leaves the choice to the problem or the record."""

    robot: str
    problem: str
    seed: int
    physics: str = "pybullet"
    modalities: tuple[str, ...] = ("touch", "tilt", "clearance")
    interactions: int | None = None
    population: int | None = None
    generations: int | None = None


def in_processes(jobs: int) -> OpenPhysics:
    """Back-ends in ``jobs`` worker processes."""

    def opened(name: str, settings: PhysicsSettings) -> Physics:
        if name not in _BACKENDS:
            raise EstimatorError(f"there is no physics {name!r}: choose {', '.join(BACKENDS)}")
        return PhysicsPool(_BACKENDS[name](settings), jobs)

    return opened


def identify(
    directory: Path, order: Order, open_physics: OpenPhysics, listener: Listener
) -> Result:
    """Starts a run and sees it through.

    Nothing is left behind when the robot cannot be reached or does not fit the problem.

    Raises:
        BodyschemaError: Something prevents the run; the message says what.
    """
    problem = Problem.load(order.problem)
    modalities = check_modalities(order.modalities)
    client_id = str(uuid.uuid4())
    driven = problem.motors.driven
    link = open_robot(order.robot, driven=driven, client_id=client_id, first_id=first_id(0))
    with closing(link):
        for sentence in problem.check_robot(link.capabilities, modalities):
            listener.say(f"Note: {sentence}.")
        settings = _settings(order, problem, modalities, link)
        with RunStore.create(directory, settings, link.capabilities, client_id) as store:
            return _work(store, problem, open_physics, lambda: link, listener)


def resume(
    directory: Path, open_physics: OpenPhysics, listener: Listener, *, robot: str | None = None
) -> Result:
    """Sees an interrupted run through, as if it had not been interrupted.

    Args:
        directory: The run.
        open_physics: Makes the back-end.
        listener: Hears what happens.
        robot: Where the robot is now; default: where it was.

    Raises:
        BodyschemaError: Something prevents it; the message says what.
    """
    with RunStore.open(directory) as store:
        problem = problem_of(store)
        connect = partial(reconnect, store, problem, robot or store.settings.robot, listener)
        return _work(store, problem, open_physics, connect, listener)


def problem_of(store: RunStore) -> Problem:
    """The problem that a run was started with."""
    return Problem.parse(store.settings.problem_text, f"problem of {store.directory}")


def reconnect(store: RunStore, problem: Problem, uri: str, listener: Listener) -> RobotLink:
    """The robot of a run that exists already.

    Raises:
        InteractionError: Another robot answers there.
        BodyschemaError: The robot cannot be reached.
    """
    link = open_robot(
        uri,
        driven=problem.motors.driven,
        client_id=store.client_id,
        first_id=store.new_connection(),
    )
    was, now = store.capabilities, link.capabilities
    if _body(was) != _body(now):
        link.close()
        raise InteractionError(
            f"The robot at {uri} ({now.robot}) has other joints, sensors or another main body "
            f"than the one of this run ({was.robot}): start a new run with it."
        )
    if was.config_hash != now.config_hash:
        listener.say("Note: the robot's configuration has changed since the run was started.")
    return link


def _body(capabilities: Capabilities) -> tuple[object, ...]:
    """What must not change during a run; noise, software and network addresses may."""
    return (
        [joint.name for joint in capabilities.joints],
        [(sensor.modality, sensor.count, sensor.upper) for sensor in capabilities.sensors],
        capabilities.base_size,
        capabilities.base_mass,
    )


def _settings(
    order: Order, problem: Problem, modalities: tuple[str, ...], link: RobotLink
) -> RunSettings:
    recorded = link.recorded
    interactions = order.interactions
    if interactions is None:
        interactions = problem.search.interactions if recorded is None else len(recorded)
    elif recorded is not None and interactions > len(recorded):
        raise EstimatorError(
            f"{order.robot} holds {len(recorded)} interactions, not {interactions}: ask for fewer"
        )
    try:
        return RunSettings(
            robot=order.robot,
            problem=order.problem,
            problem_text=problem.source,
            physics=order.physics,
            modalities=modalities,
            seed=order.seed,
            interactions=interactions,
            population=order.population or problem.search.population,
            generations=order.generations or problem.search.generations,
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise EstimatorError(f"{first['loc'][0]}: {first['msg']}, not {first['input']}") from error


def _work(
    store: RunStore,
    problem: Problem,
    open_physics: OpenPhysics,
    connect: Callable[[], RobotLink],
    listener: Listener,
) -> Result:
    physics = open_physics(store.settings.physics, problem.settings(store.capabilities))
    with closing(physics):
        identification = Identification(store, problem, physics, connect, listener)
        identification.run(after_iteration=lambda: write_report(store, problem))
    return write_report(store, problem)
