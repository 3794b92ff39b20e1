"""Is the robot built as the problem says, or would a departure explain the readings better?

What a problem states wrongly can be made up for by lengths or by other attachments: readings stay
explained, and the answer is wrong. So bodies that depart from the problem are fitted to the
readings too. One that explains them clearly better says that the problem is wrong; one that
explains them as well is a doubt, which a movement may settle, and has its share of the
probability until then.

Where statics leaves an interaction unexplained, the simulator is asked before a departure counts:
if bodies of the problem end there as was felt, statics was wrong, not the problem.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import Physics
from estimator.physics.equivalence import AGREEMENT, agree
from estimator.posterior.checks.fitting import departing_starts, fitted, fitted_departures
from estimator.posterior.checks.recheck import simulated_fits
from estimator.posterior.model.departures import Departure, Doubt, log_priors
from estimator.posterior.model.likelihood import LIKELY, Likelihood, Noise
from estimator.posterior.model.sensor_data import ASTRAY, SensorData
from estimator.posterior.model.slopes import PRIOR, Lengths
from estimator.posterior.model.special import expit, logsumexp
from estimator.posterior.model.unknowns import Predictor, departing_points, sizes_of
from estimator.posterior.posterior import Posterior, systematic

_CLEARLY_BETTER: Final = 2.5  # nats, the interaction that speaks most for it left out
_BETTER_BY_FAR: Final = 10.0  # nats, all interactions; one may be an outlier without the departure
_PRIOR: Final = 1 / 6  # of all departures together
_NOT_LOOKED_AT: Final = 0.2  # of these; the families of the others are as probable as each other
_OUTLIER_RATE: Final = 0.004  # unexplained interactions of robots as stated: 2 of 615 recorded
_STRANGE_RATE: Final = 0.3  # of robots that depart in a way that is not looked at
_STARTS: Final = 8
_WORTH_SAYING: Final = 0.005  # m
_MATTERS: Final = -0.75  # nats gained on average over all families, to ask the simulator
_SIMULATED: Final = 32  # samples
_MORE_LIKELY: Final = 0.5  # than not
_POORLY: Final = 3.0  # nats less than what explains an interaction best


def doubts(
    posterior: Posterior,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    departures: Sequence[Departure],
    *,
    reference: Physics,
    workers: Executor,
) -> tuple[Doubt, ...]:
    """Fits a body of each departure to the readings.

    Args:
        posterior: Of the problem's bodies.
        predictor: Likewise.
        data: What the robot felt.
        noise: How far readings stray.
        departures: Which to look at.
        reference: The simulator, asked about what statics leaves unexplained.
        workers: Fit the bodies.
    """
    if not departures:
        return ()
    every = max(1, len(posterior.values) // _STARTS)
    best = posterior.modes[0].point
    starts = np.vstack([best, posterior.values[::every][:_STARTS]])
    departing = predictor.departing(departures)
    numbered = departing_starts(starts[:2], departures, departing, data, noise)
    points, fits = fitted_departures(numbered, predictor, departures, data, noise, workers=workers)
    log_shares = _log_shares(points, departing, data, noise)
    # another of the problem's bodies may explain what the most probable one does not, and lengths
    # that a departure brings to light may suit it as well
    others = [mode.point for mode in posterior.modes[1 : 1 + _STARTS]]
    candidates = np.vstack([starts, *others, points[:_STARTS, :-2]])
    stated, as_stated = fitted(candidates, predictor, data, noise)
    priors = log_priors(departures).tolist()
    by_chance = _to_which_side(stated, predictor, data, noise)
    doubted = [
        Doubt(
            departure=departures[int(point[-2])].sized(size),
            point=point[:-2],
            gains=_without(gains, by_chance),
            log_share=log_share,
            log_prior=priors[int(point[-2])],
        )
        for point, size, gains, log_share in zip(
            points, sizes_of(points).tolist(), fits - as_stated, log_shares.tolist(), strict=True
        )
    ]
    if clearly_better(doubted) is not None or _mean_gain(doubted) > _MATTERS:
        samples = posterior.values[systematic(posterior.weights, _SIMULATED, 0.5)]
        bodies = np.vstack([stated, samples])
        amends = _amends(bodies, predictor, data, noise, reference) - by_chance
        doubted = [replace(doubt, gains=_without(doubt.gains, amends)) for doubt in doubted]
    return tuple(sorted(doubted, key=lambda doubt: -doubt.gain))


def that_can_be_felt(
    departures: Sequence[Departure],
    point: Array,
    predictor: Predictor,
    programs: Array,
    modalities: Sequence[str],
) -> tuple[Departure, ...]:
    """Those that feel otherwise than a body of the problem in some movement.

    A leg that never reaches the ground may be of any thickness, and a hinge that is turned about
    its own axis is the same hinge.

    Args:
        departures: Which to look at.
        point: The body, shape (size,).
        predictor: Of the problem's bodies.
        programs: Movements, rad, shape (n, motors).
        modalities: Sensors that may tell.
    """
    count = len(departures)
    if not count:
        return ()
    points = np.repeat(point[None], count, axis=0)
    as_stated = predictor.read_all(points, programs)
    departing = predictor.departing(departures)
    readings = departing.read_all(departing_points(points, np.arange(count)), programs)
    alike = agree(as_stated, readings, modalities).reshape(count, len(programs))
    return tuple(
        one for one, share in zip(departures, alike.mean(axis=1), strict=True) if share < AGREEMENT
    )


def probability_departed(doubted: Sequence[Doubt], outliers: Array, noise: Noise) -> float:
    """Probability that the robot is built otherwise, of which the prior is one robot in six.

    Ways that were looked at are held against the best body of the problem by what both explain,
    all others, as servos that fail on the way, by how many interactions the best body does not:
    robots that are built as stated hardly have any.

    Args:
        doubted: Ways that were looked at; none: attachments are not sure yet, nor is this.
        outliers: Probability of each interaction that it says nothing about the body, shape (k,).
        noise: By which these were computed.
    """
    if not doubted:
        return 0.0
    share, other = noise.outlier, _NOT_LOOKED_AT
    # densities of what was felt, to a factor, without the share that the mixture gives outliers
    strange, plain = outliers * (1 - share), (1 - outliers) * share

    def log_density(rate: float) -> float:
        return float(np.log(rate * strange + (1 - rate) * plain).sum())

    not_looked_at = log_density(_STRANGE_RATE) - log_density(_OUTLIER_RATE)
    gains = np.logaddexp(math.log(1 - other) + _mean_gain(doubted), math.log(other) + not_looked_at)
    return float(expit(np.array(math.log(_PRIOR / (1 - _PRIOR)) + gains)))


def outliers_left(
    outliers: Array,
    posterior: Posterior,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    *,
    reference: Physics,
) -> Array:
    """Probability of each interaction that it says nothing about the body, shape (k,).

    Args:
        outliers: The same by statics.
        posterior: Of the problem's bodies.
        predictor: Likewise.
        data: What the robot felt.
        noise: How far readings stray.
        reference: The simulator, asked where an interaction is more likely an outlier than not.
    """
    if not np.any(outliers > _MORE_LIKELY):
        return outliers
    samples = posterior.values[systematic(posterior.weights, _SIMULATED, 0.5)]
    bodies = np.vstack([posterior.modes[0].point, samples])
    left: Array = outliers * np.exp(-_amends(bodies, predictor, data, noise, reference))
    return left


def with_consequence(departure: Departure, lengths: Array, believed: Array) -> str:
    """The name of a departure that is left, and what it would mean for the lengths.

    Args:
        departure: How a robot may be built otherwise than the problem says.
        lengths: Of its legs then, m, shape (legs,).
        believed: Of the legs of samples that are built as it says, m, shape (n, legs).
    """
    low, median, high = np.quantile(believed, (0.05, 0.5, 0.95), axis=0)
    change = np.where((lengths < low) | (lengths > high), lengths - median, 0.0)
    most = float(change[np.argmax(np.abs(change))]) if change.size else 0.0
    if abs(most) < _WORTH_SAYING:
        return departure.name
    how = "longer" if most > 0 else "shorter"
    return f"{departure.name} (then legs are up to {1000 * abs(most):.0f} mm {how})"


def clearly_better(doubted: Sequence[Doubt]) -> Departure | None:
    """The departure by which the readings are explained clearly better, if any."""
    best = max(doubted, key=lambda doubt: doubt.clear_gain, default=None)
    if best is not None and best.clear_gain > _CLEARLY_BETTER:
        return best.departure
    best = max(doubted, key=lambda doubt: doubt.gain, default=None)
    return best.departure if best is not None and best.gain > _BETTER_BY_FAR else None


def _without(gains: Array, excused: Array) -> Array:
    """Gains but for what speaks for no departure, shape (k,).

    Where a departure gains nothing the simulator was not asked what its bodies feel.
    """
    left: Array = gains - np.clip(gains, 0.0, np.maximum(excused, 0.0))
    return left


def _to_which_side(point: Array, predictor: Predictor, data: SensorData, noise: Noise) -> Array:
    """What it costs a body, shape (1, size), to fall as was felt and not as statics has it, nats.

    Shape (k,). A departure that turns a fall the other way explains it for nothing: to which side
    a body falls says little of how it is built.
    """
    (misfits,) = Likelihood(data, noise).misfits_of(predictor, point)
    costs: Array = -np.log(LIKELY[misfits[:, ASTRAY].astype(np.intp)])
    return costs


def _mean_gain(doubted: Sequence[Doubt]) -> float:
    """How much better departures explain the readings on average, nats."""
    return float(logsumexp([doubt.log_weight for doubt in doubted]))


def _amends(
    points: Array, predictor: Predictor, data: SensorData, noise: Noise, reference: Physics
) -> Array:
    """How much better the simulator explains interactions than statics does, nats, shape (k,).

    Args:
        points: The best body, which statics speaks of, and samples, shape (n, size). The simulator
            speaks of all of them, weighted as if the interaction had not been learnt from.
        predictor: Statics.
        data: What the robot felt.
        noise: How far readings stray.
        reference: The simulator.
    """
    likelihood = Likelihood(data, noise)
    fits = likelihood.of(likelihood.misfits_of(predictor, points))
    bodies = predictor.unknowns.decode_all(points)
    amends = np.zeros(len(data))
    for turn in np.flatnonzero(likelihood.best()[0] - fits[0] > _POORLY).tolist():
        simulated = simulated_fits(bodies, data[turn : turn + 1], noise, reference)
        average = logsumexp(simulated - fits[:, turn]) - logsumexp(-fits[:, turn])
        amends[turn] = max(0.0, average - fits[0, turn])
    return amends


def _log_shares(points: Array, predictor: Predictor, data: SensorData, noise: Noise) -> Array:
    """Logarithms of the shares of the sizes that explain as much as these do, shape (n,)."""
    precision = Lengths(predictor, data, Likelihood(data, noise)).slopes(points).precision
    shares: Array = 0.5 * np.log(PRIOR * np.linalg.inv(precision)[:, -1, -1])
    return shares
