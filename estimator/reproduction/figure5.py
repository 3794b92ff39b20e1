"""Figure 5: the robot and the best models of one run, in the same two poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from estimator.evaluation.truth.urdf import read_urdf
from estimator.physics.backends import in_this_process
from estimator.readings.observation import Observation
from estimator.report.camera import reach, take_picture
from estimator.report.canvas import leg_patches, new_figure
from estimator.report.evaluations import TRUTH
from estimator.report.scene import Link, Solid, at_rest, model_links, robot_links, solids_of
from estimator.report.shown_bodies import observation_of
from estimator.reproduction.figure import (
    DrawnFigure,
    FinishedRun,
    Row,
    read_finished,
    write_figure,
)
from estimator.reproduction.figure4 import choose
from estimator.reproduction.paper_runs import Budget

NAME: Final = "fig5"
CAPTION: Final = (
    "The run of Figure 4. a: the robot. b, c, d: the best model after the first, the middle and "
    "the last iteration. All in the first motor program, which the models were fitted to (above), "
    "and in a fresh one, which they never saw (below), from the same camera; lines on the ground "
    "are 10 cm apart. Each body is turned as its readings say, the robot's measured, the models' "
    "simulated; the heading is not measured and is the same for all. Colours: the "
    "motor that moves a part."
)
HEADER: Final = (
    *("program", "panel", "body", "angles_deg", "touch"),
    *("tilt_lr_deg", "tilt_fb_deg", "clearance_mm"),
)
ROWS: Final = ("first motor program", "fresh motor program")


@dataclass(frozen=True, kw_only=True)
class _Subject:
    """One picture: a body in a pose, and the observation made there."""

    name: str
    solids: list[Solid]
    observation: Observation


def make(root: Path, budget: Budget, runs: int | None) -> DrawnFigure:
    """Draws the figure and writes its files."""
    chosen = choose(root, budget, runs)
    if chosen is None:
        return DrawnFigure.missing(NAME, CAPTION)
    (run,) = read_finished(root, [chosen])
    shown = (run.interactions[0], *run.predictions[:1])
    poses = [item.observation for item in shown if item.observation is not None]
    subjects = [[_robot(run, root, pose), *_models(run, pose)] for pose in poses]
    radius = max(reach(subject.solids) for line in subjects for subject in line)
    picture = new_figure(14, 6.2)
    axes = picture.subplots(len(poses), len(subjects[0]), squeeze=False)
    for line, (name, pose) in enumerate(zip(ROWS, poses, strict=False)):
        for panel, panel_axes, subject in zip("abcd", axes[line], subjects[line], strict=False):
            panel_axes.imshow(take_picture(subject.solids, radius))
            panel_axes.set_xticks([])
            panel_axes.set_yticks([])
            panel_axes.set_xlabel(_reading(subject), fontsize="small")
            if not line:
                panel_axes.set_title(f"{panel}   {subject.name}", loc="left")
        axes[line, 0].set_ylabel(f"{name}\n{_angles(run, pose)}")
    patches = leg_patches(run.score.joints)
    picture.legend(handles=patches, loc="outside lower center", ncols=len(patches), frameon=False)
    rows = [
        _row(name, panel, subject, _angles(run, pose))
        for name, pose, line in zip(ROWS, poses, subjects, strict=False)
        for panel, subject in zip("abcd", line, strict=False)
    ]
    numbers: dict[str, Any] = {
        "caption": CAPTION,
        "seed": run.planned.seed,
        "poses": [dict(zip(HEADER, row, strict=True)) for row in rows],
    }
    write_figure(root, NAME, picture, header=HEADER, rows=rows, numbers=numbers)
    return DrawnFigure(name=NAME, caption=CAPTION, sentences=(_sentence(run, subjects),))


def _robot(run: FinishedRun, root: Path, pose: Observation) -> _Subject:
    joints = [joint["name"] for joint in run.result.robot["joints"]]
    links = robot_links(read_urdf(root / TRUTH), joints, run.problem.motors.driven)
    return _subject("robot", links, pose)


def _models(run: FinishedRun, pose: Observation) -> list[_Subject]:
    ends = run.iteration_ends
    chosen = sorted({0, (len(ends) - 1) // 2, len(ends) - 1})
    bodies = [run.best(ends[index]) for index in chosen]
    with closing(in_this_process(run.result.reference, run.world)) as physics:
        readings = physics.read([(body, np.array(pose.angles)) for body in bodies])
    return [
        _subject(
            f"model after iteration {index + 1}",
            model_links(body),
            observation_of(readings, row, pose.angles) or Observation(angles=pose.angles),
        )
        for row, (index, body) in enumerate(zip(chosen, bodies, strict=True))
    ]


def _subject(name: str, links: Sequence[Link], observation: Observation) -> _Subject:
    return _Subject(
        name=name,
        solids=at_rest(solids_of(links, observation.angles), observation),
        observation=observation,
    )


def _tilt(item: _Subject) -> tuple[float, float]:
    """Tilt of a body, degrees; 0 where it was not read."""
    left, ahead = (math.degrees(angle or 0.0) for angle in item.observation.tilt)
    return left, ahead


def _angles(run: FinishedRun, pose: Observation) -> str:
    driven = (pose.angles[motor] for motor in sorted(run.problem.motors.driven))
    return ", ".join(f"{math.degrees(angle):+.0f}°" for angle in driven)


def _touched(item: _Subject) -> str:
    return "".join("?" if bit is None else str(int(bit)) for bit in item.observation.touch)


def _reading(item: _Subject) -> str:
    left, ahead = (round(angle, 1) + 0.0 for angle in _tilt(item))
    height = item.observation.clearance
    clearance = "?" if height is None else f"{height * 1000:.0f} mm"
    return f"touch {_touched(item)}, tilt {left:+.1f}°, {ahead:+.1f}°, clearance {clearance}"


def _row(name: str, panel: str, item: _Subject, angles: str) -> Row:
    left, ahead = (round(angle, 3) for angle in _tilt(item))
    height = item.observation.clearance
    clearance = None if height is None else round(height * 1000, 2)
    return name, panel, item.name, angles, _touched(item), left, ahead, clearance


def _sentence(run: FinishedRun, subjects: Sequence[Sequence[_Subject]]) -> str:
    parts = []
    for name, line in zip(ROWS, subjects, strict=False):
        difference = max(abs(a - b) for a, b in zip(_tilt(line[0]), _tilt(line[-1]), strict=True))
        parts.append(f"{difference:.1f}° in the {name}")
    return (
        f"Seed {run.planned.seed}: the tilt of the last model differs from the robot's by at most "
        f"{' and '.join(parts)}."
    )
