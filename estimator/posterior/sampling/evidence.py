"""How much probability each set of attachments holds: its evidence, by importance sampling.

How many chains of a short run lie in a mode says how often the mode was discovered, not how much
it weighs. What it weighs is an integral over its few lengths and the noise factors. The lengths
are drawn from a mixture that is fitted to the mode and adapted once (Student's t, broad ones too,
and a part that covers the whole prior, so that no weight is unbounded); the two noise factors are
integrated on a grid.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import AT_ONCE, Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import log_gamma, logsumexp, softmax
from estimator.posterior.model.unknowns import Cost, Predictor

_FREEDOM: Final = 5.0  # of Student's t
_SHARES: Final = np.array([0.65, 0.27, 0.08])  # close, broad, anywhere
_CLOSE: Final = 1.2  # factor on the standard deviations of the close part
_BROAD: Final = 3.0  # and of the broad one
_ROUNDS: Final = 3  # of draws, each after the first from an adapted mixture
_CENTRES: Final = 8  # of an adapted mixture
_FEWEST: Final = 60  # draws in a round


@dataclass(frozen=True, kw_only=True)
class ModeEvidence:
    """The evidence of one set of attachments, and the draws that estimate it.

    Attributes:
        log_evidence: Logarithm of the integral of the likelihood over lengths and noise factors,
            times the prior of the attachments, to a constant.
        ess: Effective sample size of the draws.
        values: Draws, points of the cube, shape (draws, size).
        scales: Noise factors drawn for each, logarithms, shape (draws, 2).
        weights: Of the draws, adding up to 1.
    """

    log_evidence: float
    ess: float
    values: Array
    scales: Array
    weights: Array


class EvidenceEstimator:
    """Estimates the evidence of modes.

    Args:
        predictor: Computes readings.
        data: The observations.
        likelihood: Of ``data``.
        draws: Points drawn per mode and round.
    """

    def __init__(
        self, predictor: Predictor, data: SensorData, likelihood: Likelihood, *, draws: int
    ) -> None:
        self._predictor = predictor
        self._likelihood = likelihood
        self._solver = GaussNewton(predictor, data, likelihood)
        self._draws = draws
        self._fits: dict[bytes, float] = {}
        self._half_volumes: dict[bytes, float] = {}

    def __getstate__(self) -> dict[str, object]:
        """Without the numbers that were computed before: workers are not asked for them."""
        return {**self.__dict__, "_fits": {}, "_half_volumes": {}}

    def fits(self, values: Array) -> Array:
        """Log-likelihoods with the noise factors integrated out, shape (n,).

        Args:
            values: Points, shape (n, size). Those that were asked for before cost nothing.
        """
        return self._looked_up(self._fits, values, self._fits_of)

    def guess(self, values: Array) -> Array:
        """Laplace's approximation of the evidence, to tell which modes are worth more; shape (n,).

        Args:
            values: The best point of each mode, shape (n, size); see ``fits``.
        """
        half_volumes = self._looked_up(self._half_volumes, values, self._half_volumes_of)
        prior = self._predictor.unknowns.log_prior(values)
        guesses: Array = self.fits(values) + np.minimum(0.0, half_volumes) + prior
        return guesses

    def _looked_up(
        self, known: dict[bytes, float], values: Array, compute: Callable[[Array], Array]
    ) -> Array:
        points = [value.tobytes() for value in values]
        fresh = [row for row, point in enumerate(points) if point not in known]
        if fresh:
            numbers = compute(values[fresh]).tolist()
            known.update(zip((points[row] for row in fresh), numbers, strict=True))
        return np.array([known[point] for point in points])

    def _fits_of(self, values: Array) -> Array:
        return self._solver.fits(values)

    def _half_volumes_of(self, values: Array) -> Array:
        precision = self._solver.slopes(values).precision
        volume = precision.shape[-1] * math.log(2 * math.pi) - np.linalg.slogdet(precision)[1]
        return np.asarray(0.5 * volume)

    def of(
        self, point: Array, others: Array, rng: np.random.Generator, *, share: float = 1.0
    ) -> ModeEvidence:
        """The evidence of one mode.

        Args:
            point: Its best point, shape (size,).
            others: Points with the same attachments that fit well too, shape (m, size).
            rng: Draws the points.
            share: Of the usual draws.
        """
        draws = max(_FEWEST, round(share * self._draws))
        columns = self._predictor.unknowns.continuous
        covariance = np.linalg.inv(self._solver.slopes(point[None]).precision[0])
        proposals = [_Proposal(np.vstack([point, others])[:, columns], covariance)]
        drawn: list[Array] = []
        kept: list[tuple[Array, Array]] = []
        while True:
            drawn.append(proposals[-1].draw(draws, rng))
            kept.append(self._marginal(point, drawn[-1], rng))
            lengths = np.concatenate(drawn)
            fits = np.concatenate([fit for fit, _ in kept])
            mixture = logsumexp([one.log_density(lengths) for one in proposals], axis=0)
            ratios = fits - mixture + math.log(len(proposals))
            weights = softmax(ratios)
            if len(proposals) == _ROUNDS:
                break
            proposals.append(_Proposal.fitted(lengths, weights, rng))
        prior = self._predictor.unknowns.log_prior(point[None])[0]
        return ModeEvidence(
            log_evidence=float(logsumexp(ratios) - math.log(len(lengths)) + prior),
            ess=float(1 / np.sum(weights**2)),
            values=self._points(point, lengths),
            scales=np.concatenate([scales for _, scales in kept]),
            weights=weights,
        )

    def with_cost(self, task: tuple[Array, Array, float, int]) -> tuple[ModeEvidence, Cost]:
        """The evidence of one mode, and what it cost.

        Args:
            task: Point, others and share, as for ``of``, and a seed.
        """
        point, others, share, seed = task
        before = self._predictor.cost
        evidence = self.of(point, others, np.random.default_rng(seed), share=share)
        return evidence, self._predictor.cost.since(before)

    def _marginal(
        self, point: Array, lengths: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Log-likelihoods with the noise factors integrated out, and factors drawn for each."""
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=1)
        fits = np.full(len(lengths), -np.inf)
        scales = np.zeros((len(lengths), 2))
        rows = np.flatnonzero(inside)
        points = self._points(point, lengths[rows])
        misfits = self._likelihood.misfits_of(self._predictor, points)
        for start in range(0, len(rows), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            terms = self._likelihood.by_noise_factors(misfits[part])
            fits[rows[part]] = logsumexp(terms, axis=1)
            shares = np.cumsum(np.exp(terms - terms.max(axis=1, keepdims=True)), axis=1)
            chosen = np.argmax(shares > rng.random((len(terms), 1)) * shares[:, -1:], axis=1)
            scales[rows[part]] = self._likelihood.noise_factors.both[chosen]
        return fits, scales

    def _points(self, point: Array, lengths: Array) -> Array:
        values = np.tile(point, (len(lengths), 1))
        values[:, self._predictor.unknowns.continuous] = np.clip(lengths, 0.0, 1.0)
        return values


class _Proposal:
    """A mixture of Student's t around some centres, close and broad, and of the prior."""

    def __init__(self, centres: Array, covariance: Array) -> None:
        self._centres = centres
        self._root = np.linalg.cholesky(covariance)
        self._inverse = np.linalg.inv(self._root)
        size = len(covariance)
        self._constant = float(
            log_gamma((_FREEDOM + size) / 2)
            - log_gamma(_FREEDOM / 2)
            - size / 2 * math.log(_FREEDOM * math.pi)
            - np.log(np.diag(self._root)).sum()
        )

    @classmethod
    def fitted(cls, lengths: Array, weights: Array, rng: np.random.Generator) -> _Proposal:
        """Fitted to weighted draws."""
        mean = weights @ lengths
        away = lengths - mean
        covariance = (weights[:, None] * away).T @ away
        covariance += np.diag(0.1 * np.diag(covariance) + 1e-10)
        return cls(lengths[rng.choice(len(lengths), _CENTRES, p=weights)], covariance)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        size = self._centres.shape[1]
        part = rng.choice(len(_SHARES), count, p=_SHARES)
        radius = np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, (count, 1)))
        radius *= np.where(part == 1, _BROAD, _CLOSE)[:, None]
        centres = self._centres[rng.integers(len(self._centres), size=count)]
        near = centres + radius * (rng.normal(size=(count, size)) @ self._root.T)
        return np.where((part == 2)[:, None], rng.random((count, size)), near)

    def log_density(self, lengths: Array) -> Array:
        size = lengths.shape[1]
        away = (lengths[:, None] - self._centres) @ self._inverse.T
        distance = np.sum(away**2, axis=2)
        logs = [
            math.log(share / len(self._centres))
            - size * math.log(scale)
            + self._constant
            - (_FREEDOM + size) / 2 * np.log1p(distance / scale**2 / _FREEDOM)
            for share, scale in zip(_SHARES, (_CLOSE, _BROAD), strict=False)
        ]
        inside = np.all((lengths >= 0) & (lengths <= 1), axis=1)
        anywhere = np.where(inside, math.log(_SHARES[2]), -np.inf)
        density: Array = logsumexp(np.column_stack([*logs, anywhere]), axis=1)
        return density
