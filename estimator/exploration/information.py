"""The rule ``information``: the program that is expected to tell most about the body."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.exploration.choosing import Chooser
from estimator.exploration.information_gain import InformationGain
from estimator.exploration.situation import Choice, Situation
from estimator.parallel.executors import Threads
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.information import SAMPLES
from estimator.posterior.model.deviations import Alternative

_WORTH_SAYING: Final = 0.25  # bits about one trait
_SAID: Final = 2


def most_informative_program(situation: Situation) -> Choice:
    """Maximises the expected information gain under the models' own likelihood."""
    models = situation.posterior.sample(SAMPLES, situation.rng)
    with Threads(situation.jobs) as threads:
        gain = InformationGain(models.noise, models.clearance_cap, models.modalities, threads)
        chosen = Chooser(models.predictor, gain, models.program_range).choose(
            models.posterior, models.alternatives, len(models.observations), situation.rng
        )
    return Choice(
        program=tuple(chosen.program.tolist()),
        reason="; ".join([_reason(models, chosen.about), *_tests(chosen.tests)]),
        bits=chosen.bits,
    )


def _reason(models: FittedPosterior, about: Array) -> str:
    """What the program tells apart, in words."""
    order = np.argsort(-about, kind="stable")
    named = [column for column in order.tolist() if about[column] >= _WORTH_SAYING][:_SAID]
    parts = [_alternatives(models, column) for column in named]
    return f"tells apart: {'; '.join(parts)}" if parts else "narrows what is known already"


def _tests(alternatives: Sequence[Alternative]) -> list[str]:
    """What else the program would show: how the robot may deviate from the problem."""
    if not alternatives:
        return []
    most = alternatives[0].deviation.name
    return [
        f"tests {most}" + (f" and {len(alternatives) - 1} more" if len(alternatives) > 1 else "")
    ]


def _alternatives(models: FittedPosterior, column: int) -> str:
    genome, gene = models.genome, models.genome.genes[column]
    if gene.choices:
        likely = Counter(genome.words(column, models.samples)).most_common(2)
        return f"{gene.name} ({' or '.join(word for word, _ in likely)})"
    ends = np.quantile(models.samples[:, column], (0.05, 0.95))
    low, high = genome.quantities(column, ends).tolist()
    digits = 0 if gene.trait == "length" else 1
    return f"{gene.name} ({low:.{digits}f} to {high:.{digits}f} {gene.unit})"
