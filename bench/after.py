"""``make after``: poses on demand, changes noticed and named, on bodies that were identified first.

Each seed is one simulated robot of each body: it is identified through the wire, takes poses, is
watched while nothing happens, and is damaged through its control socket in one way after the other.
Every run is listed in ``docs/runs``.
"""

from __future__ import annotations

import argparse
import csv
import math
import re
import shutil
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, computed_field

from bench.daemons import Simulator, simulator
from bench.study_command import add_options, complete_by_command
from estimator.api import load
from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.physics.backends import IN_THIS_PROCESS
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation, Program, by_joint_name
from estimator.report.run_files import write_report
from estimator.reproduction.harness import BriefRun, made_by
from estimator.storage.run_config import RunConfig
from estimator.use.causes import Particles, Weigher
from estimator.use.changes import causes_of
from estimator.use.diagnosis import Verdict, diagnose
from estimator.use.movements import near_forks, readings_in
from estimator.use.pose import SAFE, Goal, Pose, find_pose
from estimator.use.watch import Watch
from protocol.system.files import replace_text
from protocol.transport.client import RobotClient
from sim_robot.faults.control_socket import FaultClient

ROBOTS: Final = tuple(
    f"{body}-{engine}"
    for body in ("quadruped", "unequal_legs")
    for engine in ("pybullet", "mujoco")
)
FOLDER: Final = Path(__file__).parents[1] / "docs" / "runs"
_MOST_MOVEMENTS: Final = 15  # movements in which a change may be noticed
_HELD_OUT: Final = 8  # movements by which a cause that is named is judged
_SIGMAS: Final = 4.0  # standard deviations of noise, by which a prediction may be off
_ELSEWHERE: Final = (np.radians(3.0), 0.01)  # rad and m from what was predicted: it fell elsewhere

DAMAGES: Final[dict[str, str]] = {
    "body.length=2:70": "leg of .* shortened",
    "body.length=1:50": "leg of .* shortened",
    "body.cut=3:70": "leg of .* (shortened|broken off)",
    "body.cut=2:50": "leg of .* (shortened|broken off)",
    "body.length=3:130": "leg of .* lengthened",
    "servos.jammed=3": "servo of .* jammed",
    "servos.dead=1": "servo of .* dead",
    "servos.swapped=1": "^plugs of (?!touch).* exchanged",
    "servos.slipped=1:8": "zero of",
    "servos.travel=2:60": "travel of",
    "sensors.deaf=2": "touch sensor 2 dead",
    "sensors.tilt_left=3": "own tilt, left/right",
    "sensors.too_high=10": "distance sensor's offset",
    "body.twisted=2:40": "hinge of",
    "body.aside=3:30": "direction of",
}
"""Faults, each with a pattern of the names of its cause."""

TOGETHER: Final = (
    "body.length=2:70,servos.slipped=1:8",
    "servos.jammed=3,sensors.deaf=2",
    "body.bent=2:25",
    "servos.travel=2:60,sensors.tilt_left=4",
)
"""Two faults at once, and one that the table lacks, of which no cause may be named."""


class Damaged(BaseModel):
    """What became of one damage.

    Attributes:
        fault: Fault as it was injected; empty: none.
        noticed: Number of movements after which it was noticed; ``None``: not within the most.
        suspected: Whether the right cause is among the suspects of the watch.
        verdict: Verdict of the diagnosis.
        named: Names of the diagnosis's causes.
        probability: Probability of these causes together.
        share: 90 % interval of the leg's new length as a share of the old one, (0, 0) where the
            right cause is not named; ``None``: the damage is no other length.
        as_if: Whether the first of these causes, right or wrong, predicts other movements.
        movements: Number of movements of the diagnosis.
        cpu_seconds: CPU time of the diagnosis, s.
    """

    model_config = ConfigDict(frozen=True)

    fault: str
    noticed: int | None
    suspected: bool
    verdict: str
    named: tuple[str, ...]
    probability: float
    share: tuple[float, float] | None
    as_if: bool
    movements: int
    cpu_seconds: float

    @computed_field  # type: ignore[prop-decorator]  # mypy knows no decorated properties
    @property
    def right(self) -> bool:
        """Whether the verdict is right: the cause of a known fault is one of at most two named."""
        if not self.fault:
            return self.verdict == Verdict.UNCHANGED.value
        if self.fault in TOGETHER:
            return self.verdict != Verdict.CHANGED.value
        named = any(map(_right_of(self.fault), self.named))
        return named and self.verdict == Verdict.CHANGED.value and len(self.named) <= 2

    @computed_field  # type: ignore[prop-decorator]
    @property
    def wrong(self) -> bool:
        """Whether another cause is named."""
        return self.verdict == Verdict.CHANGED.value and not self.right

    @property
    def holds(self) -> bool:
        """Whether the interval ``share`` holds the leg's true share."""
        assert self.share is not None
        low, high = self.share
        return low <= _share_in(self.fault) <= high


