"""One robot of ``bench.after``: identified, posed, watched, damaged and diagnosed."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from bench.after_figures import DAMAGES, Damaged, Figures, Reached, right_of
from bench.daemons import Simulator, simulator
from estimator.api import load
from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation, Program, by_joint_name
from estimator.report.run_files import write_report
from estimator.reproduction.harness import BriefRun
from estimator.storage.run_config import RunConfig
from estimator.use.detectable_changes import detectable_changes_of
from estimator.use.diagnosis import diagnose
from estimator.use.movements import near_forks, readings_in
from estimator.use.pose import Goal, Pose, find_pose
from estimator.use.watch import Watch
from estimator.use.weighing_changes import ChangeParticles, ChangeWeigher
from estimator.workplaces import IN_THIS_PROCESS
from protocol.system.files import replace_text
from protocol.transport.client import RobotClient
from sim_robot.faults.control_socket import FaultClient

_MOST_MOVEMENTS: Final = 15  # movements in which a change may be noticed
_HELD_OUT: Final = 8  # movements by which a change that is named is judged
_SIGMAS: Final = 4.0  # standard deviations of noise, by which a prediction may be off
_ELSEWHERE: Final = (np.radians(3.0), 0.01)  # rad and m from what was predicted: it fell elsewhere


@dataclass(frozen=True, kw_only=True)
class AfterRun(BriefRun):
    """One robot of one seed, identified and used.

    Attributes:
        body: Name of the robot's body.
        problem: Name of the problem.
        engine: Engine that simulates the robot.
        seed: Seed of the robot and of the run.
        goals: Number of poses.
        quiet: Number of movements while nothing happens.
        faults: Faults that are injected, one after the other.
    """

    leaves = "figures.json"

    body: str
    problem: str
    engine: str
    seed: int
    goals: int
    quiet: int
    faults: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name, unique in the study."""
        return f"{self.body}-{self.engine}/{self.seed}"

    def make(self, place: Path) -> None:
        """Makes the run, and leaves its figures."""
        options = ("--seed", str(self.seed), "--body", self.body, "--engine", self.engine)
        with simulator(*options, "--control", "tcp://127.0.0.1:*") as robot:
            shutil.rmtree(place / "run", ignore_errors=True)
            order = RunConfig(robot=robot.uri, problem=self.problem, seed=self.seed, interactions=6)
            identify(place / "run", order, IN_THIS_PROCESS, Listener(), report=write_report)
            known = load(place / "run")
            with closing(StaticsPhysics(known.problem.settings(known.capabilities))) as physics:
                figures = self._used(known.computed_by(physics), robot, options)
        replace_text(place / self.leaves, figures.model_dump_json(indent=2))

    def _used(self, known: FittedPosterior, robot: Simulator, options: Sequence[str]) -> Figures:
        rng = np.random.default_rng(self.seed)
        with simulator(*options, "--noise", "none") as judge:
            poses = tuple(_poses(known, judge.uri, self.goals, rng))
        changes = detectable_changes_of(known, rng)
        faults = FaultClient(robot.control)
        with RobotClient(robot.uri) as client:
            client.acquire()
            watch, alarms = Watch(ChangeWeigher.of(known, changes, rng)), 0
            for _ in range(self.quiet):
                watch.take(_perform(client, tuple(watch.next_movement().tolist())))
                if watch.alarm:
                    watch, alarms = Watch(ChangeWeigher.of(known, changes, rng)), alarms + 1
            damaged = tuple(
                _damaged(ChangeWeigher.of(known, changes, rng), client, faults, fault)
                for fault in ("", *self.faults)
            )
        return Figures(poses=poses, quiet=self.quiet, alarms=alarms, damaged=damaged)

    def figures(self, root: Path) -> Figures:
        """Figures that a finished run has left."""
        return Figures.model_validate_json(self.file(root).read_text("utf-8"))

    def sentence(self, root: Path) -> str:
        """Says how the run went."""
        figures = self.figures(root)
        right = sum(damage.right for damage in figures.damaged)
        reached = sum(pose.reached for pose in figures.poses)
        return (
            f"{right} of {len(figures.damaged)} right, {reached} of {len(figures.poses)} poses, "
            f"{figures.alarms} false alarms in {figures.quiet} movements"
        )


def _perform(client: RobotClient, program: Program) -> Observation:
    capabilities = client.capabilities
    reply = client.perform(by_joint_name(program, capabilities))
    return Observation.from_wire(reply, capabilities)


