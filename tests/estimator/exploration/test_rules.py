"""The rule ``disagreement``: it looks for the program about which the models disagree most."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.exploration.rules import Situation, most_disputed_program
from estimator.problem.genome import Genome
from estimator.readings.modalities import MODALITIES
from tests.estimator.model_robot import make_capabilities, make_posterior, make_problem


def situation(modalities: tuple[str, ...], *, alike: bool = False) -> Situation:
    problem, capabilities = make_problem(), make_capabilities()
    size = Genome(problem, problem.base(capabilities)).size
    genes = np.random.default_rng(1).random((30, size))
    if alike:
        genes[:] = genes[0]
    posterior = make_posterior(problem, capabilities, genes, modalities=modalities)
    return Situation(posterior=posterior, rng=np.random.default_rng(3))


def spread(modalities: tuple[str, ...], *, alike: bool = False) -> float:
    """What the rule says of the program that it chose, in standard deviations."""
    reason = most_disputed_program(situation(modalities, alike=alike)).reason
    return float(reason.removeprefix("its models differ by ").split()[0])


@pytest.mark.parametrize("name", list(MODALITIES))
def test_each_modality_alone_tells_models_apart(name: str) -> None:
    assert 0 < spread((name,)) < spread(tuple(MODALITIES))


def test_models_that_are_alike_do_not_disagree() -> None:
    assert spread(tuple(MODALITIES), alike=True) == 0
