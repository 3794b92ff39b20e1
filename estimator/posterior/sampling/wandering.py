"""The posterior while the readings cannot tell of all parts: the chains, as they wander.

Where much is open nearly every sample has attachments of its own, and to find and weigh them one by
one is no use. What the readings do tell, of a limb or two, most samples have in common: with it the
next program is chosen, and from there the chains go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Noise, SensorData
from estimator.posterior.model.unknowns import Unknowns
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.sampling.discovery import Bodies, share_seen
from estimator.posterior.sampling.population import EVERY, Population

_LOST: Final = 12.0  # nats below the best
_STRAGGLERS: Final = 0.25  # of the chains, that may be lost in the end


def wandered(
    populations: Sequence[Population],
    data: SensorData,
    noise: Noise,
    unknowns: Unknowns,
    rngs: Sequence[np.random.Generator],
    *,
    rounds: int,
    steps: int,
) -> tuple[Posterior, bool]:
    """What is believed after the interactions so far, and whether some chain explains them all.

    Args:
        populations: Their chains are moved.
        data: What the robot felt.
        noise: How far readings stray.
        unknowns: The cube.
        rngs: Of each population, apart from its chains'.
        rounds: At most, until few chains of the coldest level are lost.
        steps: Of each round, and of sampling after them.
    """

    def wander(population: Population, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        population.observe(data, noise)
        for _ in range(rounds):
            for _ in range(steps):
                population.step()
            if _taken_back(population, rng) <= _STRAGGLERS:
                break
        drawn = []
        for step in range(steps):
            population.step()
            if step % EVERY == EVERY - 1:
                cold = slice(0, population.width)
                fits = population.posterior_fits(1)
                drawn.append((population.values[cold].copy(), population.scales[cold].copy(), fits))
        values, scales, fits = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
        return values, scales, fits

    with ThreadPoolExecutor(len(populations)) as threads:
        by_population = list(threads.map(wander, populations, rngs))
    values, scales, fits = (np.concatenate(arrays) for arrays in zip(*by_population, strict=True))
    keys = unknowns.keys(values)
    best: dict[tuple[int, ...], list[int]] = {}
    for row in np.argsort(-fits, kind="stable").tolist():
        best.setdefault(keys[row], []).append(row)
    modes = sorted(
        (
            Mode(key, len(rows) / len(keys), values[rows[0]], float(len(rows)))
            for key, rows in best.items()
        ),
        key=lambda mode: -mode.probability,
    )
    posterior = Posterior(
        values=values,
        scales=scales,
        weights=np.full(len(values), 1 / len(values)),
        modes=tuple(modes),
        seen=share_seen(
            [mode.attachments for mode in modes],
            np.array([mode.probability for mode in modes]),
            [Bodies(values=own, fits=fits) for own, _, fits in by_population],
            unknowns,
        ),
    )
    return posterior, not all(population.unexplained().all() for population in populations)


def _taken_back(population: Population, rng: np.random.Generator) -> float:
    """Share of the coldest chains that are lost; those far below the best are where others are.

    Lost are also all that leave some interaction unexplained.
    """
    cold = np.arange(population.width)
    fits = population.posterior_fits(1)
    low = fits < fits.max() - _LOST
    lost = low | population.unexplained()
    if lost.all():
        return 1.0
    rows = np.where(low, rng.choice(cold[~low], cold.size), cold)
    population.replace_coldest(population.values[rows], population.scales[rows], surely=True)
    return float(lost.mean())
