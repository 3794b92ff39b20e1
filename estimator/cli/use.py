"""``estimator pose``, ``monitor`` and ``diagnose``: what an identified body is used for."""

from __future__ import annotations

import itertools
import json
import math
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from estimator.cli.console import (
    err,
    errors_as_sentences,
    out,
    print_run_directory,
    unless_unwritable,
)
from estimator.cli.options import CORES, Directory, Jobs, Keys
from estimator.cli.screen import Screen
from estimator.errors import EstimatorError
from estimator.identification.robot_link import RobotLink
from estimator.identification.run import reconnect
from estimator.physics.backends import open_predicting
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation, Program
from estimator.report.run_files import write_report
from estimator.report.summarise import summarise
from estimator.report.tables import plain_table
from estimator.storage.store import RunStore
from estimator.use.detectable_changes import detectable_changes_of
from estimator.use.diagnosis import MOVEMENTS, Verdict, said
from estimator.use.diagnosis import diagnose as find_change
from estimator.use.pose import SAFE, Goal, Pose, feet, find_pose, perform, standing_on
from estimator.use.record import write_run
from estimator.use.watch import FALSE_ALARMS, Watch
from estimator.use.weighing_changes import ChangeParticles, ChangeWeigher
from protocol.text import command_line

CHANGED: Final = 3
"""Exit code where the body has changed."""

EVERY: Final = 60.0
"""Seconds between two movements of ``monitor``."""

ONCE: Final = 6
"""Number of movements of ``monitor --once``."""

LOG: Final = "monitor.jsonl"
"""File in the run directory to which ``monitor`` adds a line for each movement."""

Robot = Annotated[str, typer.Option(help="tcp://HOST:PORT; a record cannot move.")]
Yes = Annotated[bool, typer.Option("--yes", help="Move the robot without asking first.")]
Seed = Annotated[int, typer.Option(help="Of what is drawn.")]
_MAX_CHANGES: Final = 4
_NONE_OF_THESE: Final = (
    "None of the changes that are known explains the readings, nor does any body of this run: see "
    "whether the robot stands free on the ground, and whether its servos turn."
)
_LENGTH_PATTERN: Final = re.compile(r"(\d+(?:\.\d*)?)\s*(mm|cm|m)")
_METRES_BY_UNIT: Final = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


