"""The compiled part of the likelihood: both terms of the mixture, from misfits.

A search computes them for every proposal of every chain, on every level of noise, and for whole
grids of noise factors where these are integrated out.
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
from estimator.posterior.model.sensor_data import ASTRAY, COLUMNS, SILENT

_SOURCES: Final = stamp(Path(__file__).parent)
_TILT: Final = COLUMNS["tilt"].start  # and the one after it
_CLEARANCE: Final = COLUMNS["clearance"].start
_WRONG: Final = COLUMNS["touch"].start
_DOUBTFUL: Final = _WRONG + 1
_SILENT: Final = SILENT
_ASTRAY: Final = ASTRAY

_LOG_ROOT: Final = 0.5 * math.log(2 * math.pi)
_LOG_EVEN: Final = math.log(0.5)
_ROOT_HALF: Final = math.sqrt(0.5)
_FAR: Final = -30.0  # standard deviations, beyond which the error function underflows
_MULTIPLIED: Final = 8  # interactions whose densities are multiplied before a logarithm is taken


class Read(NamedTuple):
    """What was read in each of k interactions.

    Attributes:
        tilts: How many angles, shape (k,).
        clear: Whether clearance was, shape (k,).
        beyond: Whether the ground lay beyond the sensor's range, shape (k,).
        bits: How many touch bits, shape (k,).
        log_anywhere: Logarithm of the density of such readings anywhere, shape (k,).
    """

    tilts: Array
    clear: Flags
    beyond: Flags
    bits: Array
    log_anywhere: Array


class Spread(NamedTuple):
    """How far readings stray, before levels and noise factors.

    Attributes:
        tilt: rad.
        clearance: m.
        touch: Probability that a bit is wrong.
        worst_touch: What this may grow to.
        tilt_beside: How much farther where a robot ends beside the pose foretold, rad.
        clearance_beside: Likewise, m.
        outlier: Share of the interactions that do not end as the body does.
        nearby: Share of these that end beside it.
    """

    tilt: float
    clearance: float
    touch: float
    worst_touch: float
    tilt_beside: float
    clearance_beside: float
    outlier: float
    nearby: float


@compiled
def _log_ndtr(value: float) -> float:
    """Logarithm of the normal distribution function."""
    if value < _FAR:
        square = value * value
        return -0.5 * square - math.log(-value) - _LOG_ROOT + math.log1p((3 / square - 1) / square)
    if value > 0:
        return math.log1p(-0.5 * math.erfc(value * _ROOT_HALF))
    return math.log(0.5 * math.erfc(-value * _ROOT_HALF))


@compiled
def _log_sum(one: float, other: float) -> float:
    """Logarithm of the sum of two exponentials, of which one is finite."""
    high, low = (one, other) if one > other else (other, one)
    return high + math.log1p(math.exp(low - high))


@compiled
def _tilt_squares(misfits: Array, row: int, column: int) -> float:
    """Sum of the squares of both angles' residuals, rad²."""
    one, other = misfits[row, column, _TILT], misfits[row, column, _TILT + 1]
    squares: float = one * one + other * other
    return squares


@compiled
def _log_tilt(squares: float, angles: float, noise: float, log_noise: float) -> float:
    """Normal, of some angles together."""
    return -squares / (2 * noise * noise) - angles * (log_noise + _LOG_ROOT)


@compiled
def _log_clearance(misfit: float, beyond: bool, noise: float, log_noise: float) -> float:
    """Normal, or its tail beyond the sensor's range."""
    away = misfit / noise
    if beyond:
        return _log_ndtr(-away)
    return -0.5 * away * away - log_noise - _LOG_ROOT


