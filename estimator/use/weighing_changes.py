"""Probability of each change given what was observed, and the bodies that the change leaves.

Each change has *particles*: a body that may have changed, most often one of the posterior as it was
identified, and an amount of the change. Its evidence is integrated by adaptive importance sampling:
bodies and amounts are drawn by their prior, then those that explain what was observed. It is always
computed from scratch from all observations: a sampler that takes in one after the other discards
the true change after one surprise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.posterior import systematic
from estimator.readings.observation import Observation
from estimator.storage.posteriors import LOW_ESS
from estimator.use.detectable_changes import DetectableChange

Rows = NDArray[np.intp]

UNLISTED_CHANGES: Final = 0.05
"""Share of changes that are in no row of the table; under them any reading is as probable.

Chosen, not tuned.
"""

# Probability, before a reading, that a robot that is diagnosed is as it was: chosen, not tuned.
_UNCHANGED_PRIOR: Final = 0.5
_PARTICLES: Final = 64  # particles of a change in the first round
_ROUNDS: Final = (64, 128, 256, 256)  # particles of a change in the further rounds
_MORE_ROUNDS: Final = (512,) * 4  # further ones, of a probable change that few bodies stand for
_SPREADS: Final = (0.01, 0.15)  # of amounts around good ones, in units of their priors
_PRIOR: Final = 0.3  # share of bodies that are drawn by their prior in each round
_CENTRES: Final = 16  # good amounts of either sign, around which others are drawn
_HOPELESS: Final = 30.0  # nats below the best change: no rounds for a change that is farther off,
_UNLIKELY: Final = 15.0  # and no further round,
_PROBABLE: Final = 3.0  # and none of those that are made where few bodies are left


@dataclass(frozen=True, kw_only=True, eq=False)
class ChangeParticles:
    """Weighted bodies of one change.

    Attributes:
        change: The change; ``None``: nothing has changed.
        rows: Numbers of the weigher's bodies, before the change, shape (n,).
        theta: Amounts of the change, standard normal before any reading, shape (n,).
        weights: Weights, adding up to 1, shape (n,).
        log_evidence: Logarithm of the density of all observations, given the change.
    """

    change: DetectableChange | None
    rows: Rows
    theta: Array
    weights: Array
    log_evidence: float

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def name(self) -> str | None:
        """Name of the change; ``None``: nothing has changed."""
        return None if self.change is None else self.change.name

    @property
    def effective_bodies(self) -> float:
        """Effective number of the weigher's bodies that the particles are made of."""
        return float(1 / np.sum(np.bincount(self.rows, self.weights) ** 2))

    def drawn(self, count: int, start: float) -> ChangeParticles:
        """Draws ``count`` equally likely particles."""
        chosen = systematic(self.weights, count, start)
        return replace(
            self,
            rows=self.rows[chosen],
            theta=self.theta[chosen],
            weights=np.full(count, 1 / count),
        )

    def amount(self, times: Array | float = 1.0) -> tuple[float, float, float]:
        """Median of the amounts, and the ends of their 90 % interval.

        Args:
            times: Factors on the amounts, shape (n,), or one for all.
        """
        assert self.change is not None
        low, middle, high = np.quantile(
            self.change.amounts(self.theta) * times,
            (0.05, 0.5, 0.95),
            weights=self.weights,
            method="inverted_cdf",
        ).tolist()
        return middle, low, high