def _poses(known: FittedPosterior, uri: str, count: int, rng: np.random.Generator) -> list[Reached]:
    """What became of goals: readings at random programs, none flat, judged without noise."""
    poses: list[Reached] = []
    low, high = known.program_range.T
    with RobotClient(uri) as client:
        client.acquire()
        while len(poses) < count:
            felt = _perform(client, tuple(rng.uniform(low, high).tolist()))
            if None in felt.tilt or felt.clearance is None or felt.clearance < 0.01:
                continue
            feet = frozenset(np.flatnonzero([bool(bit) for bit in felt.touch]).tolist())
            left, forward = felt.tilt
            goal = Goal(
                tilt_left=left,
                tilt_forward=forward,
                clearance=felt.clearance,
                stand_on=feet or None,
            )
            pose = find_pose(known, goal, rng)
            observed = _perform(client, pose.program)
            poses.append(
                Reached(
                    share=pose.share,
                    margin=pose.margin,
                    reached=goal.is_met_by(observed),
                    elsewhere=fell_elsewhere(observed, pose),
                )
            )
    return poses


def fell_elsewhere(observed: Observation, pose: Pose) -> bool:
    """Whether a robot reads otherwise than predicted; one whose reading is missing does."""
    tilt_error, rise_error = _errors(observed, pose.tilt, pose.clearance)
    return not (tilt_error <= _ELSEWHERE[0] and rise_error <= _ELSEWHERE[1])


def _errors(observed: Observation, tilt: ArrayLike, clearance: float) -> tuple[float, float]:
    """Largest error of predicted tilts, rad, and that of clearance, m; NaN where not read."""
    felt_tilt = np.array(observed.tilt, dtype=float)
    felt_clearance = math.nan if observed.clearance is None else observed.clearance
    return float(np.abs(felt_tilt - tilt).max()), abs(felt_clearance - clearance)


def _damaged(
    weigher: ChangeWeigher, client: RobotClient, faults: FaultClient, fault: str
) -> Damaged:
    """Injects a fault, watches the robot, diagnoses it, and mends it."""
    low, high = weigher.known.program_range.T
    _perform(client, tuple(weigher.rng.uniform(low, high).tolist()))
    for one in filter(None, fault.split(",")):
        faults.inject(one)
    is_named = right_of(fault)

    def is_right(one: ChangeParticles) -> bool:
        return one.change is not None and is_named(one.change.name)

    watch = Watch(weigher)
    while fault and not watch.alarm and watch.movements < _MOST_MOVEMENTS:
        watch.take(_perform(client, tuple(watch.next_movement().tolist())))
    suspects = watch.suspects() if watch.alarm else ()
    start = time.process_time()
    diagnosis = diagnose(weigher, lambda program, _: _perform(client, program))
    seconds = time.process_time() - start
    as_if = _as_if(weigher, diagnosis.changes[0], client)
    faults.mend()
    share = None
    if fault.startswith(("body.length", "body.cut")) and fault in DAMAGES:
        share = next((one.amount()[1:] for one in diagnosis.changes if is_right(one)), (0.0, 0.0))
    return Damaged(
        fault=fault,
        noticed=watch.movements if watch.alarm else None,
        suspected=any(is_right(one) for one, _ in suspects),
        verdict=diagnosis.verdict.value,
        named=tuple(one.change.name for one in diagnosis.changes if one.change is not None),
        probability=diagnosis.probability,
        share=share,
        as_if=as_if,
        movements=len(diagnosis.observations),
        cpu_seconds=seconds,
    )


def _as_if(weigher: ChangeWeigher, named: ChangeParticles, client: RobotClient) -> bool:
    """Whether a change predicts some movements that it has not seen, but for one at most."""
    known = weigher.known
    low, high = known.program_range.T
    programs = weigher.rng.uniform(low, high, (10 * _HELD_OUT, len(low)))
    bodies = weigher.bodies(named.drawn(_HELD_OUT, 0.5))
    safe = ~near_forks(known, bodies, programs).any(axis=1)
    explained = 0
    for program in programs[safe][:_HELD_OUT]:
        felt = _perform(client, tuple(program.tolist()))
        noise = known.noise
        predicted = readings_in(known, bodies, np.array([felt.taken]))
        tilt_error, rise_error = _errors(
            felt, np.median(predicted.tilt, axis=0), float(np.median(predicted.clearance))
        )
        explained += tilt_error < _SIGMAS * noise.tilt and rise_error < _SIGMAS * noise.clearance
    return explained >= min(_HELD_OUT, int(safe.sum())) - 1