def pose(
    directory: Directory,
    robot: Robot,
    *,
    tilt_forward: Annotated[
        float | None, typer.Option(metavar="DEG", help="Nose up by so much; down: negative.")
    ] = None,
    tilt_left: Annotated[
        float | None, typer.Option(metavar="DEG", help="Left side up by so much.")
    ] = None,
    level: Annotated[bool, typer.Option("--level", help="Both tilts 0.")] = False,
    clearance: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Belly above the ground, as 60mm.")
    ] = None,
    highest: Annotated[
        bool, typer.Option("--highest", help="Belly as high as the rest allows.")
    ] = False,
    stand_on: Annotated[
        str | None,
        typer.Option(metavar="JOINTS", help="Legs that are to touch the ground, no others."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say it, and do not move.")] = False,
    yes: Yes = False,
    seed: Seed = 0,
    jobs: Jobs = CORES,
    keys: Keys = None,
) -> None:
    """Move the robot so that its sensors read as wanted, whatever body it may have."""
    tilts = [None if tilt is None else math.radians(tilt) for tilt in (tilt_left, tilt_forward)]
    if level:
        if any(tilts):
            raise typer.BadParameter("--level is both tilts 0: leave out the other tilt")
        tilts = [0.0, 0.0]
    height = None if clearance is None else _metres(clearance)
    with errors_as_sentences(None), identified(directory, jobs) as (store, known):
        leg_joints = None if stand_on is None else [name.strip() for name in stand_on.split(",")]
        goal = Goal(
            tilt_left=tilts[0],
            tilt_forward=tilts[1],
            clearance=height,
            stand_on=None if leg_joints is None else standing_on(known, leg_joints),
            highest=highest,
        )
        judged = summarise(store).judged
        if judged is not None and not judged.explained:
            out.print(f"Note: {judged.verdict}", soft_wrap=True)
        found_pose = find_pose(known, goal, np.random.default_rng(seed))
        joints = [joint.name for joint in known.capabilities.joints]
        angles = zip(joints, found_pose.program, strict=True)
        program = ", ".join(f"{name} {math.degrees(angle):.1f}°" for name, angle in angles if angle)
        out.print(f"Motor program: {program or 'all joints at 0°'}.", soft_wrap=True)
        candidates = (
            "the bodies that the robot may have"
            if store.settings.keeps_samples
            else "the population's models"
        )
        if not found_pose.reachable:
            _print_readings(known, goal, found_pose, None)
            raise EstimatorError(
                f"no motor program brings the robot there: of {candidates}, "
                f"{found_pose.share:.0%} read so after the one that comes nearest, and most read "
                "what is predicted above"
            )
        margin = math.degrees(found_pose.margin)
        out.print(
            f"Of {candidates}, {found_pose.share:.0%} read so after it; "
            f"19 of 20 fall nowhere else while gravity is inclined by less than {margin:.1f}°.",
            soft_wrap=True,
        )
        if found_pose.margin < SAFE:
            out.print("Note: a trifle decides to which side it falls on the way.", soft_wrap=True)
        if highest and found_pose.clearance >= known.clearance_cap:
            out.print(
                f"Note: the distance sensor ends at {1000 * known.clearance_cap:.4g} mm, so other "
                "poses may be higher.",
                soft_wrap=True,
            )
        if dry_run:
            _print_readings(known, goal, found_pose, None)
            return
        may_move(yes, f"Move the robot at {robot}?")
        with Screen(err) as screen, closing(same_robot(store, robot, screen, keys)) as link:
            observed = perform(link, found_pose.program, 0, screen)
        _print_readings(known, goal, found_pose, observed)
        if not goal.is_met_by(observed, known.noise):
            out.print("It does not stand as wanted.", style="yellow")


def monitor(
    directory: Directory,
    robot: Robot,
    *,
    every: Annotated[
        float | None,
        typer.Option(min=0, help=f"Seconds between two movements. Default: {EVERY:.0f}."),
    ] = None,
    movements: Annotated[
        int | None, typer.Option(min=1, help="End after so many. Default: never.")
    ] = None,
    once: Annotated[
        bool, typer.Option("--once", help=f"End after {ONCE} movements, without a pause.")
    ] = False,
    patrol: Annotated[
        int,
        typer.Option(
            min=0,
            help="Make so many movements in turn. Default: each is the one that tells most.",
        ),
    ] = 0,
    false_alarms: Annotated[
        float,
        typer.Option(min=1e-12, max=0.1, help="Per movement, were the models exact."),
    ] = FALSE_ALARMS,
    yes: Yes = False,
    seed: Seed = 0,
    jobs: Jobs = CORES,
    keys: Keys = None,
) -> None:
    """Move the robot now and then, and say whether its body is still the same; 3: it is not."""
    if once:
        for option, value in (("--movements", movements), ("--every", every)):
            if value is not None:
                raise typer.BadParameter(
                    f"--once is {ONCE} movements without a pause: leave out {option}"
                )
        every, movements = 0.0, ONCE
    elif every is None:
        every = EVERY
    with errors_as_sentences(None), identified(directory, jobs) as (store, known):
        may_move(yes, f"Move the robot at {robot} now and then, also while nobody looks?")
        rng = np.random.default_rng(seed)
        weigher = ChangeWeigher.of(known, detectable_changes_of(known, rng), rng)
        watch = Watch(weigher, rate=false_alarms)
        programs = watch.patrol(patrol) if patrol else []
        with Screen(err) as screen:
            while movements is None or watch.movements < movements:
                number = watch.movements
                if number:
                    time.sleep(every)
                program = programs[number % patrol] if programs else watch.next_movement()
                with closing(same_robot(store, robot, screen, keys)) as link:
                    observation = perform(link, tuple(program.tolist()), number, screen)
                screen.observed(number, observation)
                watch.take(observation)
                suspects = watch.suspects() if watch.alarm else ()
                _log(directory, watch, suspects, observation)
                screen.say(f"Odds that the body has changed: {watch.odds:.2g} to 1.")
                if watch.alarm:
                    break
        if not watch.alarm:
            out.print(f"Not changed, by {watch.movements} movements ({watch.odds:.2g} to 1).")
            return
        out.print("The body has changed.", style="bold red")
        for suspect, share in suspects:
            out.print(f"{share:8.3f}  {said(suspect, known)}", soft_wrap=True)
        if suspects:
            out.print(f"{watch.none_of_these:8.3f}  none of the changes that are known")
        else:
            out.print(_NONE_OF_THESE, soft_wrap=True)
        command = command_line("estimator", "diagnose", directory, "--robot", robot)
        out.print(f"Find out with: {command}", soft_wrap=True)
        if not suspects:
            anew = ("identify", "--robot", robot, "--problem", store.settings.problem)
            out.print(f"Or identify it anew: {command_line('estimator', *anew)}", soft_wrap=True)
    raise typer.Exit(CHANGED)


def _log(
    directory: Path,
    watch: Watch,
    suspects: Sequence[tuple[ChangeParticles, float]],
    observation: Observation,
) -> None:
    """Adds a line of JSON about a movement to the log, for other programs."""
    line = {
        "time": time.time(),
        "movement": watch.movements,
        "odds": watch.odds,
        "threshold": watch.threshold,
        "alarm": watch.alarm,
        "suspects": {one.change.name: share for one, share in suspects if one.change is not None},
        "none_of_these": watch.none_of_these,
        "observation": observation.model_dump(mode="json"),
    }
    with unless_unwritable(directory), open(directory / LOG, "a", encoding="utf-8") as log:
        log.write(json.dumps(line) + "\n")


def diagnose(
    directory: Directory,
    robot: Robot,
    *,
    movements: Annotated[
        int, typer.Option(min=1, help="At most, those that put a cause to the test included.")
    ] = MOVEMENTS,
    place: Annotated[
        Path | None,
        typer.Option("--out", help="Run directory of the body as it is now. Default: a new one."),
    ] = None,
    yes: Yes = False,
    seed: Seed = 0,
    jobs: Jobs = CORES,
    keys: Keys = None,
) -> None:
    """Find out by a few movements what has changed on the robot since it was identified."""
    with errors_as_sentences(None), identified(directory, jobs) as (store, known):
        if not store.settings.keeps_samples:
            command = command_line(
                *("estimator", "identify", "--robot", robot, "--problem", store.settings.problem)
            )
            raise EstimatorError(
                f"{directory} is a run of the method {store.settings.method}, and a diagnosis "
                f"needs one of the method posterior: make it with `{command}`"
            )
        run = directory.resolve()
        out_directory = place or run.with_name(f"{run.name}-{time.strftime('%Y%m%d-%H%M%S')}")
        RunStore.check_free(out_directory)
        may_move(yes, f"Move the robot at {robot}, up to {movements} times?")
        rng = np.random.default_rng(seed)
        weigher = ChangeWeigher.of(known, detectable_changes_of(known, rng), rng)
        with Screen(err) as screen, closing(same_robot(store, robot, screen, keys)) as link:
            numbers = itertools.count()

            def act(program: Program, reason: str) -> Observation:
                number = next(numbers)
                screen.chosen(number, reason, None)
                observation = perform(link, program, number, screen)
                screen.observed(number, observation)
                return observation

            diagnosis = find_change(weigher, act, movements=movements)
        out.print(diagnosis.in_words(known), style="bold", soft_wrap=True)
        weighed = diagnosis.weighed
        changes = zip(weighed.particles, weighed.probabilities, strict=True)
        count = 0 if diagnosis.verdict is Verdict.NONE_OF_THESE else _MAX_CHANGES
        for suspect, share in itertools.islice(changes, count):
            out.print(f"{share:8.3f}  {said(suspect, known)}", soft_wrap=True)
        write_run(out_directory, store, weigher, diagnosis, robot)
        with RunStore.open(out_directory, to_write=False) as new_store:
            write_report(new_store)
        print_run_directory(out_directory)


@contextmanager
def identified(directory: Path, jobs: int) -> Iterator[tuple[RunStore, FittedPosterior]]:
    """Opens a run and what it knows of its robot's body, with its physics on ``jobs`` threads."""
    with RunStore.open(directory, to_write=False) as store:
        known = FittedPosterior.of(store)
        if known is None or known.best is None:
            raise EstimatorError(
                f"{directory} has no model yet: go on with "
                f"`{command_line('estimator', 'resume', directory)}` first"
            )
        opened = open_predicting(store.settings.physics, store.world, jobs=jobs)
        with closing(opened) as physics:
            yield store, known.computed_by(physics)


def same_robot(store: RunStore, uri: str, screen: Screen, keys: Path | None) -> RobotLink:
    """Connects to a run's robot, outside that run.

    Raises:
        EstimatorError: It is a record, or another robot.
        BodyschemaError: The robot cannot be reached.
    """
    link = reconnect(store, uri, screen, keys=keys, outside_run=True)
    if link.recorded is not None:
        link.close()
        raise EstimatorError(
            f"{uri} is a record, which cannot move: give the robot, tcp://HOST:PORT"
        )
    return link


def may_move(yes: bool, question: str) -> None:
    """Asks whether the robot may be moved, unless the command line says so."""
    if yes:
        return
    if not sys.stdin.isatty():
        raise EstimatorError("nobody is there to be asked whether the robot may move: say --yes")
    if not typer.confirm(question, err=True):
        raise EstimatorError("the robot was not moved")


def _metres(text: str) -> float:
    match = _LENGTH_PATTERN.fullmatch(text.strip())
    if match is None:
        raise typer.BadParameter(f"{text!r} is no length: write 60mm, 6cm or 0.06m")
    return float(match[1]) * _METRES_BY_UNIT[match[2]]


def _print_readings(
    known: FittedPosterior, goal: Goal, found: Pose, observed: Observation | None
) -> None:
    """Prints what was wanted, is predicted and was observed, a line for each sensor."""
    table = plain_table("", "wanted", "predicted", "observed")
    tilts = (None, None) if observed is None else observed.tilt
    for name, target, predicted, measured in (
        ("left side up", goal.tilt_left, found.tilt[0], tilts[0]),
        ("nose up", goal.tilt_forward, found.tilt[1], tilts[1]),
    ):
        cells = [_cell(value, math.degrees(1.0), "°") for value in (target, predicted, measured)]
        table.add_row(name, *cells)
    heights = (goal.clearance, found.clearance, None if observed is None else observed.clearance)
    cells = [_cell(value, 1000.0, " mm", most=known.clearance_cap) for value in heights]
    table.add_row("clearance", "highest" if goal.highest else cells[0], *cells[1:])
    count = len(found.touch)
    wanted = None if goal.stand_on is None else [sensor in goal.stand_on for sensor in range(count)]
    table.add_row(
        "stands on",
        *(
            "" if bits is None else _legs(known, bits)
            for bits in (wanted, found.touch, None if observed is None else observed.touch)
        ),
    )
    out.print(table)


def _cell(value: float | None, factor: float, unit: str, most: float = math.inf) -> str:
    """A reading; one that is ``most`` stands for all that are higher."""
    if value is None:
        return ""
    return f"{'at least ' if value >= most else ''}{factor * value:.1f}{unit}"


def _legs(known: FittedPosterior, bits: Sequence[bool | None]) -> str:
    legs = [leg for leg, sensors in feet(known).items() if any(bits[sensor] for sensor in sensors)]
    return ", ".join(legs) or "no leg"
