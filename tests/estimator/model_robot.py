"""A robot whose body is a model: it answers over a real wire, and its lengths are known."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from estimator.body.morphology import Array, Morphology
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.posterior import Posterior
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import in_motor_order
from estimator.report.run_files import write_report
from estimator.storage.run_config import RunConfig
from protocol.errors import RobotError
from protocol.rules.robot_interface import Finished, RobotEvent, Snapshot
from protocol.transport.server import Server
from protocol.wire.capabilities import Capabilities, Joint, Sensor
from protocol.wire.messages import ErrorReply, ObservationReply, Ok, Perform, RobotRequest, State

JOINTS = ("left", "front", "right", "back")
TRUE_LENGTHS = (0.17, 0.15, 0.18, 0.16)
without_plots: Final = partial(write_report, plots=False)
"""What a run writes beside its plots and its page, which take longer than a small run itself."""

PROBLEM = """
name = "legs"
description = "Four legs of one part each."
density = 1000.0
motors = { driven = [1, 2, 3, 4], range_deg = [-30.0, 30.0], slew_deg_per_s = 60.0 }
search = { population = 8, generations = 2, interactions = 2 }
""" + "".join(
    f"""
[[parts]]
name = "{name}"
parent = 0
mount = "{name}"
hinge = "up"
length = [0.05, 0.25]
radius = 0.006
motor = {number}
sensor = {number}
"""
    for number, name in enumerate(JOINTS, 1)
)


def make_capabilities(reach: float = 0.2) -> Capabilities:
    """The robot, whose distance sensor ends at ``reach``, m."""
    return Capabilities(
        robot="model",
        software="test",
        config_hash="0",
        base_size=(0.14, 0.14, 0.03),
        base_mass=0.3,
        part_radii=(0.006,) * 4,
        joints=tuple(
            Joint(name=name, lower=-1.0, upper=1.0, speed=1.0472, resolution=0.01)
            for name in JOINTS
        ),
        sensors=(
            Sensor(modality="touch", unit="bool", count=4, noise=0.0, rate=100.0),
            Sensor(modality="tilt", unit="rad", count=2, noise=0.0, rate=100.0),
            Sensor(modality="clearance", unit="m", count=1, noise=0.0, rate=20.0, upper=reach),
        ),
        telemetry="unset",
        telemetry_rate=1.0,
    )


def make_problem() -> Problem:
    return Problem.parse(PROBLEM, "test")


def true_body(problem: Problem, capabilities: Capabilities) -> Morphology:
    genes = (np.array(TRUE_LENGTHS) - 0.05) / 0.2
    return Genome(problem, problem.base(capabilities)).decode(genes)


def make_posterior(
    problem: Problem,
    capabilities: Capabilities,
    samples: Array,
    *,
    modalities: tuple[str, ...] = tuple(MODALITIES),
    best: Array | None = None,
) -> FittedPosterior:
    """Some genomes as a posterior, all as probable as each other."""
    physics = StaticsPhysics(problem.settings(capabilities))
    return FittedPosterior(
        problem=problem,
        capabilities=capabilities,
        modalities=modalities,
        observations=(),
        posterior=Posterior.equally_likely(samples),
        open_physics=lambda: physics,
        best=best,
    )


def make_order(folder: Path, robot: str, seed: int = 3) -> RunConfig:
    path = folder / "legs.toml"
    path.write_text(PROBLEM)
    return RunConfig(robot=robot, problem=str(path), seed=seed, method="paper")


def changed(config: RunConfig, **changes: object) -> RunConfig:
    """The config with other values, checked like those of a new one."""
    return RunConfig(**{**vars(config), **changes})


class ModelRobot:
    """Feels what its model feels, at once or, when manual, when told to.

    ``refusals`` are errors with which the next motions end; ``motions`` are all that were begun.
    With a ``travel`` other than 1 its servos turn so many times as far as they are told, its
    accelerometer is turned by ``askew`` (rad) left/right, and has ``noise`` (rad) that it does not
    announce. Its distance sensor ends at ``reach``, m.
    """

    def __init__(
        self,
        *,
        manual: bool = False,
        travel: float = 1.0,
        askew: float = 0.0,
        noise: float = 0.0,
        reach: float = 0.2,
    ):
        self.capabilities = make_capabilities(reach)
        self.manual = manual
        self.motions: list[Perform] = []
        self.begun = threading.Semaphore(0)
        self.refusals: list[RobotError] = []
        self._body = true_body(make_problem(), self.capabilities)
        self._travel = travel
        self._askew = np.array([askew, 0.0])
        self._noise = noise
        self._rng = np.random.default_rng(9)
        self._sequence = 0
        self._under_way: list[tuple[int, Perform]] = []
        self._events: list[RobotEvent] = []
        self._lock = threading.Lock()
        self._notify: Callable[[], None] = lambda: None

    def submit(self, ticket: int, request: RobotRequest) -> None:
        if not isinstance(request, Perform):
            self._emit(Finished(ticket=ticket, reply=Ok(id=request.id, state="holding")))
            return
        self.motions.append(request)
        self._under_way.append((ticket, request))
        if not self.manual:
            self.complete()
        self.begun.release()

    def silence(self, reason: str) -> None:
        """Goes on: how a motion ends in silence is the daemon's own affair."""

    def controller_changed(self, client: str | None) -> None:
        """Does not care."""

    def snapshot(self) -> Snapshot:
        state = State.MOVING if self._under_way else State.HOLDING
        return Snapshot(state=state, robot_time=0.0, sequence=self._sequence, angles={})

    def events(self) -> list[RobotEvent]:
        with self._lock:
            events, self._events = self._events, []
        return events

    def set_notify(self, notify: Callable[[], None]) -> None:
        self._notify = notify

    def complete(self) -> None:
        """Ends what is under way."""
        under_way, self._under_way = self._under_way, []
        for ticket, request in under_way:
            if self.refusals:
                reply = ErrorReply.of(self.refusals.pop(0), request_id=request.id)
                self._emit(Finished(ticket=ticket, reply=reply))
            else:
                self._emit(Finished(ticket=ticket, reply=self._observe(request)))

    def _observe(self, request: Perform) -> ObservationReply:
        program = np.array(in_motor_order(request.targets, self.capabilities))
        with PyBulletPhysics(make_problem().settings(self.capabilities)) as physics:
            readings = physics.read([(self._body, self._travel * program)])
        self._sequence += 1
        return ObservationReply(
            id=request.id,
            sequence=self._sequence,
            robot_time=float(self._sequence),
            monotonic=0.0,
            angles=request.targets,
            saturated_joints=(),
            touch=tuple(readings.touch[0].tolist()),
            tilt=tuple(
                (readings.tilt[0] + self._askew + self._rng.normal(0, self._noise, 2)).tolist()
            ),
            zero_tilt=tuple(self._askew.tolist()),
            clearance=float(readings.clearance[0]),
            clearance_saturated=bool(readings.saturated[0]),
            settled=True,
            settle_time=0.1,
            samples=10,
        )

    def _emit(self, event: RobotEvent) -> None:
        with self._lock:
            self._events.append(event)
        self._notify()


@contextmanager
def serving(robot: ModelRobot, bind: str = "tcp://127.0.0.1:*") -> Iterator[str]:
    """Serves a robot in a thread; yields where. Leaving it is the death of the daemon."""
    server = Server(robot, bind=bind, telemetry_bind="tcp://127.0.0.1:*")
    thread = threading.Thread(target=server.run, name="server")
    thread.start()
    try:
        yield server.endpoint
    finally:
        server.close()
        thread.join()
