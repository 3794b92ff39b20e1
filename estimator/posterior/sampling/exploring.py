"""The posterior while the readings cannot tell of all parts: the chains, as they explore.

Where much is open nearly every sample has attachments of its own, and to find and weigh them one by
one is no use. What the readings do tell, of a limb or two, most samples have in common: with it the
next program is chosen, and from there the chains go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.discovery import BestPoints, Discovery
from estimator.posterior.discovery.population import EVERY, Population
from estimator.posterior.model.special import softmax
from estimator.posterior.posterior import Mode, Posterior, coverage, found_by_each

_LOST: Final = 12.0  # nats below the best
_STRAGGLERS: Final = 0.5  # of the chains, that may be lost in the end
_ROUNDS: Final = 3  # at most, until there are no more of them and all readings are explained
_LONGER: Final = 5  # times as many steps, where it is not known which part sits on which
_ANEW: Final = 100  # steps with each number of interactions, where chains begin anew


def explored(
    searches: Sequence[Discovery], workers: Executor, *, steps: int
) -> tuple[list[Discovery], Posterior, float]:
    """The posterior after the interactions so far.

    Args:
        searches: With each population.
        workers: Move the chains.
        steps: Of each round where limbs are known, and of sampling after them.

    Returns:
        The searches as they go on, the posterior, and how much of it both have found.
    """
    moved = list(workers.map(partial(_explore, steps), searches))
    by_population = [drawn for _, drawn in moved]
    values, scales, fits = (np.concatenate(arrays) for arrays in zip(*by_population, strict=True))
    unknowns = searches[0].predictor.unknowns
    keys = unknowns.keys(values)
    best: dict[tuple[int, ...], list[int]] = {}
    for row in np.argsort(-fits, kind="stable").tolist():
        best.setdefault(keys[row], []).append(row)
    found = found_by_each(list(best), [set(unknowns.keys(own)) for own, _, _ in by_population])
    modes = sorted(
        (
            Mode(key, len(rows) / len(keys), values[rows[0]], float(len(rows)), tuple(own))
            for (key, rows), own in zip(best.items(), found.tolist(), strict=True)
        ),
        key=lambda mode: -mode.probability,
    )
    posterior = Posterior(
        values=values,
        scales=scales,
        weights=np.full(len(values), 1 / len(values)),
        modes=tuple(modes),
        adequate_fit=True,
    )
    share = coverage(
        np.array([mode.probability for mode in modes]), np.array([mode.found for mode in modes])
    )
    return [search for search, _ in moved], posterior, share


def _explore(steps: int, search: Discovery) -> tuple[Discovery, tuple[Array, Array, Array]]:
    """Moves the chains of one population; its samples, their noise factors and their fits.

    They begin anew where the best body leaves something unexplained: what an interaction has led
    them to may be far from the truth.
    """
    population, unknowns = search.population, search.predictor.unknowns
    longer = steps * (_LONGER if unknowns.parents.any() else 1)
    explained = True
    for _ in range(_ROUNDS):
        if not explained:
            search.start_anew(_ANEW)
        bodies = search.search(longer, until_explained=True)
        explained = search.explains()
        lost = _lost_ones_moved(population, bodies, search.rng)
        if explained and lost <= _STRAGGLERS:
            break
    chains, drawn = population.coldest(), []
    for step in range(steps):
        chains.step()
        if step % EVERY == EVERY - 1:
            fits = chains.posterior_fits(1)
            drawn.append((chains.values.copy(), chains.scales.copy(), fits))
    population.replace_coldest(*drawn[-1][:2])
    values, scales, fits = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
    return search, (values, scales, fits)


def _lost_ones_moved(population: Population, bodies: BestPoints, rng: np.random.Generator) -> float:
    """Share of the coldest chains that were lost; they go on from bodies that fit.

    Args:
        population: Its coldest chains are moved.
        bodies: That were found, best first.
        rng: Draws among them.
    """
    cold = slice(0, population.chains_per_level)
    values, scales = population.values[cold].copy(), population.scales[cold].copy()
    lost = np.flatnonzero(population.posterior_fits(1) < bodies.fits[0] - _LOST)
    values[lost] = bodies.values[rng.choice(len(bodies.fits), lost.size, p=softmax(bodies.fits))]
    scales[lost] = 0.0
    population.replace_coldest(values, scales)
    return lost.size / population.chains_per_level
