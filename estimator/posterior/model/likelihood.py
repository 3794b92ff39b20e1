"""The likelihood of an interaction, given a body.

A mixture, so that one pose lowers a body's likelihood by a limited factor. For one interaction with
readings y and a body that predicts its pose::

    p(y | body) = (1 - e) p1(y) + e ((1 - q) p0(y) + q p2(y))
    p1(y) = N(tilt; s_t) N(clearance; s_c) Π Bernoulli(touch)

p0 is the density of readings in any pose: each tilt uniform over ±90°, clearance uniform over the
sensor's range, touch bits even. p2 is p1 with 3° and 10 mm more deviation: a robot may rest beside
the pose predicted, on the edge of a foot that models take to be round. A pose that the model cannot
predict (undecided, or a simulation that failed) leaves only e p0. A clearance at the
end of the sensor's range says that the ground lies beyond: a tail integral. Missing readings are
left out. ``sensor_data`` has the factors.
"""

from __future__ import annotations

import importlib
import math
from functools import cache
from typing import Any, Final

import numpy as np

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array
from estimator.posterior.model.noise import Noise, NoiseFactors
from estimator.posterior.model.sensor_data import BRANCH, COLUMNS, DENSITIES, MISFITS, SensorData
from estimator.posterior.model.special import expit, log_sum
from estimator.posterior.model.unknowns import Columns, Predictor
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import PredictedReadings

_SIDES: Final = np.radians([22.5, 202.5, 112.5, 292.5])
_INCLINED: Final = [
    math.tan(math.radians(angle)) * np.column_stack([np.cos(_SIDES), np.sin(_SIDES)])
    for angle in (2.0, 6.0)
]

GRAVITY_TILTS: Final = np.vstack([np.zeros((1, 2)), *_INCLINED])
"""Inclinations of gravity on the way, by number, shape (9, 2): none, what decides at a fork, and
what momentum may rarely do elsewhere. They lie in no plane of symmetry that bodies are likely to
have."""

FORKS: Final = GRAVITY_TILTS[1 : 1 + len(_SIDES)]
"""Inclinations of gravity that decide at a fork."""

LIKELY: Final = np.array([1.0, *[0.5] * len(_SIDES), *[0.05] * len(_SIDES)])
"""How likely each of ``GRAVITY_TILTS`` is, relative to the first."""

_LOG_LIKELY: Final = np.log(LIKELY)
_PLAINLY: Final = 3.0  # standard deviations by which readings of different poses differ
_AS_ANNOUNCED: Final = np.zeros((1, 2))


def apart(one: PredictedReadings, other: PredictedReadings, noise: Noise) -> Flags:
    """Whether n pairs of readings differ so much that their poses do, shape (n,)."""
    tilt = np.max(np.abs(one.tilt - other.tilt), axis=1) > _PLAINLY * noise.tilt
    clearance = np.abs(one.clearance - other.clearance) > _PLAINLY * noise.clearance
    plainly: Flags = tilt | clearance | (one.valid != other.valid)
    return plainly