def _right_of(fault: str) -> Callable[[str], bool]:
    """Returns a test of whether a name is that of a fault's cause, on whatever leg."""
    pattern = re.compile(DAMAGES.get(fault, "(?!)"))
    return lambda name: pattern.search(name) is not None


def _share_in(fault: str) -> float:
    return float(fault.partition(":")[2]) / 100


class Reached(BaseModel):
    """What became of one goal: ``share`` and ``margin``, rad, are those of its ``Pose``.

    The robot has reached it, or it fell elsewhere than predicted, or neither.
    """

    model_config = ConfigDict(frozen=True)

    share: float
    margin: float
    reached: bool
    elsewhere: bool


class Figures(BaseModel):
    """Figures of one robot.

    Attributes:
        poses: What became of goals, which are readings of this robot at random programs.
        quiet: Number of movements of a watch while nothing happened.
        alarms: Number of alarms in these movements.
        damaged: What became of no damage and of each damage, one after the other.
    """

    model_config = ConfigDict(frozen=True)

    poses: tuple[Reached, ...]
    quiet: int
    alarms: int
    damaged: tuple[Damaged, ...]


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
        causes = causes_of(known, rng)
        faults = FaultClient(robot.control)
        with RobotClient(robot.uri) as client:
            client.acquire()
            watch, alarms = Watch(Weigher(known, causes, rng)), 0
            for _ in range(self.quiet):
                watch.take(_perform(client, tuple(watch.next_movement().tolist())))
                if watch.alarm:
                    watch, alarms = Watch(Weigher(known, causes, rng)), alarms + 1
            damaged = tuple(
                _damaged(Weigher(known, causes, rng), client, faults, fault)
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


def _damaged(weigher: Weigher, client: RobotClient, faults: FaultClient, fault: str) -> Damaged:
    """Injects a fault, watches the robot, diagnoses it, and mends it."""
    low, high = weigher.known.program_range.T
    _perform(client, tuple(weigher.rng.uniform(low, high).tolist()))
    for one in filter(None, fault.split(",")):
        faults.inject(one)
    is_named = _right_of(fault)

    def is_right(one: Particles) -> bool:
        return one.cause is not None and is_named(one.cause.name)

    watch = Watch(weigher)
    while fault and not watch.alarm and watch.movements < _MOST_MOVEMENTS:
        watch.take(_perform(client, tuple(watch.next_movement().tolist())))
    suspects = watch.suspects() if watch.alarm else ()
    start = time.process_time()
    diagnosis = diagnose(weigher, lambda program, _: _perform(client, program))
    seconds = time.process_time() - start
    as_if = _as_if(weigher, diagnosis.causes[0], client)
    faults.mend()
    share = None
    if fault.startswith(("body.length", "body.cut")) and fault in DAMAGES:
        share = next((one.amount()[1:] for one in diagnosis.causes if is_right(one)), (0.0, 0.0))
    return Damaged(
        fault=fault,
        noticed=watch.movements if watch.alarm else None,
        suspected=any(is_right(one) for one, _ in suspects),
        verdict=diagnosis.verdict.value,
        named=tuple(one.cause.name for one in diagnosis.causes if one.cause is not None),
        probability=diagnosis.probability,
        share=share,
        as_if=as_if,
        movements=len(diagnosis.observations),
        cpu_seconds=seconds,
    )


def _as_if(weigher: Weigher, named: Particles, client: RobotClient) -> bool:
    """Whether a cause predicts some movements that it has not seen, but for one at most."""
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


def tables(runs: Sequence[AfterRun], root: Path) -> str:
    """Table of how often each result came out as it should, in Markdown."""
    figures = [run.figures(root) for run in runs]
    damaged = [damage for robot in figures for damage in robot.damaged]
    undamaged = [damage for damage in damaged if not damage.fault]
    listed = [damage for damage in damaged if damage.fault in DAMAGES]
    novel = [damage for damage in damaged if damage.fault in TOGETHER]
    stumps = [damage for damage in listed if damage.share is not None]
    sized = [damage for damage in stumps if damage.right]
    alarms = [damage for damage in (*listed, *novel) if damage.noticed is not None]
    poses = [pose for robot in figures for pose in robot.poses]
    sure = [pose for pose in poses if pose.share >= 0.5]
    safe = [pose for pose in poses if pose.margin >= SAFE]
    none = Verdict.NONE_OF_THESE.value
    rows: list[tuple[str, Iterable[bool | int], int]] = [
        ("poses reached", (pose.reached for pose in poses), len(poses)),
        ("of goals called reachable, reached", (pose.reached for pose in sure), len(sure)),
        ("fell elsewhere, at a margin of 2° and more", (p.elsewhere for p in safe), len(safe)),
        (
            "false alarms, in so many movements",
            (robot.alarms for robot in figures),
            sum(robot.quiet for robot in figures),
        ),
        ("changes noticed", (1 for _ in alarms), len(listed) + len(novel)),
        (
            "the right cause among the monitor's three suspects",
            (damage.suspected for damage in alarms if damage.fault in DAMAGES),
            sum(damage.fault in DAMAGES for damage in alarms),
        ),
        ("right cause, alone or in a set of two", (damage.right for damage in listed), len(listed)),
        ("wrong cause", (damage.wrong for damage in listed), len(listed)),
        ("none of these, of the table", (damage.verdict == none for damage in listed), len(listed)),
        ("of these, legs", (damage.verdict == none for damage in stumps), len(stumps)),
        ("share of a leg within its 90 % interval", (damage.holds for damage in sized), len(sized)),
        (
            "a cause named, of two faults at once or one that the table lacks",
            (damage.wrong for damage in novel),
            len(novel),
        ),
        ("of these, moves as if", (damage.wrong and damage.as_if for damage in novel), len(novel)),
        ("undamaged robots called so", (robot.right for robot in undamaged), len(undamaged)),
    ]
    table = "\n".join(f"| {name} | {sum(counted)} | {total} |" for name, counted, total in rows)
    noticed = [damage.noticed for damage in alarms if damage.noticed is not None]
    return (
        f"{made_by(root, runs)} Movements until noticed: median {median(noticed or [0]):g}, "
        f"most {max(noticed, default=0)}.\n\n| | | of |\n|---|---|---|\n{table}\n"
    )


def write_runs(runs: Sequence[AfterRun], root: Path, folder: Path) -> None:
    """Writes ``after.csv`` and ``after-poses.csv``: each damage, and each pose."""
    made = made_by(root, runs)
    kinds: tuple[tuple[str, type[BaseModel], str], ...] = (
        ("after", Damaged, "damaged"),
        ("after-poses", Reached, "poses"),
    )
    folder.mkdir(parents=True, exist_ok=True)
    for name, kind, field in kinds:
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            columns = [*kind.model_fields, *kind.model_computed_fields]
            writer.writerow(("body", "engine", "seed", *columns, "commit"))
            for run in runs:
                for outcome in getattr(run.figures(root), field):
                    values = outcome.model_dump()
                    cells = [
                        "; ".join(map(str, value)) if isinstance(value, tuple) else value
                        for value in values.values()
                    ]
                    writer.writerow((run.body, run.engine, run.seed, *cells, made))


def main() -> None:
    """Does the runs that are not finished, and writes the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser, Path("runs/after"))
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(1000, 1004)))
    parser.add_argument(
        "--faults", nargs="+", default=[*DAMAGES, *TOGETHER], choices=[*DAMAGES, *TOGETHER]
    )
    parser.add_argument("--goals", type=int, default=50, help="poses of each robot")
    parser.add_argument("--quiet", type=int, default=250, help="movements of each undamaged robot")
    parser.add_argument("--robots", nargs="+", default=ROBOTS, help="BODY-ENGINE (%(default)s)")
    parser.add_argument("--tables", type=Path, default=FOLDER, help="folder (%(default)s)")
    options = parser.parse_args()
    runs = [
        AfterRun(
            body=body,
            problem="topological",
            engine=engine,
            seed=seed,
            goals=options.goals,
            quiet=options.quiet,
            faults=tuple(options.faults),
        )
        for seed in options.seeds
        for body, _, engine in (robot.rpartition("-") for robot in options.robots)
    ]
    complete_by_command(runs, options.out, options)
    write_runs(runs, options.out, options.tables)
    print(tables(runs, options.out))


if __name__ == "__main__":
    main()
