"""Our search beside those of others, on readings that are recorded first.

The others look for attachments and lengths of a robot that is just as stated. Ours also weighs what
may deviate from that, and is run once more on a robot that is just as stated.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from bench.power.trial import RUN, Figures, Judge, Trial, TrialRun
from estimator.body.morphology import Array
from estimator.executors import ThisProcess
from estimator.physics.backends import open_arrays
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns
from estimator.posterior.sampling.sampler import Effort, Sampler
from estimator.storage.store import RunStore

WHOLE: Final = "ours, whole run"
REFIT: Final = "ours, all at once"
AS_STATED: Final = "ours, all at once, of a robot as stated"
UNIT: Final = "CatCMA with margin"
"""Name of the peer by whose CPU time that of the others is divided."""

_STATED: Final = 8  # samples of our search, as stated, that are polished
_IMPOSSIBLE: Final = -1e6  # log-likelihood of bodies that the problem does not allow


class TimeIsUpError(Exception):
    """The CPU time is spent."""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a peer found.

    Attributes:
        point: Best point, shape (size,).
        stated: Probability that it states of the attachments of ``point``, if it states any.
        finished: Whether its own rule ended it, and not the CPU time.
    """

    point: Array
    stated: float | None
    finished: bool


class Target:
    """The log-likelihood of points of the unit cube, noise factors integrated out.

    All bodies fall as statics says, with coarse steps, which is as cheap as in our own search.

    Args:
        predictor: Computes readings.
        likelihood: Likelihood of the observations.
        seconds: CPU time after which it raises ``TimeIsUpError``.

    Attributes:
        best: Best point so far, shape (size,).
        fit: Log-likelihood of the best point.
    """

    def __init__(self, predictor: Predictor, likelihood: Likelihood, seconds: float):
        self.predictor = predictor
        self.unknowns = predictor.unknowns
        self._likelihood = likelihood
        self._ends = time.process_time() + seconds
        self.best, self.fit = np.full(self.unknowns.size, 0.5), -np.inf

    def __call__(self, points: Array) -> Array:
        """Log-likelihoods of n points, shape (n, size)."""
        if time.process_time() > self._ends:
            raise TimeIsUpError
        values = np.clip(points, 0.0, 1.0)
        misfits = self._likelihood.misfits_of(self.predictor, values, branches=0)
        fits = self._likelihood.integrated(misfits)
        fits[self.unknowns.forbidden(values)] = _IMPOSSIBLE
        row = int(np.argmax(fits))
        if fits[row] > self.fit:
            self.best, self.fit = values[row].copy(), float(fits[row])
        return fits

    def key(self, point: Array) -> Attachments:
        """Attachments of one point."""
        return self.unknowns.keys(point[None])[0]