@dataclass(frozen=True, kw_only=True, eq=False)
class WeighedChanges:
    """All changes, the most probable first.

    Attributes:
        particles: Particles of each change, and of no change.
        probabilities: Probability of each, adding up to 1.
        none_of_these: Probability of what is in no row of the table, where any reading is as
            probable as another, against all of these changes.
    """

    particles: tuple[ChangeParticles, ...]
    probabilities: Array
    none_of_these: float

    @property
    def unchanged(self) -> float:
        """Probability that nothing has changed."""
        unchanged = [particles.change is None for particles in self.particles]
        return float(self.probabilities[unchanged].sum())

    @property
    def shares(self) -> list[tuple[ChangeParticles, float]]:
        """Each change with its probability."""
        return list(zip(self.particles, self.probabilities.tolist(), strict=True))

    def shares_of(self, names: Collection[str | None]) -> list[tuple[ChangeParticles, float]]:
        """The changes of these names, ``None`` for no change, with shares that add up to 1."""
        groups = [(one, share) for one, share in self.shares if one.name in names]
        total = max(sum(share for _, share in groups), 1e-300)
        return [(one, share / total) for one, share in groups]


@dataclass(frozen=True)
class _Round:
    """Distribution that the particles of a round were drawn from.

    Attributes:
        count: Number of particles.
        chances: Probability of each body, shape (bodies,).
        centres: Centres of the amounts, shape (k,); ``None``: these were drawn by their prior.
        spread: Standard deviation of the amounts around their centres.
    """

    count: int
    chances: Array
    centres: Array | None
    spread: float

    def log_density(self, theta: Array, prior: Array) -> Array:
        """Log-density by which amounts, shape (n,), were drawn; ``prior``: their log-prior."""
        if self.centres is None:
            return prior
        offsets = (theta[:, None] - self.centres) / self.spread
        normal = -0.5 * offsets**2 - math.log(self.spread * math.sqrt(2 * math.pi))
        density: Array = logsumexp(normal, axis=1) - math.log(len(self.centres))
        return density