def _make_mixture(sources: int) -> Any:
    @entrance
    def mixture(
        misfits: Array,
        turns: NDArray[np.intp],
        widths: Array,
        scales: Array,
        read: Read,
        spread: Spread,
        log_likely: Array,
        inlier: Array,
        outlier: Array,
    ) -> int:
        """Fills the logarithms of both terms, shape (n, k); see ``Likelihood.terms``.

        Args:
            misfits: Shape (n, k, MISFITS).
            turns: Which interactions the columns are, one row for all or one for each.
            widths: Factors on all noise, one for all or one for each.
            scales: Logarithms of the factors on tilt's and clearance's noise, likewise.
            read: What was read.
            spread: How far readings stray.
            log_likely: Of each lean.
            inlier: Receives the first term, or the sum of both where ``outlier`` has no columns.
            outlier: Receives the other.
        """
        log_inlier, log_outlier = math.log1p(-spread.outlier), math.log(spread.outlier)
        log_elsewhere, log_nearby = math.log1p(-spread.nearby), math.log(spread.nearby)
        for row in range(misfits.shape[0]):
            width = widths[row if len(widths) > 1 else 0]
            own = row if len(scales) > 1 else 0
            tilt = spread.tilt * width * math.exp(scales[own, 0])
            clearance = spread.clearance * width * math.exp(scales[own, 1])
            touch = min(spread.touch * width, spread.worst_touch)
            tilt_wide = math.hypot(tilt, spread.tilt_beside)
            clearance_wide = math.hypot(clearance, spread.clearance_beside)
            log_tilt, log_tilt_wide = math.log(tilt), math.log(tilt_wide)
            log_clearance, log_wide = math.log(clearance), math.log(clearance_wide)
            log_wrong, log_right = math.log(touch), math.log1p(-touch)
            for column in range(misfits.shape[1]):
                turn = turns[row if len(turns) > 1 else 0, column]
                anywhere = read.log_anywhere[turn]
                first, beside = -math.inf, anywhere
                if not misfits[row, column, _SILENT] > 0:
                    squares, angles = _tilt_squares(misfits, row, column), read.tilts[turn]
                    wrong, doubtful = misfits[row, column, _WRONG], misfits[row, column, _DOUBTFUL]
                    bits = (read.bits[turn] - doubtful - wrong) * log_right
                    bits += wrong * log_wrong + doubtful * _LOG_EVEN
                    first = log_inlier + log_likely[int(misfits[row, column, _ASTRAY])] + bits
                    first += _log_tilt(squares, angles, tilt, log_tilt)
                    beside = log_outlier + bits
                    beside += _log_tilt(squares, angles, tilt_wide, log_tilt_wide)
                    if read.clear[turn]:
                        away, beyond = misfits[row, column, _CLEARANCE], read.beyond[turn]
                        first += _log_clearance(away, beyond, clearance, log_clearance)
                        beside += _log_clearance(away, beyond, clearance_wide, log_wide)
                second = _log_sum(log_elsewhere + anywhere, log_nearby + beside)
                if outlier.shape[1]:
                    inlier[row, column], outlier[row, column] = first, second
                else:
                    inlier[row, column] = _log_sum(first, second)
        return 0 * sources

    return mixture


mixture: Final = _make_mixture(_SOURCES)


@compiled
def _fill_noises(noise: float, beside: float, factors: Array, noises: Array) -> None:
    """Fills rows: the noise under each factor, its logarithm, and both of what ends beside."""
    for one in range(len(factors)):
        narrow = noise * math.exp(factors[one])
        wide = math.hypot(narrow, beside)
        noises[0, one], noises[1, one] = narrow, math.log(narrow)
        noises[2, one], noises[3, one] = wide, math.log(wide)


# Loops, not arrays' own arithmetic: each expression of arrays takes Numba half a second.
@compiled
def _fill(table: Array, value: float) -> None:
    for one in range(table.shape[0]):
        for other in range(table.shape[1]):
            table[one, other] = value


@compiled
def _add(table: Array, value: float) -> None:
    for one in range(table.shape[0]):
        for other in range(table.shape[1]):
            table[one, other] += value


