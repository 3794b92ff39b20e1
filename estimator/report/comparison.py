"""Runs side by side, in numbers and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from estimator.body.morphology import Morphology
from estimator.evaluation.score import Score
from estimator.posterior.fitted import FittedPosterior
from estimator.report.camera import reach, take_picture
from estimator.report.canvas import OTHER_MARKERS, leg_colour, leg_label, new_figure
from estimator.report.evaluations import score_of
from estimator.report.plots import legend_of_names
from estimator.report.result import Result
from estimator.report.scene import MAIN_BODY, Solid, at_rest, model_links, solids_of
from estimator.report.summarise import summarise
from estimator.storage.posteriors import Interval
from estimator.storage.store import RunStore

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SPREAD: Final = 0.6  # share of the distance between two legs over which the runs' marks lie


@dataclass(frozen=True, kw_only=True)
class ComparedRun:
    """One of the runs that are compared.

    Attributes:
        name: Its directory, as it was given.
        result: The run in numbers.
        body: Best body of the run; ``None`` before anything was learnt.
        score: Score of the run against the true body, if it was scored in its present state.
    """

    name: str
    result: Result
    body: Morphology | None
    score: Score | None

    @classmethod
    def read(cls, directory: Path) -> ComparedRun:
        """Reads a run.

        Raises:
            RunDirectoryError: There is no run, or it is damaged.
        """
        with RunStore.open(directory, to_write=False) as store:
            result = summarise(store)
            fitted = FittedPosterior.of(store)
            return cls(
                name=str(directory),
                result=result,
                body=None if fitted is None else fitted.best_body,
                score=score_of(directory, result),
            )

    @property
    def lengths(self) -> dict[str, Interval]:
        """Length of each leg by its joint, m, with its 90 % interval or range in the population."""
        joints = (leg.joint for leg in self.result.legs)
        return dict(zip(joints, self.result.leg_intervals, strict=True))


def joints_of(runs: Sequence[ComparedRun]) -> tuple[str, ...]:
    """The joints that turn a leg in any of the runs, in the order of the legs' colours."""
    return tuple(dict.fromkeys(joint for run in runs for joint in run.lengths))


def comparison_picture(runs: Sequence[ComparedRun]) -> Figure:
    """Draws the best body of each run with all joints at 0, and below all runs' leg lengths."""
    figure = new_figure(max(7.0, 3.2 * len(runs)), 7.0)
    grid = figure.add_gridspec(2, 1)
    above, below = (figure.add_subfigure(grid[row]) for row in range(2))
    joints = joints_of(runs)
    bodies = [_best_body(run, joints) for run in runs]
    radius = max((reach(body) for body in bodies if body), default=1.0)
    panels = above.subplots(1, len(runs), squeeze=False)[0]
    for number, (axes, body) in enumerate(zip(panels, bodies, strict=True), 1):
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
        axes.set_title(_label(number, runs[number - 1]), loc="left", fontsize="small")
        axes.title.set_parse_math(False)
        if body:
            axes.imshow(take_picture(body, radius))
        else:
            axes.set_xlabel("no picture")
    _draw_lengths(below.subplots(), runs, joints)
    return figure


def _best_body(run: ComparedRun, joints: Sequence[str]) -> list[Solid]:
    """A run's best body at rest, each leg with its joint's place among ``joints`` as its limb.

    Empty where there is none.
    """
    if run.body is None:
        return []
    solids = at_rest(solids_of(model_links(run.body), np.zeros(run.body.motors)), None)
    legs = {leg: joints.index(joint) for leg, joint in enumerate(run.lengths)}
    limbs = {MAIN_BODY: MAIN_BODY, **legs}
    return [replace(solid, limb=limbs[solid.limb]) for solid in solids]


def _draw_lengths(axes: Axes, runs: Sequence[ComparedRun], joints: Sequence[str]) -> None:
    """Draws leg lengths: a colour for each leg, as on the bodies, and a marker for each run."""
    for number, run in enumerate(runs):
        marker = OTHER_MARKERS[number % len(OTHER_MARKERS)]
        axes.plot([], [], marker, color="0.3", label=_label(number + 1, run))
        offset = _SPREAD * ((number + 0.5) / len(runs) - 0.5)
        for joint, length in run.lengths.items():
            leg, median = joints.index(joint), 100 * length.median
            reach_down, reach_up = median - 100 * length.low, 100 * length.high - median
            axes.errorbar(
                leg + offset,
                median,
                yerr=[[max(reach_down, 0.0)], [max(reach_up, 0.0)]],
                fmt=marker,
                color=leg_colour(leg),
            )
        if run.score is not None:
            positions = [joints.index(joint) for joint in run.score.joints]
            true_lengths = 100 * np.array(run.score.true_lengths_m)
            axes.plot(positions, true_lengths, "_", color="0.3", markersize=40, zorder=0)
    axes.set_xticks(range(len(joints)), [leg_label(joint) for joint in joints], parse_math=False)
    axes.set_ylabel("leg length (cm)")
    axes.set_ylim(bottom=0)
    axes.spines[["top", "right"]].set_visible(False)
    legend_of_names(axes, columns=min(4, len(runs)))


def _label(number: int, run: ComparedRun) -> str:
    return leg_label(f"{number}: {Path(run.name).name}")
