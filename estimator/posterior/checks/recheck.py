"""The simulator has the last word: samples are reweighted by what it says of them.

Statics finds the posterior; a simulation of some of its samples with a fine time step gives each a
weight, its likelihood there over its likelihood in statics, under the same mixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from estimator.body.morphology import Array, Morphology
from estimator.physics.base import Physics, WorldSettings
from estimator.posterior.model.likelihood import FORKS, Likelihood, Noise, apart
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior

SAMPLES: Final = 16
"""Samples simulated, shared out among the modes by their probability."""

STEP: Final = 1 / 240  # s

_REST_WINDOW: Final = 0.3  # s

_RIVALS: Final = 6
_WORTH: Final = 0.005  # probability of a mode that is simulated
_FEWEST: Final = 3  # samples of a mode


def fine(world: WorldSettings) -> WorldSettings:
    """The world with the fine time step, in which bodies are read when a robot would be."""
    steps = round(world.steps * world.step / STEP)
    return replace(world, step=STEP, steps=steps, rest_window=_REST_WINDOW)


@dataclass(frozen=True, kw_only=True)
class Recheck:
    """What the simulator said.

    Attributes:
        posterior: The posterior with its weights.
        ess: Effective sample size of the simulated samples.
        simulated: How many samples were simulated.
    """

    posterior: Posterior
    ess: float
    simulated: int


def recheck(
    posterior: Posterior,
    predictor: Predictor,
    data: SensorData,
    noise: Noise,
    reference: Physics,
) -> Recheck:
    """Reweights a posterior by a simulator.

    Args:
        posterior: Found with statics.
        predictor: Statics.
        data: The observations.
        noise: Sensor noise.
        reference: The simulator.
    """
    unknowns = predictor.unknowns
    keys = unknowns.keys(posterior.values)
    values, scales, owners = [], [], []
    modes = [mode for mode in posterior.modes[:_RIVALS] if mode.probability >= _WORTH]
    modes = modes or list(posterior.modes[:1])
    for index, mode in enumerate(modes):
        rows = [row for row, key in enumerate(keys) if key == mode.attachments]
        count = max(_FEWEST, round(SAMPLES * mode.probability))
        chosen = rows[:: max(1, len(rows) // count)][:count]
        values.append(posterior.values[chosen] if chosen else mode.point[None])
        scales.append(posterior.scales[chosen] if chosen else np.zeros((1, 2)))
        owners += [index] * max(1, len(chosen))
    points, factors, owner = np.concatenate(values), np.concatenate(scales), np.array(owners)
    likelihood = Likelihood(data, noise)
    known = likelihood.misfits_of(predictor, points)
    by_statics = likelihood.of(known, scales=factors).sum(axis=1)
    interactions = np.tile(np.arange(len(data)), len(points))
    bodies = unknowns.decode_all(points)
    pairs = [(body, program) for body in bodies for program in data.programs]
    misfits = data.misfits(reference.read(pairs), interactions)
    misfits = misfits.reshape(known.shape)
    misfits = np.where(_forks(predictor, points, data, noise)[..., None], known, misfits)
    simulated = likelihood.of(misfits, scales=factors).sum(axis=1)
    ratios = simulated - by_statics
    logs = np.log([mode.probability for mode in modes])
    logs += [
        logsumexp(ratios[owner == index]) - np.log(np.sum(owner == index))
        for index in range(len(modes))
    ]
    probabilities = softmax(logs) * sum(mode.probability for mode in modes)
    weights = softmax(ratios)
    better = [
        replace(
            mode, probability=float(probability), point=_best(points, simulated, owner == index)
        )
        for index, (mode, probability) in enumerate(zip(modes, probabilities, strict=True))
    ]
    others = [mode for mode in posterior.modes if mode not in modes]
    return Recheck(
        posterior=_reweighted(posterior, keys, modes, better, others),
        ess=float(1 / np.sum(weights**2)),
        simulated=len(points),
    )


def simulated_fits(
    bodies: Sequence[Morphology], one: SensorData, noise: Noise, reference: Physics
) -> Array:
    """Log-likelihoods of n bodies in one interaction by the simulator, shape (n,)."""
    readings = reference.read([(body, one.programs[0]) for body in bodies])
    misfits = one.misfits(readings, np.zeros(len(bodies), dtype=np.intp))
    fits: Array = Likelihood(one, noise).of(misfits[:, None])[:, 0]
    return fits


def _best(points: Array, fits: Array, chosen: Array) -> Array:
    rows = np.flatnonzero(chosen)
    best: Array = points[rows[np.argmax(fits[rows])]]
    return best


def _reweighted(
    posterior: Posterior,
    keys: Sequence[tuple[int, ...]],
    before: Sequence[Mode],
    after: Sequence[Mode],
    others: Sequence[Mode],
) -> Posterior:
    factor = {
        one.attachments: new.probability / one.probability
        for one, new in zip(before, after, strict=True)
    }
    weights = posterior.weights * np.array([factor.get(key, 1.0) for key in keys])
    return replace(
        posterior,
        weights=weights / weights.sum(),
        modes=tuple(sorted([*after, *others], key=lambda mode: -mode.probability)),
    )


def _forks(predictor: Predictor, points: Array, data: SensorData, noise: Noise) -> Array:
    """Where a trifle decides to which side a body falls, so that no simulation tells, (n, k)."""
    plumb = predictor.read_all(points, data.programs)
    forks = np.zeros(len(plumb), dtype=bool)
    for lean in FORKS:
        forks |= apart(plumb, predictor.read_all(points, data.programs, lean), noise)
    return forks.reshape(len(points), len(data))
