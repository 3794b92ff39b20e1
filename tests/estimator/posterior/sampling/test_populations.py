"""Robots with many legs: while readings cannot tell of all of them, chains only explore."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from estimator.executors import ThisProcess
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.verdict import Fit
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling import populations
from estimator.posterior.sampling.populations import Agreement, attachments_found
from estimator.posterior.sampling.sampler import Effort, Sampler
from tests.estimator.exploration.test_few_limbs import genome_of
from tests.estimator.two_unknown_rows import NOISE, POINT, draw, programs


def test_attachments_met_with_lengths_that_explain_nothing_are_not_met(
    predictor: Predictor,
) -> None:
    data = draw(predictor, POINT, programs(4), np.random.default_rng(2))
    likelihood = Likelihood(data, NOISE)
    solver = GaussNewton(predictor, likelihood)
    best, _ = solver.polished(POINT[None])
    elsewhere = best.copy()
    elsewhere[:, predictor.unknowns.continuous] = 0.95
    (key,), (fit,) = predictor.unknowns.keys(best), solver.fits(best)
    for values, found in ((best, {key}), (elsewhere, set())):
        assert attachments_found(values, {key: fit}, solver) == found


def test_attachments_about_as_probable_as_the_leaders_lead_too() -> None:
    agreement = Agreement(
        points=np.zeros((3, 1)),
        keys=[(0,), (1,), (2,)],
        guesses=np.array([-1.0, 0.0, -4.0]),
        found=({(0,), (1,)}, set()),
        fit=Fit(unexplained=0, excess=1.5),
        may_err=True,
    )
    assert agreement.leader == (1,)
    assert agreement.leaders == [(0,), (1,)]
    assert agreement.share_of({(1,)}) == pytest.approx(0.72, abs=0.01)


OPEN, KNOWN = (0,), ()


@pytest.mark.parametrize(
    ("key", "unexplained", "excess", "may_err", "adequate_fit"),
    [
        (OPEN, 0, 0.9, False, True),
        (OPEN, 0, 1.1, False, False),
        (OPEN, 1, 0.0, False, False),
        (OPEN, 1, 0.9, True, True),
        (OPEN, 1, 1.1, True, False),  # an outlier, and the others are explained poorly
        (OPEN, 0, 2.3, True, True),
        (OPEN, 0, 2.4, True, False),
        (OPEN, 2, 0.0, True, False),
        (KNOWN, 0, 2.3, False, True),  # no other body can explain it better
        (KNOWN, 0, 2.4, False, False),
        (KNOWN, 1, 0.0, False, False),
        (KNOWN, 1, 2.3, True, True),
        (KNOWN, 2, 0.0, True, False),
    ],
)
def test_what_explains_the_readings_poorly_is_not_credible(
    key: tuple[int, ...], unexplained: int, excess: float, may_err: bool, adequate_fit: bool
) -> None:
    agreement = Agreement(
        points=np.zeros((1, 1)),
        keys=[key],
        guesses=np.zeros(1),
        found=(),
        fit=Fit(unexplained=unexplained, excess=excess),
        may_err=may_err,
    )
    assert agreement.adequate_fit == adequate_fit


SMALL = Effort(levels=4, chains_per_level=16, steps=20, rounds=4)


@pytest.fixture(scope="module")
def many_legs() -> Predictor:
    return Predictor(Unknowns(genome_of("hexapod-12")), StaticsPhysics())


@pytest.fixture(scope="module")
def data(many_legs: Predictor) -> SensorData:
    """What a hexapod observed that moved two of its legs."""
    rng = np.random.default_rng(5)
    point = many_legs.unknowns.permitted(rng.random((1, many_legs.unknowns.size)))[0]
    programs = np.zeros((1, 12))
    programs[0, [0, 6, 3, 9]] = rng.uniform(-0.5, 0.5, 4)
    return draw(many_legs, point, programs, rng, outlier=0.0)


def sampler(many_legs: Predictor) -> Sampler:
    seeds = np.random.SeedSequence(1).spawn(SMALL.populations + 1)
    return Sampler(many_legs.unknowns, StaticsPhysics, SMALL, seeds, workers=ThisProcess())


def test_one_reading_of_two_legs_is_explained_and_nothing_is_certain(
    many_legs: Predictor, data: SensorData
) -> None:
    posterior = sampler(many_legs).learn(Likelihood(data, NOISE))
    likelihood = Likelihood(data, NOISE)
    misfits = likelihood.misfits_of(many_legs, posterior.values)
    explained = likelihood.inlier_share(misfits, scales=posterior.scales)[:, 0] > 0.5
    assert explained.mean() > 0.8  # or it ended beside, as many more bodies do
    assert not many_legs.unknowns.forbidden(posterior.values).any()
    assert sum(mode.probability for mode in posterior.modes) == pytest.approx(1.0)
    met_by_both = [mode.probability for mode in posterior.modes if all(mode.found)]
    assert sum(met_by_both) < 0.2
    still = many_legs.unknowns.decided(posterior.values)[:, many_legs.unknowns.parts[1][0]]
    shares = np.bincount(still, minlength=6) / len(still)
    assert shares.min() > 0.03  # of a leg that did not move hardly anything is known


@pytest.mark.parametrize(
    ("enough_were_read", "explains", "rounds"),
    [(True, True, 0), (True, False, 2), (False, False, 0)],  # but for the first
)
def test_chains_begin_anew_where_no_body_explains_readings_that_ought_to_tell(
    many_legs: Predictor,
    data: SensorData,
    monkeypatch: pytest.MonkeyPatch,
    *,
    enough_were_read: bool,
    explains: bool,
    rounds: int,
) -> None:
    begun: list[Discovery] = []
    monkeypatch.setattr(many_legs.unknowns, "telling", 2 if enough_were_read else 3)
    monkeypatch.setattr(Discovery, "restart", lambda search, steps: begun.append(search))
    monkeypatch.setattr(Discovery, "explains", lambda search: explains)
    sampler(many_legs).learn(Likelihood(data, NOISE))
    assert len(begun) == rounds * SMALL.populations


def test_chains_wander_no_more_once_the_searches_agree(
    many_legs: Predictor, data: SensorData, monkeypatch: pytest.MonkeyPatch
) -> None:
    def discovered(*args: object, searched: bool) -> None:
        raise RuntimeError("bodies are searched for")

    monkeypatch.setattr(Sampler, "_discovered", discovered)
    one = sampler(many_legs)
    assert one.learn(Likelihood(data, NOISE)).modes
    agreed = many_legs.unknowns.keys(np.full((1, many_legs.unknowns.size), 0.5))
    one.restore({**one.state(), "converged": agreed})
    with pytest.raises(RuntimeError, match="searched for"):
        one.learn(Likelihood(data, NOISE))


@pytest.mark.parametrize(("unexplained", "alternatives"), [(0, False), (1, False), (2, True)])
def test_what_the_searches_agree_on_is_doubted_no_more_but_where_it_explains_too_little(
    many_legs: Predictor,
    data: SensorData,
    monkeypatch: pytest.MonkeyPatch,
    *,
    unexplained: int,
    alternatives: bool,
) -> None:
    monkeypatch.setattr("estimator.posterior.sampling.sampler._EXPLORED", 0.0)  # all is present
    monkeypatch.setattr(
        populations, "fit_of", lambda *body: Fit(unexplained=unexplained, excess=0.0)
    )
    monkeypatch.setattr(populations.Agreement, "coverage", 1.0)
    monkeypatch.setattr(Sampler, "_weighed", lambda sampler, agreed, data: agreed)
    one = sampler(many_legs)
    agreed: Any = one.learn(Likelihood(data, NOISE))
    assert one.state()["converged"] == ([] if alternatives else sorted(agreed.keys))


def test_a_sampler_goes_on_from_its_state(many_legs: Predictor, data: SensorData) -> None:
    one, two = sampler(many_legs), sampler(many_legs)
    one.learn(Likelihood(data, NOISE))
    state = one.state()
    two.restore(state)
    first, second = one.learn(Likelihood(data, NOISE)), two.learn(Likelihood(data, NOISE))
    assert np.array_equal(first.values, second.values)
    assert [mode.probability for mode in first.modes] == [mode.probability for mode in second.modes]
