"""The density of one interaction's readings, given what a body predicts; compiled.

A search computes it for every proposal of every chain, on every level of noise, and for whole grids
of noise factors where these are integrated out. ``likelihood`` has the formula.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled, entrance, stamp
from estimator.posterior.model.noise import LOG_PEAK, Noise, log_above, log_shape
from estimator.posterior.model.sensor_data import BRANCH, COLUMNS, DENSITIES, NO_PREDICTION

_SOURCES: Final = stamp(Path(__file__).parent)
_TILT: Final = COLUMNS["tilt"].start  # of the first angle; the second is in the next column
_CLEARANCE: Final = COLUMNS["clearance"].start
_WRONG: Final = COLUMNS["touch"].start
_DOUBTFUL: Final = _WRONG + 1
_TILT_BESIDE: Final = DENSITIES["tilt"].beside
_CLEARANCE_BESIDE: Final = DENSITIES["clearance"].beside

_WORST_TOUCH: Final = 0.4  # chance of a wrong bit on the hottest levels
_LOG_EVEN: Final = math.log(0.5)
_MULTIPLIED: Final = 8  # interactions whose densities are multiplied before a logarithm is taken

_log_shape: Final = compiled(log_shape)
_log_above: Final = compiled(log_above)


class Read(NamedTuple):
    """What was read in each of k interactions.

    Attributes:
        tilts: Number of angles that were read, shape (k,).
        clear: Whether clearance was read, shape (k,).
        beyond: Whether the ground lay beyond the sensor's range, shape (k,).
        bits: Number of touch bits that were read, shape (k,).
        log_anywhere: Logarithm of the density of such readings in any pose times the share of
            outliers, shape (k,).
    """

    tilts: Array
    clear: Flags
    beyond: Flags
    bits: Array
    log_anywhere: Array


class Widths(NamedTuple):
    """Noise of tilt, rad, and of clearance, m, each with its logarithm."""

    tilt: float
    log_tilt: float
    clearance: float
    log_clearance: float


class Level(NamedTuple):
    """Noise on one level of a search and under one pair of noise factors.

    Attributes:
        predicted: Of readings in the pose predicted.
        beside: Of readings where a robot ends beside it.
        log_wrong: Logarithm of the probability that a touch bit is wrong.
        log_right: Logarithm of the probability that a touch bit is right.
    """

    predicted: Widths
    beside: Widths
    log_wrong: float
    log_right: float


@compiled
def _widths(tilt: float, clearance: float) -> Widths:
    return Widths(tilt, math.log(tilt), clearance, math.log(clearance))


@compiled
def level_of(spread: Noise, noise_scale: float, log_tilt: float, log_clearance: float) -> Level:
    """The noise with a factor on all of it, and two more, as logarithms, on tilt and clearance."""
    tilt = spread.tilt * noise_scale * math.exp(log_tilt)
    clearance = spread.clearance * noise_scale * math.exp(log_clearance)
    touch = min(spread.touch * noise_scale, _WORST_TOUCH)
    beside = _widths(math.hypot(tilt, _TILT_BESIDE), math.hypot(clearance, _CLEARANCE_BESIDE))
    return Level(_widths(tilt, clearance), beside, math.log(touch), math.log1p(-touch))


@compiled
def _log_bits(bits: float, wrong: float, doubtful: float, level: Level) -> float:
    """Log-probability of touch bits, of which some differ and of some the model is not sure."""
    right = bits - doubtful - wrong
    return right * level.log_right + wrong * level.log_wrong + doubtful * _LOG_EVEN


@compiled
def _log_tilt(one: float, other: float, angles: float, noise: float, log_noise: float) -> float:
    """Log-density of both angles; one that was not read has a misfit of 0 and is not counted."""
    shape = _log_shape(one / noise) + _log_shape(other / noise)
    return shape + angles * (LOG_PEAK - log_noise)


@compiled
def _log_clearance(
    misfit: float, clear: bool, beyond: bool, noise: float, log_noise: float
) -> float:
    """Log-density of a distance, or log-probability of ground beyond the range; 0: not read."""
    if not clear:
        return 0.0
    if beyond:
        return _log_above(misfit / noise)
    return _log_shape(misfit / noise) + LOG_PEAK - log_noise


@compiled
def log_density(
    tilt: tuple[float, float],
    angles: float,
    clearance: float,
    clear: bool,
    beyond: bool,
    log_bits: float,
    widths: Widths,
) -> float:
    """Logarithm of p1 or p2, by the noise: the robot ends in the pose predicted, or beside it.

    Args:
        tilt: Misfits of both angles, rad; 0 where not read.
        angles: Number of angles that were read.
        clearance: Misfit of clearance, m; that of the end of the range where the ground lies beyond
            it, and -inf where the body predicts it there, too.
        clear: Whether clearance was read.
        beyond: Whether the ground lies beyond the range.
        log_bits: Log-probability of the touch bits.
        widths: Noise.
    """
    of_tilt = _log_tilt(tilt[0], tilt[1], angles, widths.tilt, widths.log_tilt)
    of_clearance = _log_clearance(clearance, clear, beyond, widths.clearance, widths.log_clearance)
    return log_bits + of_tilt + of_clearance


def _make_mixture(sources: int) -> Any:
    @entrance
    def mixture(
        misfits: Array,
        interactions: NDArray[np.intp],
        noise_scales: Array,
        scales: Array,
        read: Read,
        spread: Noise,
        log_likely: Array,
        inlier: Array,
        beside: Array,
    ) -> int:
        """Fills logarithms of terms of the mixture, shape (n, k); see ``Likelihood``.

        Args:
            misfits: Shape (n, k, MISFITS).
            interactions: Which interactions the columns are, one row for all or one for each.
            noise_scales: Factors on all noise, one for all or one for each.
            scales: Logarithms of the factors on tilt's and clearance's noise, one row for all or
                one for each.
            read: What was read.
            spread: Sensor noise.
            log_likely: Logarithm of ``LIKELY`` for each inclination of gravity.
            inlier: Receives the term of the pose predicted.
            beside: Receives the term of an outlier beside that pose; of one in any pose where
                there is no prediction.
        """
        log_inlier, log_outlier = math.log1p(-spread.outlier), math.log(spread.outlier)
        log_nearby = math.log(spread.nearby)
        level = level_of(spread, 1.0, 0.0, 0.0)
        for row in range(misfits.shape[0]):
            pair, factor = row if len(scales) > 1 else 0, row if len(noise_scales) > 1 else 0
            if row == 0 or pair > 0 or factor > 0:
                level = level_of(spread, noise_scales[factor], scales[pair, 0], scales[pair, 1])
            for column in range(misfits.shape[1]):
                interaction = interactions[row if len(interactions) > 1 else 0, column]
                first, second = -math.inf, read.log_anywhere[interaction]
                if not misfits[row, column, NO_PREDICTION] > 0:
                    wrong, doubtful = misfits[row, column, _WRONG], misfits[row, column, _DOUBTFUL]
                    seen = (
                        (misfits[row, column, _TILT], misfits[row, column, _TILT + 1]),
                        read.tilts[interaction],
                        misfits[row, column, _CLEARANCE],
                        read.clear[interaction],
                        read.beyond[interaction],
                        _log_bits(read.bits[interaction], wrong, doubtful, level),
                    )
                    first = log_density(*seen, level.predicted)
                    second = log_density(*seen, level.beside)
                    first += log_inlier + log_likely[int(misfits[row, column, BRANCH])]
                    second += log_outlier
                inlier[row, column], beside[row, column] = first, log_nearby + second
        return 0 * sources

    return mixture


mixture: Final = _make_mixture(_SOURCES)


@compiled
def _fill_noises(noise: float, beside: float, factors: Array, noises: Array) -> None:
    """Fills rows: the noise under each factor and its logarithm, as predicted and beside that."""
    for column in range(len(factors)):
        narrow = noise * math.exp(factors[column])
        wide = math.hypot(narrow, beside)
        noises[0, 0, column], noises[0, 1, column] = narrow, math.log(narrow)
        noises[1, 0, column], noises[1, 1, column] = wide, math.log(wide)


# Loops, not arrays' own arithmetic: each expression of arrays takes Numba half a second to compile.
@compiled
def _multiply(product: Array, by_tilt: Array, by_clearance: Array) -> None:
    """Multiplies densities under pairs of factors by one interaction's, relative to its least."""
    for tilt in range(product.shape[0]):
        predicted, beside = by_tilt[0, tilt], by_tilt[1, tilt]
        for clearance in range(product.shape[1]):
            product[tilt, clearance] *= (
                1.0 + predicted * by_clearance[0, clearance] + beside * by_clearance[1, clearance]
            )