@dataclass(frozen=True, kw_only=True, eq=False)
class ChangeWeigher:
    """Weighs changes by observations: each is a change of some weighted bodies.

    Attributes:
        known: The body as it was identified.
        changes: What may have changed.
        rng: Draws particles.
        before: The n bodies that may have changed, before any of the changes.
        scales_before: Logarithms of their noise factors, shape (n, 2).
        weights: Their weights, positive and adding up to 1, shape (n,).
    """

    known: FittedPosterior
    changes: tuple[DetectableChange, ...]
    rng: np.random.Generator
    before: Bodies
    scales_before: Array
    weights: Array

    @classmethod
    def of(
        cls, known: FittedPosterior, changes: Sequence[DetectableChange], rng: np.random.Generator
    ) -> ChangeWeigher:
        """Weigher of changes of the body as it was identified.

        Args:
            known: The body as it was identified.
            changes: What may have changed.
            rng: Draws particles.
        """
        return cls(
            known=known,
            changes=tuple(changes),
            rng=rng,
            before=known.body_arrays,
            scales_before=known.scales,
            weights=np.maximum(known.weights, 1e-300),  # their logarithms are taken
        )

    def on_top_of(self, named: Sequence[tuple[ChangeParticles, float]]) -> ChangeWeigher:
        """Weigher of what may have changed as well, where some changes are taken to be known.

        Args:
            named: Particles of these changes, each with its share.
        """
        drawn = [
            particles.drawn(max(1, round(share * len(self.known))), float(self.rng.random()))
            for particles, share in named
        ]
        scales = np.concatenate([self.scales(particles) for particles in drawn])
        return replace(
            self,
            before=Bodies.joined([self.bodies(particles) for particles in drawn]),
            scales_before=scales,
            weights=np.full(len(scales), 1 / len(scales)),
        )

    def learning(self, log_fits: Array) -> ChangeWeigher:
        """Weigher that has learnt from unchanged bodies, with their log-likelihoods, shape (n,)."""
        log_ratios = np.maximum(log_fits - np.max(log_fits), -_HOPELESS)
        return replace(self, weights=softmax(np.log(self.weights) + log_ratios))

    def bodies(self, particles: ChangeParticles) -> Bodies:
        """The bodies of particles."""
        bodies = self.before[particles.rows]
        if particles.change is None:
            return bodies
        return particles.change.changed(bodies, particles.theta)

    def scales(self, particles: ChangeParticles) -> Array:
        """Logarithms of the particles' noise factors, shape (n, 2)."""
        scales: Array = self.scales_before[particles.rows]
        return scales

    def rows_drawn(self, count: int, start: float) -> Rows:
        """Numbers of ``count`` bodies, each as often as its weight says to within one.

        Args:
            count: Number of bodies.
            start: Offset between 0 and 1; expected counts are exact if it is drawn uniformly.
        """
        return systematic(self.weights, count, start)

    def prior(self, change: DetectableChange | None, count: int) -> ChangeParticles:
        """Draws ``count`` equally likely particles of a change before any reading."""
        rows = self.rows_drawn(count, float(self.rng.random()))
        places = (self.rng.permutation(count) + self.rng.random(count)) / count
        theta = np.zeros(count) if change is None else change.drawn(places)
        return ChangeParticles(
            change=change,
            rows=self.rng.permutation(rows),
            theta=theta,
            weights=np.full(count, 1 / count),
            log_evidence=0.0,
        )

    def as_before(self) -> ChangeParticles:
        """All bodies with their weights, as they are before any of the changes."""
        rows = np.arange(len(self.weights))
        return ChangeParticles(
            change=None,
            rows=rows,
            theta=np.zeros(len(rows)),
            weights=self.weights,
            log_evidence=0.0,
        )

    def log_prior(self, change: DetectableChange | None) -> float:
        """Logarithm of the probability of a change before any reading."""
        if change is None:
            return math.log(_UNCHANGED_PRIOR)
        return math.log(1 - _UNCHANGED_PRIOR) + change.log_prior

    def fits(self, particles: ChangeParticles, observations: Sequence[Observation]) -> Array:
        """Log-likelihoods of particles, shape (n, observations)."""
        return self.fits_of(self.bodies(particles), self.scales(particles), observations)

    def fits_of(
        self,
        bodies: Bodies,
        scales: Array,
        observations: Sequence[Observation],
        *,
        surely: bool = False,
    ) -> Array:
        """Log-likelihoods of n bodies, shape (n, observations).

        Args:
            bodies: The bodies.
            scales: Logarithms of their noise factors, shape (n, 2).
            observations: At least one.
            surely: Whether to assume that all bodies fall as statics says; then joints turn in
                coarse steps.
        """
        known = self.known
        likelihood = known.likelihood_of(observations)
        branches = 0 if surely else None
        misfits = likelihood.misfits_of_bodies(known.predictor, bodies, branches=branches)
        return likelihood.of(misfits, scales=scales)

    def weigh(self, observations: Sequence[Observation]) -> WeighedChanges:
        """Weighs all changes by all observations, from scratch."""
        priors = [self.prior(change, _PARTICLES) for change in self.changes]
        if not observations:
            all_particles = [self.prior(None, len(self.weights)), *priors]
            return self._sorted(all_particles)
        bodies = Bodies.joined([self.bodies(particles) for particles in priors])
        scales = np.concatenate([self.scales(particles) for particles in priors])
        coarse = self.fits_of(bodies, scales, observations, surely=True).sum(axis=1)
        coarse = coarse.reshape(len(priors), _PARTICLES)
        unchanged = self._unchanged(observations)
        guesses = logsumexp(coarse, axis=1) - math.log(_PARTICLES)
        best_evidence = max(float(guesses.max(initial=-np.inf)), unchanged.log_evidence)
        weighed = [unchanged]
        for particles, fits, guess in zip(priors, coarse, guesses.tolist(), strict=True):
            if np.max(fits) > best_evidence - _HOPELESS:
                weighed.append(self._refined(particles, observations, best_evidence))
            else:
                weighed.append(replace(particles, weights=softmax(fits), log_evidence=guess))
        return self._sorted(weighed, observations)

    def _unchanged(self, observations: Sequence[Observation]) -> ChangeParticles:
        particles = self.as_before()
        logs = np.log(self.weights) + self.fits(particles, observations).sum(axis=1)
        return replace(particles, weights=softmax(logs), log_evidence=float(logsumexp(logs)))

    def _refined(
        self, first: ChangeParticles, observations: Sequence[Observation], best_evidence: float
    ) -> ChangeParticles:
        """The particles of a change after some rounds of those that explain most.

        Args:
            first: Particles drawn by the prior.
            observations: All observations.
            best_evidence: Log-evidence of the best change, as far as it is known.
        """
        change, rng = first.change, self.rng
        assert change is not None
        rows, theta = first.rows, first.theta
        fits = self.fits(first, observations).sum(axis=1)
        rounds = [_Round(len(rows), self.weights, None, 1.0)]
        particles = self._weighted(change, rows, theta, fits, rounds)
        for count in (*_ROUNDS, *_MORE_ROUNDS):
            is_more = len(rounds) > len(_ROUNDS)
            behind = best_evidence - particles.log_evidence
            if behind > (_PROBABLE if is_more else _UNLIKELY):
                break
            if is_more and particles.effective_bodies >= LOW_ESS:
                break
            weights = particles.weights
            body_weights = np.bincount(rows, np.sqrt(weights), minlength=len(self.weights))
            chances = _PRIOR * self.weights + (1 - _PRIOR) * body_weights / body_weights.sum()
            centres = self._centres(theta, weights)
            spread = float(np.clip(np.std(np.abs(centres)), *_SPREADS))
            drawn = np.resize(centres, count)
            if not change.row.switch:
                drawn = drawn + rng.normal(0, spread, count)
            proposed = replace(
                first,
                rows=rng.permutation(systematic(chances, count, float(rng.random()))),
                theta=drawn,
            )
            rounds.append(_Round(count, chances, centres, spread))
            rows, theta = np.append(rows, proposed.rows), np.append(theta, proposed.theta)
            fits = np.append(fits, self.fits(proposed, observations).sum(axis=1))
            particles = self._weighted(change, rows, theta, fits, rounds)
        return particles

    def _centres(self, theta: Array, weights: Array) -> Array:
        """Amounts that explain most, of either sign, as one sign alone may be found by chance."""
        signs = [sign for sign in (theta < 0, theta >= 0) if weights[sign].sum() > 0]
        return np.concatenate(
            [
                theta[sign][
                    systematic(
                        weights[sign] / weights[sign].sum(), _CENTRES, float(self.rng.random())
                    )
                ]
                for sign in signs
            ]
        )

    def _weighted(
        self,
        change: DetectableChange,
        rows: Rows,
        theta: Array,
        fits: Array,
        rounds: Sequence[_Round],
    ) -> ChangeParticles:
        """Particles with their weights against the mixture of all rounds' distributions."""
        prior = change.log_density(theta)
        total = sum(one.count for one in rounds)
        drawn = [
            math.log(one.count / total)
            + np.log(one.chances[rows])
            + (prior if change.row.switch else one.log_density(theta, prior))
            for one in rounds
        ]
        logs = fits + prior + np.log(self.weights[rows]) - logsumexp(np.array(drawn), 0)
        return ChangeParticles(
            change=change,
            rows=rows,
            theta=theta,
            weights=softmax(logs),
            log_evidence=float(logsumexp(logs)) - math.log(len(rows)),
        )

    def _sorted(
        self, particles: Sequence[ChangeParticles], observations: Sequence[Observation] = ()
    ) -> WeighedChanges:
        unlisted = math.log(UNLISTED_CHANGES)
        if observations:
            unlisted += self.known.likelihood_of(observations).log_anywhere.sum()
        logs = [one.log_evidence + self.log_prior(one.change) for one in particles]
        listed = np.array(logs) + math.log(1 - UNLISTED_CHANGES)
        probabilities = softmax(listed)
        order = np.argsort(-probabilities, kind="stable")
        return WeighedChanges(
            particles=tuple(particles[index] for index in order.tolist()),
            probabilities=probabilities[order],
            none_of_these=float(softmax(np.append(listed, unlisted))[-1]),
        )
