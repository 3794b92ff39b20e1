"""Modes weighed by their evidence, and samples of the posterior drawn by these weights."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.model.unknowns import Columns, Cost, Predictor
from estimator.posterior.posterior import Posterior, systematic
from estimator.posterior.sampling.evidence import ModeEvidence

_MOST: Final = 120  # modes whose evidence is estimated, drawn if there are more
_AT_ONCE: Final = 16  # of them
_WEIGHED: Final = 9.0  # nats below the best evidence
_WELL: Final = 64  # modes estimated by all draws; of more, each by fewer
_DRAWN: Final = 16  # points of a mode, for the next interaction,
_DRAWN_OF: Final = 32  # of so many modes, drawn as if
_SPREAD: Final = 64  # of the evidence's draws counted at least
_LEAST_POWER: Final = 1e-3  # to which weights are raised
_STEPS: Final = 20  # of valid sampling,
_GROUPS: Final = 2  # of chains, each moved by one worker
_FEW: Final = (
    0.05  # of a mode's draws effective, with fewer of which chains have to find their way:
)
_BURN_INS: Final = 4  # so often, those that got lost taken back in between,
_BURN_IN: Final = 50  # so many steps
_LOST: Final = 8.0  # nats below the best, and one for each length


@dataclass(frozen=True, kw_only=True)
class WeighedModes:
    """Modes that stand for all that were discovered.

    Attributes:
        points: Their best points, shape (n, size).
        evidences: Of each.
        shares: Of the posterior, shape (n,); a mode that was drawn among several stands for them.
    """

    points: Array
    evidences: Sequence[ModeEvidence]
    shares: Array

    def draws(self, rows: Sequence[int]) -> Array:
        """Some draws of each of the modes of these rows, spread out, shape (n, size)."""
        chosen = [self.points[:0]]
        for row in sorted(rows, key=lambda row: -self.shares[row])[:_DRAWN_OF]:
            mode = self.evidences[row]
            likely = _spread_out(mode.weights, _SPREAD)
            chosen.append(mode.values[systematic(likely, _DRAWN, 0.5)])
        return np.concatenate(chosen)


def weighed(
    points: Array,
    guesses: Array,
    evidences_of: Callable[[Array, float], Sequence[ModeEvidence]],
    rng: np.random.Generator,
) -> WeighedModes:
    """The evidence of all modes, or of some that stand for them.

    Args:
        points: The best of each mode, shape (n, size).
        guesses: Of their evidences, shape (n,).
        evidences_of: Estimates the evidences of some modes, from their points, by a share of the
            usual draws.
        rng: Draws modes.
    """
    rows, log_chances = drawn(guesses, rng)
    hoped = guesses[rows] - log_chances
    share = min(1.0, _WELL / np.count_nonzero(hoped >= hoped.max() - _WEIGHED))
    evidences: list[ModeEvidence] = []
    logs = np.empty(0)
    while len(logs) < len(rows) and hoped[len(logs)] >= logs.max(initial=-np.inf) - _WEIGHED:
        evidences += evidences_of(points[rows[len(logs) : len(logs) + _AT_ONCE]], share)
        logs = np.array([one.log_evidence for one in evidences]) - log_chances[: len(evidences)]
    return WeighedModes(points=points[rows[: len(logs)]], evidences=evidences, shares=softmax(logs))


def sampled(
    modes: WeighedModes,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    rng: np.random.Generator,
    *,
    count: int,
    workers: Executor,
) -> tuple[Array, Array]:
    """Samples of the posterior: points of the cube, shape (count, size), and logarithms of scales.

    They start from draws of the modes, and are moved as chains by steps that leave the posterior
    invariant, in groups that do not see each other.

    Args:
        modes: From which to start.
        predictor: Computes readings.
        data: The observations.
        noise: Sensor noise.
        rng: Draws starts, and seeds of the chains.
        count: Of chains; a multiple of 8.
        workers: Move them.
    """
    spread = [_spread_out(mode.weights, count // 4) for mode in modes.evidences]
    which = rng.choice(len(spread), count, p=modes.shares)
    starts = [(mode, rng.choice(len(spread[mode]), p=spread[mode])) for mode in which.tolist()]
    values = np.array([modes.evidences[mode].values[row] for mode, row in starts])
    scales = np.array([modes.evidences[mode].scales[row] for mode, row in starts])
    best = modes.evidences[int(np.argmax(modes.shares))]
    few = best.ess < _FEW * len(best.values)
    groups = np.split(np.arange(count), _GROUPS)
    seeds = rng.integers(2**32, size=_GROUPS).tolist()
    starts_of_groups = [
        (values[rows], scales[rows], seed) for rows, seed in zip(groups, seeds, strict=True)
    ]
    moved = list(workers.map(partial(_moved, predictor, data, noise, few), starts_of_groups))
    for _, _, cost in moved:
        predictor.add_cost(cost)
    values, scales = (np.concatenate(arrays) for arrays in list(zip(*moved, strict=True))[:2])
    return values, scales


def _moved(
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    few: bool,
    starts: tuple[Array, Array, int],
) -> tuple[Array, Array, Cost]:
    """Moves a group of chains: their last values and scales, and the cost.

    Args:
        predictor: Computes readings.
        data: The observations.
        noise: Sensor noise.
        few: Whether few draws stand for the best mode: then chains begin too far out, and are
            first brought to where the posterior is.
        starts: Values and scales, and a seed.
    """
    before = predictor.cost
    values, scales, seed = starts
    rng = np.random.default_rng(seed)
    chains = Population(predictor, rng, values, scales)
    chains.observe(data, noise, surely=False)
    if few:
        chains.coarse = True
        for _ in range(_BURN_INS):
            for _ in range(_BURN_IN):
                chains.step()
            _take_back(chains, _LOST + predictor.unknowns.continuous.size, rng)
        chains.observe(data, noise, surely=False)
    for _ in range(_STEPS):
        chains.step()
    return chains.values, chains.scales, predictor.cost.since(before)


def _spread_out(weights: Array, wanted: int) -> Array:
    """Weights, raised to the power at which their effective size is at least ``wanted``."""
    power = 1.0
    while True:
        spread = weights**power
        spread /= spread.sum()
        if 1 / np.sum(spread**2) >= wanted or power < _LEAST_POWER:
            return spread
        power /= 2


def _take_back(chains: Population, allowance: float, rng: np.random.Generator) -> None:
    """Puts chains that are so many nats below the best where others are."""
    fits = chains.posterior_fits(1)
    kept = np.flatnonzero(fits >= fits.max() - allowance)
    rows = np.arange(len(fits))
    lost = fits < fits.max() - allowance
    rows[lost] = rng.choice(kept, np.count_nonzero(lost))
    chains.replace_coldest(chains.values[rows], chains.scales[rows])


def drawn(guesses: Array, rng: np.random.Generator) -> tuple[Columns, Array]:
    """Some of the modes, by their guessed shares: ``_MOST`` at most, which stand for all.

    Those with a large share are taken for sure, of the others each by its chance (systematic
    sampling); so no evidence is lost on average.

    Returns:
        Their indices, best guess first, and the logarithms of their chances.
    """
    order = np.argsort(-guesses, kind="stable")
    if len(order) <= _MOST:
        return order, np.zeros(len(order))
    shares = softmax(guesses[order])
    rest = np.cumsum(shares[::-1])[::-1]
    sure = 0
    while shares[sure] * (_MOST - sure) >= rest[sure]:
        sure += 1
    chances = np.ones(len(order))
    chances[sure:] = shares[sure:] / rest[sure] * (_MOST - sure)
    ends = np.floor(np.cumsum(chances) + rng.random())
    taken = np.flatnonzero(np.diff(ends, prepend=0.0) > 0)
    return order[taken], np.log(chances[taken])


def renormalised(posterior: Posterior, predictor: Predictor, likelihood: Likelihood) -> Posterior:
    """The posterior under densities that add up to 1, also where bodies may fall to several sides.

    Args:
        posterior: Equally likely samples, and modes, under a likelihood that adds up to more there.
        predictor: Computes readings.
        likelihood: That one.

    Returns:
        Equally likely samples, and modes, the most probable first.
    """

    def ratios(values: Array, scales: Array) -> Array:
        as_found = likelihood.of(likelihood.misfits_of(predictor, values), scales=scales)
        ratios: Array = (likelihood.normalised(predictor, values, scales) - as_found).sum(axis=1)
        return ratios

    modes, keys = posterior.modes, predictor.unknowns.keys(posterior.values)
    of_samples = ratios(posterior.values, posterior.scales)
    factors = ratios(np.array([mode.point for mode in modes]), np.zeros((len(modes), 2)))
    for number, mode in enumerate(modes):
        own = of_samples[[key == mode.attachments for key in keys]]
        if own.size:
            factors[number] = logsumexp(own) - math.log(own.size)
    shares = np.array([mode.probability for mode in modes]) * np.exp(factors - factors.max())
    rows = systematic(softmax(of_samples), len(keys), 0.5)
    changed = (
        replace(mode, probability=share)
        for mode, share in zip(modes, (shares / shares.sum()).tolist(), strict=True)
    )
    return replace(
        posterior,
        values=posterior.values[rows],
        scales=posterior.scales[rows],
        modes=tuple(sorted(changed, key=lambda mode: -mode.probability)),
    )