@compiled
def _add_logs(table: Array, product: Array) -> None:
    for one in range(table.shape[0]):
        for other in range(table.shape[1]):
            table[one, other] += math.log(product[one, other])


def _make_over_factors(sources: int) -> Any:
    @entrance
    def over_factors(
        misfits: Array,
        tilt_factors: Array,
        clearance_factors: Array,
        read: Read,
        spread: Spread,
        log_likely: Array,
        terms: Array,
    ) -> int:
        """Fills the log-likelihoods of n points under each pair of noise factors.

        A density is a product of what tilt's factor changes and what clearance's does, so
        exponentials are taken for each factor and not for each pair.

        Args:
            misfits: Shape (n, k, MISFITS).
            tilt_factors: Logarithms, shape (t,).
            clearance_factors: Logarithms, shape (c,).
            read: What was read.
            spread: How far readings stray.
            log_likely: Of each lean.
            terms: Receives them, shape (n, t, c).
        """
        log_inlier, log_outlier = math.log1p(-spread.outlier), math.log(spread.outlier)
        log_elsewhere, log_nearby = math.log1p(-spread.nearby), math.log(spread.nearby)
        log_wrong, log_right = math.log(spread.touch), math.log1p(-spread.touch)
        tilts = np.empty((4, len(tilt_factors)))
        clearances = np.empty((4, len(clearance_factors)))
        _fill_noises(spread.tilt, spread.tilt_beside, tilt_factors, tilts)
        _fill_noises(spread.clearance, spread.clearance_beside, clearance_factors, clearances)
        by_tilt = np.empty((2, len(tilt_factors)))
        product = np.empty((len(tilt_factors), len(clearance_factors)))
        for row in range(misfits.shape[0]):
            _fill(terms[row], 0.0)
            _fill(product, 1.0)
            multiplied = 0
            for column in range(misfits.shape[1]):
                anywhere = read.log_anywhere[column]
                if misfits[row, column, _SILENT] > 0:
                    _add(terms[row], anywhere)
                    continue
                least = log_elsewhere + anywhere  # what remains where nothing is explained
                _add(terms[row], least)
                squares, angles = _tilt_squares(misfits, row, column), read.tilts[column]
                wrong, doubtful = misfits[row, column, _WRONG], misfits[row, column, _DOUBTFUL]
                bits = (read.bits[column] - doubtful - wrong) * log_right
                bits += wrong * log_wrong + doubtful * _LOG_EVEN - least
                first = log_inlier + log_likely[int(misfits[row, column, _ASTRAY])] + bits
                beside = log_nearby + log_outlier + bits
                for one in range(len(tilt_factors)):
                    alone = _log_tilt(squares, angles, tilts[0, one], tilts[1, one])
                    wide = _log_tilt(squares, angles, tilts[2, one], tilts[3, one])
                    by_tilt[0, one] = math.exp(first + alone)
                    by_tilt[1, one] = math.exp(beside + wide)
                away, beyond = misfits[row, column, _CLEARANCE], read.beyond[column]
                for other in range(len(clearance_factors)):
                    near, nearby = 1.0, 1.0
                    if read.clear[column]:
                        noise, log_noise = clearances[0, other], clearances[1, other]
                        near = math.exp(_log_clearance(away, beyond, noise, log_noise))
                        noise, log_noise = clearances[2, other], clearances[3, other]
                        nearby = math.exp(_log_clearance(away, beyond, noise, log_noise))
                    for one in range(len(tilt_factors)):
                        product[one, other] *= (
                            1.0 + by_tilt[0, one] * near + by_tilt[1, one] * nearby
                        )
                multiplied += 1
                if multiplied % _MULTIPLIED == 0:
                    _add_logs(terms[row], product)
                    _fill(product, 1.0)
            _add_logs(terms[row], product)
        return 0 * sources

    return over_factors


over_factors: Final = _make_over_factors(_SOURCES)
