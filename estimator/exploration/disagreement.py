"""The rule ``disagreement``: the program about which the models disagree most."""

from __future__ import annotations

from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.exploration.situation import Choice, Situation
from estimator.posterior.model.sensor_data import DENSITIES
from estimator.readings.modalities.registry import MODALITIES

CANDIDATES: Final = 300
MODELS: Final = 64
_SATURATED: Final = 10.0  # standard deviations: what lies farther apart is no more apart


def most_disputed_program(situation: Situation) -> Choice:
    """Maximises the mean distance between the readings that pairs of models predict.

    Distances are in units of the announced noise and saturate, so that one wild prediction does
    not outweigh many that differ.
    """
    models = situation.posterior.sample(MODELS, situation.rng)
    noise = models.noise
    programs = situation.random_programs(CANDIDATES)
    spread = np.zeros(CANDIDATES)
    for index, program in enumerate(programs):
        readings = models.predict(program)
        columns: list[Array] = []
        for name, density in DENSITIES.items():
            if name in models.modalities:
                values = MODALITIES[name].predicted(readings).T
                columns += list(values / noise.of(name) if density.scaled else _SATURATED * values)
        spread[index] = sum(_mean_distance(values) for values in columns)
    winner = int(np.argmax(spread))
    return Choice(
        program=programs[winner],
        reason=f"its models differ by {spread[winner]:.1f} standard deviations in sum",
    )


def _mean_distance(values: Array) -> float:
    apart = np.abs(values[:, None] - values[None, :])
    return float(np.mean(np.minimum(apart, _SATURATED)))
