"""Bodies that may have all changes at once: a change that explains much less is not named."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.posterior import systematic
from estimator.readings.observation import Observation
from estimator.use.weighing_changes import ChangeParticles, ChangeWeigher, Rows

_CHAINS: Final = 64
_TEMPERATURES: Final = np.concatenate([[0.0], np.geomspace(2e-3, 1.0, 32)])
_MOVES: Final = 2  # of each chain at each temperature

# Number of changes at once that the competitor expects before any reading: chosen, not tuned. The
# prior of one change more than those that are named is another (``diagnosis``).
_EXPECTED_AT_ONCE: Final = 1.5


def chances_of(weigher: ChangeWeigher) -> Array:
    """Probability that each change is on, before any reading, shape (changes,)."""
    return np.minimum(
        _EXPECTED_AT_ONCE * np.exp([change.log_prior for change in weigher.changes]), 0.5
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Competitor:
    """Bodies with any number of changes at once: spike and slab, annealed.

    Attributes:
        rows: Numbers of the weigher's bodies, before any change, shape (n,).
        on: Which changes each body has, shape (n, changes).
        theta: Amounts of all changes, shape (n, changes).
        weights: Weights, adding up to 1, shape (n,).
        log_evidence: Logarithm of the density of all observations.
    """

    rows: Rows
    on: Flags
    theta: Array
    weights: Array
    log_evidence: float = 0.0

    @classmethod
    def fitted(cls, weigher: ChangeWeigher, observations: Sequence[Observation]) -> Competitor:
        """Samples bodies by annealed importance sampling from the prior (Neal 2001)."""
        rng, changes = weigher.rng, weigher.changes
        chances, count = chances_of(weigher), _CHAINS
        theta = np.column_stack([change.drawn(rng.random(count)) for change in changes])
        state = cls(
            rows=weigher.rows_drawn(count, 0.5)[rng.permutation(count)],
            on=rng.random((count, len(changes))) < chances,
            theta=theta,
            weights=np.full(count, 1 / count),
        )
        logs, fits = np.zeros(count), state._fits(weigher, observations)
        for previous, temperature in itertools.pairwise(_TEMPERATURES):
            logs += (temperature - previous) * fits
            for _ in range(_MOVES):
                proposed, odds = state._moved(weigher, chances)
                new_fits = proposed._fits(weigher, observations)
                take = np.log(rng.random(count)) < temperature * (new_fits - fits) + odds
                state = replace(
                    state,
                    rows=np.where(take, proposed.rows, state.rows),
                    on=np.where(take[:, None], proposed.on, state.on),
                    theta=np.where(take[:, None], proposed.theta, state.theta),
                )
                fits = np.where(take, new_fits, fits)
        return replace(
            state,
            weights=softmax(logs),
            log_evidence=float(logsumexp(logs)) - math.log(count),
        )

    def _fits(self, weigher: ChangeWeigher, observations: Sequence[Observation]) -> Array:
        if not observations:
            return np.zeros(len(self.rows))
        bodies, scales = self.bodies(weigher), self.scales(weigher)
        fits: Array = weigher.fits_of(bodies, scales, observations, surely=True).sum(axis=1)
        return fits

    def _moved(self, weigher: ChangeWeigher, chances: Array) -> tuple[Competitor, Array]:
        """Proposes a move of each chain; the log-odds of the new state, but for its likelihood.

        A move switches a change, puts it in the place of another, or changes an amount or the body.
        """
        rng, changes = weigher.rng, weigher.changes
        rows, on, theta = self.rows.copy(), self.on.copy(), self.theta.copy()
        odds = np.zeros(len(rows))
        kinds = rng.integers(4, size=len(rows))
        shares = np.exp([change.log_prior for change in changes])
        chosen = rng.choice(len(changes), size=(len(rows), 2), p=shares / shares.sum())
        for chain in range(len(rows)):
            number, another = chosen[chain].tolist()
            present = np.flatnonzero(on[chain])
            if kinds[chain] == 0:
                on[chain, number] = not on[chain, number]
                sign = 1 if on[chain, number] else -1
                odds[chain] = sign * math.log(chances[number] / (1 - chances[number]))
                if on[chain, number]:
                    theta[chain, number] = changes[number].drawn(rng.random(1))[0]
            elif kinds[chain] == 1 and on[chain, number] != on[chain, another]:
                on[chain, [number, another]] = on[chain, [another, number]]
                new, old = (number, another) if on[chain, number] else (another, number)
                theta[chain, new] = changes[new].drawn(rng.random(1))[0]
                odds[chain] = math.log(chances[new] / (1 - chances[new])) - math.log(
                    chances[old] / (1 - chances[old])
                )
            elif kinds[chain] == 2 and present.size:
                at = int(rng.choice(present))
                old_amount = theta[chain, at]
                theta[chain, at] = old_amount + rng.normal(0, rng.choice([0.3, 0.1, 0.03]))
                densities = changes[at].log_density(np.array([theta[chain, at], old_amount]))
                odds[chain] = densities[0] - densities[1]
            else:
                rows[chain] = weigher.rows_drawn(1, float(rng.random()))[0]
        theta = np.clip(theta, -6, 6)
        return replace(self, rows=rows, on=on, theta=theta), odds

    def bodies(self, weigher: ChangeWeigher) -> Bodies:
        """The n bodies, with their changes."""
        bodies = weigher.before[self.rows]
        order, pieces = [], []
        for mask in np.unique(self.on, axis=0):
            rows = np.flatnonzero((self.on == mask).all(axis=1))
            built = bodies[rows]
            for number in np.flatnonzero(mask).tolist():
                built = weigher.changes[number].changed(built, self.theta[rows, number])
            order.append(rows)
            pieces.append(built)
        return Bodies.joined(pieces)[np.argsort(np.concatenate(order))]

    def scales(self, weigher: ChangeWeigher) -> Array:
        """Logarithms of the bodies' noise factors, shape (n, 2)."""
        scales: Array = weigher.scales_before[self.rows]
        return scales

    def drawn(self, count: int) -> Competitor:
        """Draws ``count`` equally likely bodies."""
        rows = systematic(self.weights, count, 0.5)
        return replace(
            self,
            rows=self.rows[rows],
            on=self.on[rows],
            theta=self.theta[rows],
            weights=np.full(count, 1 / count),
        )

    def suspects(self, weigher: ChangeWeigher) -> tuple[tuple[str, float], ...]:
        """The up to three changes that most bodies have, with the shares of bodies."""
        shares = self.weights @ self.on
        order = np.argsort(-shares)[:3]
        return tuple(
            (weigher.changes[index].name, float(shares[index]))
            for index in order.tolist()
            if shares[index] >= 0.3
        )


def log_alone(weigher: ChangeWeigher, one: ChangeParticles) -> float:
    """Logarithm of the competitor's prior probability that a change is on alone."""
    chances = chances_of(weigher)
    alone = float(np.sum(np.log1p(-chances)))
    if one.change is None:
        return alone
    chance = chances[weigher.changes.index(one.change)]
    return alone + math.log(chance) - math.log1p(-chance)
