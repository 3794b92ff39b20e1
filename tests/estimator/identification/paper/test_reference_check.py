"""The reference back-end's last word on the leading models."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from estimator.body.limbs import driven_limbs
from estimator.identification.paper.objectives import LargestError
from estimator.identification.paper.reference_check import (
    LEADERS,
    SAME_LENGTH,
    finish,
    leading,
    pairs_turned,
)
from estimator.physics.base import Pair, Physics
from estimator.posterior.fitted import FittedPosterior
from estimator.problem.genome import Genome
from estimator.readings.observation import PredictedReadings
from estimator.report.plots import with_last_word
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.records import Finish
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import make_capabilities, make_problem


@pytest.fixture
def genome() -> Genome:
    problem = make_problem()
    return Genome(problem, problem.base(make_capabilities()))


class Sceptic(Physics):
    """Believes no body whose first leg is longer than a limit, m."""

    def __init__(self, limit: float):
        super().__init__()
        self._limit = limit

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        self.simulations += len(pairs)
        self.steps += 300 * len(pairs)
        readings = PredictedReadings.empty(len(pairs), 4)
        readings.valid[:] = [body.parts[0].length <= self._limit for body, _ in pairs]
        return readings


def test_leaders_are_the_best_that_differ_and_can_be_believed(genome: Genome) -> None:
    step = SAME_LENGTH / 0.2  # of a gene, for the range of 0.2 m
    rows = [0.5, 0.5 + 0.9 * step, 0.5 + 2.0 * step, 0.1, 0.9]
    population = np.array([[0.5, 0.5, 0.5, gene] for gene in rows])
    errors = np.array([2.0, 1.0, 5.0, 3.0, math.inf])
    assert leading(genome, population, errors) == [1, 3, 2]  # 0 is much like 1
    many = np.linspace(0, 1, 30)[:, None] * np.ones(4)
    assert leading(genome, many, np.arange(30.0)) == list(range(LEADERS))
    assert leading(genome, many, np.full(30, math.inf)) == []


def test_what_cannot_be_believed_comes_last_of_the_leaders_and_is_counted(
    tmp_path: Path, genome: Genome
) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))  # and another, of 0.05 each
    with store:
        before = FittedPosterior.of(store)
        assert before is not None
        assert before.searched is not None
        assert before.ranked.tolist() == [1, 0]
        found = finish(
            genome,
            before.samples,
            before.searched,
            observations=store.observations(),
            modalities=("touch", "tilt"),
            physics=Sceptic(0.1),
            objective=LargestError(),
        )
        assert found.models == (1, 0)
        assert found.simulated[0] == math.inf
        assert (found.simulations, found.invalid, found.steps) == (2, 1, 600)
        store.search_end.save_finish(found)
        assert store.search_end.finish() == found
        after = FittedPosterior.of(store)
        assert after is not None
        assert after.ranked.tolist() == [0, 1]
        result = write_report(store)
    assert [model.sensor_error is None for model in result.best_models] == [False, True]
    assert (result.simulations_invalid, result.simulations_run) == (1, 2)
    assert result.finish is not None
    assert result.finish.best_changed
    text = (store.directory / "result.json").read_text()
    assert Result.model_validate_json(text) == result


def test_pairs_on_whose_order_the_two_disagree() -> None:
    found = Finish(
        models=(4, 2, 7),
        searched=(1.0, 2.0, 3.0),
        simulated=(1.5, math.inf, 1.2),
        simulations=3,
        steps=9,
    )
    assert pairs_turned(found) == (2, 3)


def test_plots_end_where_the_tables_do(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.2, 0.16))
    with store:
        assert with_last_word(store) == store.generations()
        store.search_end.save_finish(
            Finish(models=(1, 0), searched=(1.0, 2.0), simulated=(4.0, 3.0), simulations=2, steps=9)
        )
        *searched, word = with_last_word(store)
        result = write_report(store, plots=False)
    assert (len(searched), word.number, word.iteration) == (1, 1, 1)
    assert min(word.errors) == result.sensor_error == 3.0
    genome = store.genome
    lengths = [limb.length for limb in driven_limbs(genome.decode(np.array(word.best)))]
    assert tuple(lengths) == result.best_models[0].leg_lengths_m
