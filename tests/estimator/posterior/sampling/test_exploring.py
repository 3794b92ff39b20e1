"""Robots with many legs: while readings cannot tell of all of them, chains only explore."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from estimator.parallel.executors import ThisProcess
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.verdict import Fit
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling import agreement
from estimator.posterior.sampling.sampler import Effort, Sampler
from tests.estimator.exploration.test_few_limbs import genome_of
from tests.estimator.two_unknown_rows import NOISE, draw

SMALL = Effort(levels=4, chains_per_level=16, steps=20, rounds=4)


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor(Unknowns(genome_of("hexapod-12")), StaticsPhysics())


@pytest.fixture(scope="module")
def data(predictor: Predictor) -> SensorData:
    """What a hexapod observed that moved two of its legs."""
    rng = np.random.default_rng(5)
    point = predictor.unknowns.permitted(rng.random((1, predictor.unknowns.size)))[0]
    programs = np.zeros((1, 12))
    programs[0, [0, 6, 3, 9]] = rng.uniform(-0.5, 0.5, 4)
    return draw(predictor, point, programs, rng, outlier=0.0)


def sampler(predictor: Predictor) -> Sampler:
    seeds = np.random.SeedSequence(1).spawn(SMALL.populations + 1)
    return Sampler(predictor.unknowns, StaticsPhysics, NOISE, SMALL, seeds, workers=ThisProcess())


def test_one_reading_of_two_legs_is_explained_and_nothing_is_certain(
    predictor: Predictor, data: SensorData
) -> None:
    posterior = sampler(predictor).learn(data)
    likelihood = Likelihood(data, NOISE)
    misfits = likelihood.misfits_of(predictor, posterior.values)
    explained = likelihood.inlier_share(misfits, scales=posterior.scales)[:, 0] > 0.5
    assert explained.mean() > 0.8  # or it ended beside, as many more bodies do
    assert not predictor.unknowns.forbidden(posterior.values).any()
    assert sum(mode.probability for mode in posterior.modes) == pytest.approx(1.0)
    met_by_both = [mode.probability for mode in posterior.modes if all(mode.found)]
    assert sum(met_by_both) < 0.2
    still = predictor.unknowns.decided(posterior.values)[:, predictor.unknowns.parts[1][0]]
    shares = np.bincount(still, minlength=6) / len(still)
    assert shares.min() > 0.03  # of a leg that did not move hardly anything is known


@pytest.mark.parametrize("explains", [True, False])
def test_chains_begin_anew_where_no_body_explains_the_readings(
    predictor: Predictor, data: SensorData, monkeypatch: pytest.MonkeyPatch, *, explains: bool
) -> None:
    begun: list[Discovery] = []
    monkeypatch.setattr(Discovery, "start_anew", lambda search, steps: begun.append(search))
    monkeypatch.setattr(Discovery, "explains", lambda search: explains)
    sampler(predictor).learn(data)
    assert len(begun) == (0 if explains else 2 * SMALL.populations)  # but for the first of 3 rounds


def test_chains_wander_no_more_once_the_searches_agree(
    predictor: Predictor, data: SensorData, monkeypatch: pytest.MonkeyPatch
) -> None:
    def discovered(*args: object) -> None:
        raise RuntimeError("bodies are searched for")

    monkeypatch.setattr(Sampler, "_discovered", discovered)
    one = sampler(predictor)
    assert one.learn(data).modes
    agreed = predictor.unknowns.keys(np.full((1, predictor.unknowns.size), 0.5))
    one.restore({**one.state(), "agreed_on": agreed})
    with pytest.raises(RuntimeError, match="searched for"):
        one.learn(data)


@pytest.mark.parametrize(("unexplained", "alternatives"), [(0, False), (1, False), (2, True)])
def test_what_the_searches_agree_on_is_doubted_no_more_but_where_it_explains_too_little(
    predictor: Predictor,
    data: SensorData,
    monkeypatch: pytest.MonkeyPatch,
    *,
    unexplained: int,
    alternatives: bool,
) -> None:
    monkeypatch.setattr("estimator.posterior.sampling.sampler._ALIKE", 0.0)  # all is present
    monkeypatch.setattr(agreement, "fit_of", lambda *body: Fit(unexplained=unexplained, excess=0.0))
    monkeypatch.setattr(agreement.Agreement, "coverage", 1.0)
    monkeypatch.setattr(Sampler, "_weighed", lambda sampler, agreed, data: agreed)
    one = sampler(predictor)
    agreed: Any = one.learn(data)
    assert one.state()["agreed_on"] == ([] if alternatives else sorted(agreed.keys))


def test_a_sampler_goes_on_from_its_state(predictor: Predictor, data: SensorData) -> None:
    one, two = sampler(predictor), sampler(predictor)
    one.learn(data)
    state = one.state()
    two.restore(state)
    first, second = one.learn(data), two.learn(data)
    assert np.array_equal(first.values, second.values)
    assert [mode.probability for mode in first.modes] == [mode.probability for mode in second.modes]
