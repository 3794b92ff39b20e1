"""What is stated of a posterior: of attachments that feel alike none is the right one alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.arrays import Flags
from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior, systematic
from estimator.posterior.summary import SAMPLES, information_gained, summarise
from estimator.readings.observation import Observation
from estimator.storage.posteriors import NotKnown, StoredPosterior
from tests.estimator.exploration.test_few_limbs import genome_of
from tests.estimator.two_unknown_rows import CAP, NOISE, POINT, draw, equally_likely, programs

COUNT = 40


def posterior(found: Callable[[int], tuple[bool, ...]]) -> Posterior:
    """Many sets of attachments, each as probable as the others."""
    alone = equally_likely(np.tile(POINT, (8, 1)), POINT)
    modes = tuple(Mode((number,), 1 / COUNT, POINT, 50.0, found(number)) for number in range(COUNT))
    return replace(alone, modes=modes)


def summarised(
    predictor: Predictor, one: Posterior, *, alike: bool, movements: int = 3
) -> StoredPosterior:
    data = draw(predictor, POINT, programs(movements), np.random.default_rng(2))

    def same(ones: Array, others: Array) -> Flags:
        return np.full(len(ones), alike)

    return summarise(one, predictor, Likelihood(data, NOISE), same)


def stated(predictor: Predictor, one: Posterior, *, alike: bool) -> float | None:
    return summarised(predictor, one, alike=alike).probability


def test_all_that_feel_alike_count_together(predictor: Predictor) -> None:
    everything = posterior(lambda number: (True, True))
    assert stated(predictor, everything, alike=True) == pytest.approx(1.0)
    assert stated(predictor, everything, alike=False) == pytest.approx(1 / COUNT)


def test_it_makes_no_difference_which_of_them_a_population_has_met(predictor: Predictor) -> None:
    in_turns = posterior(lambda number: (number % 2 == 0, number % 2 == 1))
    assert stated(predictor, in_turns, alike=True) == pytest.approx(1.0)


def test_where_the_populations_have_met_different_bodies_nothing_is_stated(
    predictor: Predictor,
) -> None:
    in_turns = posterior(lambda number: (number % 2 == 0, number % 2 == 1))
    by_one = posterior(lambda number: (True, False))
    for one, alike in ((in_turns, False), (by_one, True)):
        belief = summarised(predictor, one, alike=alike)
        assert belief.coverage == 0.0
        assert belief.probability is None
        assert belief.not_known is NotKnown.DIFFERENT_BODIES


def test_a_small_probability_is_stated_where_little_was_coverage(predictor: Predictor) -> None:
    few = posterior(lambda number: (number < 28, number >= 16))
    belief = summarised(predictor, few, alike=False)
    assert 1 / COUNT < belief.coverage < 0.9
    assert belief.probability == pytest.approx(1 / COUNT)
    agreeing = belief.model_copy(update={"coverage": 0.6, "probability_within_problem": 0.6})
    assert agreeing.probability == 0.6


def test_of_what_explains_the_readings_poorly_nothing_is_stated(predictor: Predictor) -> None:
    poor = replace(posterior(lambda number: (True, True)), adequate_fit=False)
    belief = summarised(predictor, poor, alike=True)
    assert belief.probability is None
    assert belief.not_known is NotKnown.POOR_FIT


def test_of_what_few_samples_stand_for_only_that_it_is_improbable_is_stated(
    predictor: Predictor,
) -> None:
    everything = posterior(lambda number: (True, True))
    few = tuple(replace(mode, ess=4.0) for mode in everything.modes)
    others = tuple(replace(mode, probability=0.1 / (COUNT - 1)) for mode in few[1:])
    one = replace(everything, modes=(replace(few[0], probability=0.9), *others))
    belief = summarised(predictor, one, alike=True)
    assert belief.probability is None
    assert belief.not_known is NotKnown.FEW_SAMPLES
    improbable = summarised(predictor, replace(everything, modes=few), alike=False)
    assert improbable.probability == pytest.approx(1 / COUNT)


def test_of_what_few_movements_say_only_that_it_is_improbable_is_stated(
    predictor: Predictor,
) -> None:
    assert predictor.unknowns.telling == 2  # of 9.2 bits
    everything = posterior(lambda number: (True, True))
    early = summarised(predictor, everything, alike=True, movements=1)
    assert early.probability is None
    assert early.not_known is NotKnown.FEW_MOVEMENTS
    assert stated(predictor, everything, alike=True) is not None
    improbable = summarised(predictor, everything, alike=False, movements=1)
    assert improbable.probability == pytest.approx(1 / COUNT)


def test_few_samples_each_of_many_that_feel_alike_are_not_few(predictor: Predictor) -> None:
    everything = posterior(lambda number: (True, True))
    few = tuple(replace(mode, ess=4.0) for mode in everything.modes)
    assert stated(predictor, replace(everything, modes=few), alike=True) == pytest.approx(1.0)


def test_known_attachments_need_no_draws(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch
) -> None:
    everything = posterior(lambda number: (True, True))
    only = replace(everything.modes[0], probability=1.0, ess=4.0)
    assert stated(predictor, replace(everything, modes=(only,)), alike=True) is None
    monkeypatch.setattr(predictor.unknowns, "choices", np.array([], dtype=np.intp))
    assert stated(predictor, replace(everything, modes=(only,)), alike=True) == 1.0


def test_the_best_bodys_legs_are_as_long_as_the_middle_of_the_samples_legs() -> None:
    predictor = Predictor(Unknowns(genome_of("parametric")), StaticsPhysics())
    rng = np.random.default_rng(4)
    values = rng.random((201, predictor.unknowns.size)) ** 2  # medians do not add up
    observed = draw(predictor, values[0], rng.uniform(-0.5, 0.5, (2, 4)), rng)
    alone = equally_likely(values, values[0])
    belief = summarise(
        alone,
        predictor,
        Likelihood(observed, NOISE),
        lambda ones, _: np.ones(len(ones), dtype=bool),
    )
    samples, best = (
        leg_lengths(predictor.unknowns.decode_all(genes))
        for genes in (values, np.array([belief.best]))
    )
    assert np.allclose(best[0], np.median(samples, axis=0))


def test_of_what_was_not_read_or_does_not_count_there_is_no_residual(predictor: Predictor) -> None:
    first, second = map(tuple, programs(2).tolist())
    seen = [
        Observation(angles=first, touch=(None,) * 4, tilt=(0.1, None), clearance=0.05),
        Observation(angles=second, touch=(True, None, False, None), clearance=0.05),
    ]
    belief = summarise(
        posterior(lambda number: (True, True)),
        predictor,
        Likelihood(SensorData.of(seen, ("touch", "tilt"), CAP), NOISE),
        lambda ones, _: np.ones(len(ones), dtype=bool),
    )
    assert [set(one.residuals) for one in belief.predicted] == [{"tilt"}, {"touch"}]


LEFT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
BACK = np.array([0.9, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


def belief(*points: Array, of: int) -> Posterior:
    """Equally many samples of some bodies."""
    values = np.repeat(np.stack(points), of // len(points), axis=0)
    scales, weights = np.zeros((len(values), 2)), np.full(len(values), 1 / len(values))
    return Posterior(values=values, scales=scales, weights=weights, modes=(), adequate_fit=True)


def gained(predictor: Predictor, before: Posterior, after: Posterior) -> float:
    moved = programs(1, seed=3)  # lifts the body
    data = draw(predictor, LEFT, moved, np.random.default_rng(2), outlier=0.0)
    return information_gained(before, after, predictor, Likelihood(data, NOISE))


def test_one_of_two_bodies_that_feel_quite_differently_is_one_bit(predictor: Predictor) -> None:
    found = gained(predictor, belief(LEFT, BACK, of=400), belief(LEFT, of=10))
    assert found == pytest.approx(1.0, abs=0.02)


def test_what_was_known_before_tells_nothing(predictor: Predictor) -> None:
    same = belief(LEFT, of=400)
    assert gained(predictor, same, same) == pytest.approx(0.0, abs=1e-9)


def test_a_body_that_no_sample_came_near_is_as_much_as_can_be_told(predictor: Predictor) -> None:
    found = gained(predictor, belief(BACK, of=400), belief(LEFT, of=10))
    assert found == pytest.approx(np.log2(SAMPLES), abs=0.1)


def test_samples_come_as_often_as_their_weights_say() -> None:
    weights = np.array([0.5, 0.25, 0.125, 0.125])
    assert systematic(weights, 4, 0.5).tolist() == [0, 0, 1, 3]
    counts = [
        np.bincount(systematic(weights, 4, start), minlength=4) for start in np.arange(0, 1, 0.01)
    ]
    assert np.mean(counts, axis=0) / 4 == pytest.approx(weights)
    even = np.full(300, 1 / 300)
    assert np.unique(systematic(even, 200, 0.3)).size == 200
