"""Our search beside those of others, on readings that are recorded first: ``make bench-peers``.

A simulated robot is identified; what it read in all its movements is then given at once to each of
the others, with the same forward model and the same likelihood, one process and one thread.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before libraries are loaded

import argparse
import csv
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from bench.peers.peers import PEERS, Answer, Target
from bench.power.trial import RUN, Figures, Judge, Trial, TrialRun
from estimator.executors import ThisProcess
from estimator.physics.backends import open_arrays
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.sampling.sampler import Effort, Sampler
from estimator.storage.store import RunStore

WHOLE: Final = "ours, whole run"
REFIT: Final = "ours, all at once"
UNIT: Final = "CatCMA with margin"
"""By whose CPU time the others' is divided."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One answer.

    Attributes:
        seed: Of robot and run.
        who: Whose.
        right: Configurations that are right, up to what no sensor can tell.
        of: How many there are.
        worst_mm: Largest error of a leg.
        nats: Log-likelihood of the best point, its lengths polished, less that of our refit.
        stated: Probability stated of the attachments, if any.
        finished: Whether its own rule ended it, and not the CPU time.
        million: Simulations, millions.
        cpu_seconds: CPU time.
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


def rows_of(trial: Trial, seed: int, out: Path, peers: Sequence[str], limit: float) -> list[Row]:
    """What each makes of one robot's readings.

    Args:
        trial: What is run and recorded; once more only if it is not there yet.
        seed: Of robot, run and searches.
        out: Folder of the recorded runs.
        peers: Names of those that are asked.
        limit: CPU time of each of them, s.
    """
    run = TrialRun(group="peers", trial=trial, seed=seed)
    place = run.file(out).parent
    if not run.is_finished(out):
        place.mkdir(parents=True, exist_ok=True)
        run.make(place)
    figures = run.figures(out)
    with RunStore.open(place / RUN, to_write=False) as store, StaticsPhysics(store.world) as known:
        return list(_rows(store, figures, Judge(store, place / "truth.urdf", known), peers, limit))


def _rows(
    store: RunStore, figures: Figures, judge: Judge, peers: Sequence[str], limit: float
) -> Iterator[Row]:
    fitted = FittedPosterior.of(store)
    assert fitted is not None
    assert fitted.best is not None
    seed, data, noise, unknowns = figures.seed, fitted.data, fitted.noise, fitted.unknowns
    make_physics = partial(open_arrays, "statics", store.world)
    predictor = Predictor(unknowns, make_physics())
    solver = GaussNewton(predictor, data, Likelihood(data, noise))
    solver.fits(fitted.best[None])  # compiled code is loaded before time is taken
    target = Target(predictor, data, noise, limit)
    target(fitted.best[None])
    base: float | None = None

    def row(who: str, answer: Answer, simulations: int, seconds: float) -> Row:
        nonlocal base
        fit = float(solver.polished(answer.point[None])[1][0])
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

    effort = Effort()
    seeds = np.random.SeedSequence(seed).spawn(effort.populations + 1)
    started = time.process_time()
    ours = Sampler(unknowns, make_physics, noise, effort, seeds, workers=ThisProcess())
    mode = ours.learn(data).modes[0]
    answer = Answer(point=mode.point, stated=mode.probability, finished=True)
    yield row(REFIT, answer, ours.simulations, time.process_time() - started)
    stated = figures.steps[-1].probability
    answer = Answer(point=fitted.best, stated=stated, finished=True)
    yield row(WHOLE, answer, figures.simulations, figures.cpu_seconds)
    for name in peers:
        own = Predictor(unknowns, make_physics())
        started = time.process_time()
        target = Target(own, data, noise, limit)
        answer = PEERS[name](target, seed)
        yield row(name, answer, own.simulations, time.process_time() - started)


def table(rows: Sequence[Row]) -> str:
    """By peer, as Markdown: right in how many, and CPU time beside the unit's."""
    units = {row.seed: row.cpu_seconds for row in rows if row.who == UNIT}
    lines = []
    for who in dict.fromkeys(row.who for row in rows):
        own = [row for row in rows if row.who == who]
        ratios = [row.cpu_seconds / units[row.seed] for row in own if row.seed in units]
        stated = [row.stated for row in own if row.stated is not None]
        worst = [row.worst_mm for row in own if row.right == row.of]
        lines.append(
            [
                who,
                ", ".join(f"{row.right}" for row in own) + f" of {own[0].of}",
                f"{np.median(worst):.1f}" if worst else "–",
                f"{min(row.nats for row in own):+.1f}",
                f"{min(stated):.2f} to {max(stated):.2f}" if stated else "no",
                f"{sum(row.finished for row in own)} of {len(own)}",
                f"{np.mean([row.million for row in own]):.1f}",
                f"{np.mean([row.cpu_seconds for row in own]):.1f}",
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


def main() -> None:
    """Prints the table, and leaves ``peers.csv`` and ``peers.md``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problem", default="topological")
    parser.add_argument("--interactions", type=int, default=6)
    parser.add_argument("--explore", help="rule that chooses movements; default: the method's")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=list(PEERS))
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU of each peer, at most")
    parser.add_argument("--out", type=Path, default=Path("runs/peers"))
    options = parser.parse_args()
    trial = Trial(
        name=f"{options.problem} {options.interactions} {options.explore or 'chosen'}",
        seeds=tuple(options.seeds),
        problem=options.problem,
        interactions=options.interactions,
        explore=options.explore,
    )
    rows: list[Row] = []
    for seed in options.seeds:
        rows += rows_of(trial, seed, options.out, options.peers, options.seconds)
        print(f"seed {seed} is done", file=sys.stderr)
    with (options.out / "peers.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, asdict(rows[0]))
        writer.writeheader()
        writer.writerows(map(asdict, rows))
    text = table(rows)
    (options.out / "peers.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