class Likelihood:
    """The mixture of some interactions, for bodies of which the misfits are known.

    Args:
        data: The observations.
        noise: Sensor noise.

    Attributes:
        data: As above, like ``noise``.
        sigmas: Announced standard deviation of each residual, shape (RESIDUALS,).
        log_anywhere: Log-density of each interaction's readings if nothing is known of them, shape
            (k,).
        noise_factors: Noise factors over which ``integrated`` integrates.
    """

    def __init__(self, data: SensorData, noise: Noise):
        self.data = data
        self.noise = noise
        counts = {name: observed.count for name, observed in data.observed.items()}
        beyond = data.observed["clearance"].beyond
        self.log_anywhere = np.zeros(len(data))
        for name in MODALITIES:
            self.log_anywhere += DENSITIES[name].log_anywhere(counts[name], beyond, data.cap)
        self._ordered = np.arange(len(data))[None]
        self._read = _compiled().Read(
            tilts=counts["tilt"].astype(float),
            clear=counts["clearance"] > 0,
            beyond=beyond,
            bits=counts["touch"].astype(float),
            log_anywhere=math.log(noise.outlier) + self.log_anywhere,
        )
        self._log_elsewhere = math.log1p(-noise.nearby) + self._read.log_anywhere
        self.noise_factors = NoiseFactors.known_by(counts["tilt"].sum(), counts["clearance"].sum())
        self.sigmas = np.repeat(
            [noise.of(name) for name in DENSITIES],
            [density.residuals for density in DENSITIES.values()],
        )

    def __len__(self) -> int:
        """Number of interactions."""
        return len(self.data)

    def __getitem__(self, interactions: Columns | slice) -> Likelihood:
        """The mixture of some of the interactions."""
        return Likelihood(self.data[interactions], self.noise)

    def misfits_of(self, predictor: Predictor, values: Array, **how: Any) -> Array:
        """The misfits of n points of the cube; ``how`` is as ``misfits_of_bodies`` takes it."""
        return self.misfits_of_bodies(predictor, predictor.unknowns.bodies(values), **how)

    def misfits_of_bodies(
        self,
        predictor: Predictor,
        bodies: Bodies,
        interactions: Columns | None = None,
        *,
        branches: Array | float | None = None,
        coarse_step: bool = True,
        stances: Array | None = None,
        sides: Flags | None = None,
    ) -> Array:
        """The misfits of n bodies in k interactions, shape (n, k, MISFITS).

        Where an observation is more likely an outlier than not, the body may have fallen to another
        side: the first of ``GRAVITY_TILTS`` that explains the observation is taken.

        Args:
            predictor: Computes readings.
            bodies: As ``Unknowns.bodies`` makes them.
            interactions: Indices of the interactions, shape (k,); by default all.
            branches: Numbers of ``GRAVITY_TILTS``, shape (n, k) or one for all, under which bodies
                are taken to fall; 0: as statics has it.
            coarse_step: Whether joints turn in coarse steps, where ``branches`` are given.
            stances: Stances of bodies that are nearly the same, where ``branches`` are given, shape
                (n, k): see ``ArrayPhysics``.
            sides: Which of ``GRAVITY_TILTS`` are tried, shape (n, k, 9); by default all.
        """

        def under(rows: Columns, interactions: Columns, sides: Columns, **how: Any) -> Array:
            """Misfits (m, MISFITS) of bodies in one interaction, on one of ``GRAVITY_TILTS``."""
            if not rows.size:
                return np.empty((0, MISFITS))
            programs, tilts = self.data.programs[interactions], GRAVITY_TILTS[sides]
            readings = predictor.read(bodies, rows, programs, tilts, **how)
            misfits = self.data.misfits(readings, interactions)
            misfits[:, BRANCH] = sides
            return misfits

        if interactions is None:
            interactions = np.arange(len(self.data))
        shape = len(bodies), len(interactions), MISFITS
        rows, columns = np.indices(shape[:2]).reshape(2, -1)
        index = interactions[columns]
        if branches is not None:
            numbers = np.broadcast_to(branches, shape[:2]).ravel().astype(np.intp)
            flat = None if stances is None else stances.ravel().astype(np.int64)
            return under(rows, index, numbers, coarse_step=coarse_step, stances=flat).reshape(shape)
        misfits = under(rows, index, np.zeros_like(rows))
        poor, count = self._unexplained(misfits, index), len(GRAVITY_TILTS)
        tried = (
            np.ones((len(poor), count), bool) if sides is None else sides.reshape(-1, count)[poor]
        )
        retried, side = np.nonzero(tried[:, 1:])
        retried = poor[retried]
        other_misfits = under(rows[retried], index[retried], 1 + side)
        explains = np.ones(len(retried), dtype=bool)
        explains[self._unexplained(other_misfits, index[retried])] = False
        fallen, first = np.unique(retried[explains], return_index=True)
        misfits[fallen] = other_misfits[explains][first]
        return misfits.reshape(shape)

    def readings_of(self, predictor: Predictor, values: Array) -> PredictedReadings:
        """Readings of n points in every interaction, each on its branch: n · k rows."""
        numbers = self.misfits_of(predictor, values)[..., BRANCH].ravel().astype(np.intp)
        return predictor.read_all(values, self.data.programs, GRAVITY_TILTS[numbers])

    def normalised(self, predictor: Predictor, values: Array, scales: Array | None = None) -> Array:
        """Log-likelihood of n points in every interaction, shape (n, k).

        Unlike ``of`` it adds up to 1 over all readings also where a body may fall to several sides,
        which share the probability that is no outlier's. A search does without it, since it looks
        for sides only where readings are not explained; a stated probability cannot.

        Args:
            predictor: Computes readings.
            values: Points of the cube, shape (n, size).
            scales: As for ``of``.
        """
        inlier, outlier = self.terms(self.misfits_of(predictor, values), scales=scales)
        shared = np.log(self._sides(predictor, values))
        return np.logaddexp(inlier - shared, outlier)

    def _sides(self, predictor: Predictor, values: Array) -> Array:
        """Sum of ``LIKELY`` over the sides to which a body may fall, shape (n, k), at least 1."""
        count = len(GRAVITY_TILTS)
        shape = len(values), len(self.data), count
        rows, interactions, branches = np.indices(shape).reshape(3, -1)
        readings = predictor.read(
            predictor.unknowns.bodies(values),
            rows,
            self.data.programs[interactions],
            GRAVITY_TILTS[branches],
        )
        sides = [readings[::count]]
        counted = [np.ones(len(sides[0]), dtype=bool)]
        for branch in range(1, count):
            other = readings[branch::count]
            is_new = other.valid & ~other.undecided
            for side, counts in zip(sides, counted, strict=True):
                is_new &= apart(side, other, self.noise) | ~counts
            sides.append(other)
            counted.append(is_new)
        total: Array = LIKELY @ np.array(counted)
        return total.reshape(len(values), len(self.data))

    def _unexplained(self, misfits: Array, interactions: Columns) -> Columns:
        inlier, outlier = self.terms(misfits[:, None], interactions=interactions[:, None])
        return np.flatnonzero(inlier[:, 0] < outlier[:, 0])

    def inlier_share(
        self, misfits: Array, noise_scale: float = 1.0, scales: Array | None = None
    ) -> Array:
        """Probability that each interaction is no outlier, shape (n, k)."""
        inlier, outlier = self.terms(misfits, noise_scale, scales)
        return expit(inlier - outlier)

    def of(
        self,
        misfits: Array,
        noise_scale: Array | float = 1.0,
        scales: Array | None = None,
        interactions: Columns | None = None,
    ) -> Array:
        """Log-likelihood of each body in each interaction, shape (n, k).

        Args:
            misfits: Shape (n, k, MISFITS).
            noise_scale: Factor on all standard deviations, shape (n,) or one for all: a level of
                the search.
            scales: Logarithms of the factors on the noise of the modalities ``SCALED``, shape
                (n, 2); as announced by default.
            interactions: Which interactions the columns are, where not all in order, shape (n, k)
                or (1, k).
        """
        return log_sum(*self.terms(misfits, noise_scale, scales, interactions))

    def by_noise_factors(self, misfits: Array) -> Array:
        """Logarithms whose exponentials add up to the integral over noise factors.

        Shape (n, nodes of ``noise_factors``), by misfits of shape (n, k, MISFITS).
        """
        factors = self.noise_factors
        terms = np.empty((len(misfits), factors.tilt.size, factors.clearance.size))
        self._over_factors(misfits, terms)
        return terms.reshape(len(misfits), -1) + factors.log_weights

    def integrated(self, misfits: Array) -> Array:
        """Log-likelihoods, shape (n,), by misfits (n, k, MISFITS), noise factors integrated out.

        Bodies are compared by these: under the announced noise log-likelihoods would differ too
        little on a quiet robot, too much on a noisy one.
        """
        return self._over_factors(misfits, np.empty((0, 0, 0)))

    def _over_factors(self, misfits: Array, terms: Array) -> Array:
        factors, sums = self.noise_factors, np.empty(len(misfits))
        _compiled().over_factors(
            np.ascontiguousarray(misfits),
            factors.tilt,
            factors.clearance,
            factors.weights,
            self._read,
            self.noise,
            _LOG_LIKELY,
            sums,
            terms,
        )
        return sums

    def drawn_scales(self, misfits: Array, rng: np.random.Generator) -> Array:
        """Logarithms of noise factors, drawn for each of n bodies by misfits, shape (n, 2)."""
        terms = self.by_noise_factors(misfits)
        shares = np.cumsum(np.exp(terms - terms.max(axis=1, keepdims=True)), axis=1)
        chosen = np.argmax(shares > rng.random((len(terms), 1)) * shares[:, -1:], axis=1)
        scales: Array = self.noise_factors.both[chosen]
        return scales

    def best(self) -> Array:
        """Log-likelihood of a perfect prediction, an upper bound, shape (1, k)."""
        misfits = np.zeros((1, len(self.data), MISFITS))
        misfits[:, self._read.beyond, COLUMNS["clearance"]] = -np.inf  # beyond the range, too
        return self.of(misfits)

    def terms(
        self,
        misfits: Array,
        noise_scale: Array | float = 1.0,
        scales: Array | None = None,
        interactions: Columns | None = None,
    ) -> tuple[Array, Array]:
        """Logarithms of the mixture's terms, of inliers and of outliers, shape (n, k) each."""
        interactions = self._ordered if interactions is None else np.ascontiguousarray(interactions)
        inlier, beside = np.empty(misfits.shape[:2]), np.empty(misfits.shape[:2])
        _compiled().mixture(
            np.ascontiguousarray(misfits),
            interactions,
            np.atleast_1d(np.asarray(noise_scale, dtype=float)),
            _AS_ANNOUNCED if scales is None else np.ascontiguousarray(scales),
            self._read,
            self.noise,
            _LOG_LIKELY,
            inlier,
            beside,
        )
        return inlier, log_sum(self._log_elsewhere[interactions], beside)


@cache
def _compiled() -> Any:
    """Loaded when first used: other commands do not wait for it."""
    return importlib.import_module("estimator.posterior.model.mixture")