Peer = Callable[[Target, int], Answer]
"""Searches a target, given a seed."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """The answer of one search, a row of the table.

    Attributes:
        seed: Seed of the robot and of the run.
        who: Name of the search.
        right: Number of configurations that are right, up to what no sensor can tell.
        of: Number of configurations.
        worst_mm: Largest error of a leg's length, mm.
        nats: Log-likelihood of the best point, its lengths polished for a robot as stated, less
            that of our search, all at once. Of our search it is the best among the points of all
            its modes and its best samples as stated.
        stated: Probability stated of the attachments, if any.
        finished: Whether its own rule ended it, and not the CPU time.
        million: Number of simulations, millions.
        cpu_seconds: CPU time, s.
    """

    seed: int
    who: str
    right: int
    of: int
    worst_mm: float
    nats: float
    stated: float | None
    finished: bool
    million: float
    cpu_seconds: float


def rows_of(
    trial: Trial, seed: int, out: Path, peers: Mapping[str, Peer], limit: float
) -> list[Row]:
    """Answers of our search and of peers on one robot's readings.

    Args:
        trial: Trial that is run and recorded, unless its record is there already.
        seed: Seed of the robot, the run and the searches.
        out: Folder of the recorded runs.
        peers: Peers that are asked, by name.
        limit: CPU time of each peer, s.
    """
    run = TrialRun(group="peers", trial=trial, seed=seed)
    place = run.file(out).parent
    if not run.is_finished(out):
        place.mkdir(parents=True, exist_ok=True)
        run.make(place)
    figures = run.figures(out)
    with (
        RunStore.open(place / RUN, to_write=False) as store,
        StaticsPhysics(store.world) as physics,
    ):
        return list(
            _rows(store, figures, Judge(store, place / "truth.urdf", physics), peers, limit)
        )


def _rows(
    store: RunStore, figures: Figures, judge: Judge, peers: Mapping[str, Peer], limit: float
) -> Iterator[Row]:
    fitted = FittedPosterior.of(store)
    assert fitted is not None
    assert fitted.best is not None
    seed, likelihood, unknowns = figures.seed, fitted.likelihood, fitted.unknowns
    as_stated = Unknowns(fitted.genome)
    make_physics = partial(open_arrays, "statics", store.world)
    predictor = Predictor(as_stated, make_physics())
    solver = GaussNewton(predictor, likelihood)
    solver.fits(fitted.best[None])  # compiled code is loaded before time is taken
    Target(predictor, likelihood, limit)(fitted.best[None])
    base: float | None = None

    def row(
        who: str, answer: Answer, simulations: int, seconds: float, beside: Array | None = None
    ) -> Row:
        nonlocal base
        points = answer.point[None] if beside is None else beside
        fit = float(solver.polished(points)[1].max())
        base = fit if base is None else base
        right, of, errors = judge.of(answer.point)
        return Row(
            seed=seed,
            who=who,
            right=right,
            of=of,
            worst_mm=float(np.abs(errors).max()),
            nats=fit - base,
            stated=answer.stated,
            finished=answer.finished,
            million=simulations / 1e6,
            cpu_seconds=seconds,
        )

    for who, searched in {REFIT: unknowns, AS_STATED: as_stated}.items():
        effort, started = Effort(), time.process_time()
        seeds = np.random.SeedSequence(seed).spawn(effort.populations + 1)
        ours = Sampler(searched, make_physics, effort, seeds, workers=ThisProcess())
        posterior = ours.learn(likelihood)
        seconds = time.process_time() - started
        points = unknowns.cube(np.array([mode.point for mode in posterior.modes]))
        if posterior.as_stated is not None:
            samples = unknowns.cube(posterior.as_stated)
            best = np.argsort(-solver.fits(samples), kind="stable")[:_STATED]
            points = np.vstack([points, samples[best]])
        answer = Answer(point=points[0], stated=posterior.modes[0].probability, finished=True)
        yield row(who, answer, ours.cost.simulations, seconds, beside=points)
    stated = figures.steps[-1].probability
    answer = Answer(point=fitted.best, stated=stated, finished=True)
    yield row(WHOLE, answer, figures.simulations, figures.cpu_seconds)
    for name, peer in peers.items():
        peer_predictor = Predictor(as_stated, make_physics())
        started = time.process_time()
        answer = peer(Target(peer_predictor, likelihood, limit), seed)
        yield row(name, answer, peer_predictor.cost.simulations, time.process_time() - started)


def table(rows: Sequence[Row]) -> str:
    """Table by search, in Markdown: attachments right, and CPU time beside that of ``UNIT``."""
    units = {row.seed: row.cpu_seconds for row in rows if row.who == UNIT}
    lines = []
    for who in dict.fromkeys(row.who for row in rows):
        answers = [row for row in rows if row.who == who]
        ratios = [row.cpu_seconds / units[row.seed] for row in answers if row.seed in units]
        stated = [row.stated for row in answers if row.stated is not None]
        worst = [row.worst_mm for row in answers if row.right == row.of]
        lines.append(
            [
                who,
                ", ".join(f"{row.right}" for row in answers) + f" of {answers[0].of}",
                f"{np.median(worst):.1f}" if worst else "–",
                f"{min(row.nats for row in answers):+.1f}",
                f"{min(stated):.2f} to {max(stated):.2f}" if stated else "no",
                f"{sum(row.finished for row in answers)} of {len(answers)}",
                f"{np.mean([row.million for row in answers]):.1f}",
                f"{np.mean([row.cpu_seconds for row in answers]):.1f}",
                f"{np.median(ratios):.1f}" if ratios else "–",
            ]
        )
    head = [
        "",
        "attachments right",
        "worst leg where right (mm)",
        "nats to ours, at worst",
        "says how sure",
        "ended by itself",
        "simulations (M)",
        "CPU (s)",
        f"÷ {UNIT}",
    ]
    cells = [head, ["---", *["---:"] * (len(head) - 1)], *lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)