@compiled
def _brought_to_one(product: Array) -> float:
    """Divides densities by the largest, and returns the logarithm of that."""
    largest = 0.0
    for tilt in range(product.shape[0]):
        for clearance in range(product.shape[1]):
            largest = max(largest, product[tilt, clearance])
    for tilt in range(product.shape[0]):
        for clearance in range(product.shape[1]):
            product[tilt, clearance] /= largest
    return math.log(largest)


@compiled
def _weighted(product: Array, weights: Array) -> float:
    total = 0.0
    for tilt in range(product.shape[0]):
        for clearance in range(product.shape[1]):
            total += weights[tilt, clearance] * product[tilt, clearance]
    return total


def _make_over_factors(sources: int) -> Any:
    @entrance
    def over_factors(
        misfits: Array,
        tilt_factors: Array,
        clearance_factors: Array,
        weights: Array,
        read: Read,
        spread: Noise,
        log_likely: Array,
        sums: Array,
        terms: Array,
    ) -> int:
        """Fills the log-likelihoods of n points with noise factors integrated out.

        A density is a product of what tilt's factor changes and what clearance's does, so
        exponentials are taken for each factor and not for each pair.

        Args:
            misfits: Shape (n, k, MISFITS).
            tilt_factors: Logarithms of the factors on tilt's noise, shape (t,).
            clearance_factors: Logarithms of the factors on clearance's noise, shape (c,).
            weights: Weights of pairs of factors, adding up to 1, shape (t, c).
            read: What was read.
            spread: Sensor noise.
            log_likely: Logarithm of ``LIKELY`` for each inclination of gravity.
            sums: Receives the log-likelihoods, shape (n,).
            terms: Receives the log-likelihoods under each pair of factors, shape (n, t, c); without
                rows: they are not wanted.
        """
        log_inlier, log_outlier = math.log1p(-spread.outlier), math.log(spread.outlier)
        log_elsewhere, log_nearby = math.log1p(-spread.nearby), math.log(spread.nearby)
        level = level_of(spread, 1.0, 0.0, 0.0)
        tilts = np.empty((2, 2, len(tilt_factors)))
        clearances = np.empty((2, 2, len(clearance_factors)))
        _fill_noises(spread.tilt, _TILT_BESIDE, tilt_factors, tilts)
        _fill_noises(spread.clearance, _CLEARANCE_BESIDE, clearance_factors, clearances)
        by_tilt = np.empty((2, len(tilt_factors)))
        by_clearance = np.empty((2, len(clearance_factors)))
        product = np.empty((len(tilt_factors), len(clearance_factors)))
        for row in range(misfits.shape[0]):
            for tilt in range(product.shape[0]):
                for clearance in range(product.shape[1]):
                    product[tilt, clearance] = 1.0
            total, multiplied = 0.0, 0
            for column in range(misfits.shape[1]):
                anywhere = read.log_anywhere[column]
                if misfits[row, column, NO_PREDICTION] > 0:
                    total += anywhere
                    continue
                least = log_elsewhere + anywhere  # what remains where nothing is explained
                total += least
                left, forward = misfits[row, column, _TILT], misfits[row, column, _TILT + 1]
                wrong, doubtful = misfits[row, column, _WRONG], misfits[row, column, _DOUBTFUL]
                angles = read.tilts[column]
                bits = _log_bits(read.bits[column], wrong, doubtful, level) - least
                first = log_inlier + log_likely[int(misfits[row, column, BRANCH])] + bits
                log_shares = first, log_nearby + log_outlier + bits
                misfit = misfits[row, column, _CLEARANCE]
                clear, beyond = read.clear[column], read.beyond[column]
                for way in range(2):  # as predicted, or beside that
                    for at in range(len(tilt_factors)):
                        noise, log_noise = tilts[way, 0, at], tilts[way, 1, at]
                        log_tilt = _log_tilt(left, forward, angles, noise, log_noise)
                        by_tilt[way, at] = math.exp(log_shares[way] + log_tilt)
                    for at in range(len(clearance_factors)):
                        noise, log_noise = clearances[way, 0, at], clearances[way, 1, at]
                        log_clearance = _log_clearance(misfit, clear, beyond, noise, log_noise)
                        by_clearance[way, at] = math.exp(log_clearance)
                _multiply(product, by_tilt, by_clearance)
                multiplied += 1
                if multiplied % _MULTIPLIED == 0:
                    total += _brought_to_one(product)
            sums[row] = total + math.log(_weighted(product, weights))
            if len(terms):
                for tilt in range(product.shape[0]):
                    for clearance in range(product.shape[1]):
                        terms[row, tilt, clearance] = total + math.log(product[tilt, clearance])
        return 0 * sources

    return over_factors


over_factors: Final = _make_over_factors(_SOURCES)
