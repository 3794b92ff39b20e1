from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.posterior.checks.verdict import (
    fit_of,
    judge,
    judge_body,
    standardised_residuals,
)
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Posterior
from estimator.storage.posteriors import FitVerdict
from tests.estimator.two_unknown_rows import NOISE, POINT, draw, equally_likely, programs

MOVED = programs(6, seed=4)
EXPLAINED = FitVerdict(unexplained=(), noisy=(), contradicting=())


def certain(scale: float = 0.0) -> Posterior:
    return equally_likely(np.tile(POINT, (30, 1)), POINT, (scale, scale))


def test_what_the_body_felt_is_explained(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    verdict = judge(certain(), predictor, Likelihood(data, NOISE))
    assert verdict == judge_body(POINT, predictor, Likelihood(data, NOISE)) == EXPLAINED
    assert fit_of(POINT, predictor, Likelihood(data, NOISE)).unexplained == 0


def test_samples_that_weigh_nothing_have_no_say(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    for interaction in (1, 4):
        data.observed["tilt"].values[interaction] += 0.3
    scales = np.zeros((100, 2))
    scales[1:] = 4.0  # so noisy that anything is explained
    posterior = replace(
        certain(),
        values=np.tile(POINT, (100, 1)),
        scales=scales,
        weights=np.append(0.999, np.full(99, 0.001 / 99)),
    )
    verdict = judge(posterior, predictor, Likelihood(data, NOISE))
    assert [item.interaction for item in verdict.unexplained] == [1, 4]
    assert not verdict.noisy


def test_two_interactions_that_no_body_explains_are_named_with_their_sensors(
    predictor: Predictor,
) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    for interaction in (1, 4):
        data.observed["tilt"].values[interaction] += 0.3
    for verdict in (
        judge(certain(), predictor, Likelihood(data, NOISE)),
        judge_body(POINT, predictor, Likelihood(data, NOISE)),
    ):
        assert [(item.interaction, item.sensors) for item in verdict.unexplained] == [
            (1, ("tilt",)),
            (4, ("tilt",)),
        ]
    assert fit_of(POINT, predictor, Likelihood(data, NOISE)).unexplained == 2


def test_one_body_is_told_to_need_too_much_noise(predictor: Predictor) -> None:
    movements = programs(20, seed=4)
    for factor, noisy in ((1.0, ()), (4.0, ("tilt",))):
        rng, scales = np.random.default_rng(11), (np.log(factor), 0.0)
        data = draw(predictor, POINT, movements, rng, scales=scales, outlier=0.0)
        verdict = judge_body(POINT, predictor, Likelihood(data, NOISE))
        assert verdict.noisy == noisy
        assert len(verdict.unexplained) <= 1


def test_a_body_from_which_much_strays_a_little_fits_poorly(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    assert fit_of(POINT, predictor, Likelihood(data, NOISE)).excess < 1.0
    for interaction, sign in enumerate((1, -1, 1, -1)):
        data.observed["tilt"].values[interaction] += sign * 1.5 * NOISE.tilt
    fit = fit_of(POINT, predictor, Likelihood(data, NOISE))
    assert fit.excess > 1.0
    assert fit.unexplained == 0


def test_one_such_interaction_is_named_alone(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    data.observed["tilt"].values[2] += 0.3
    verdict = judge(certain(), predictor, Likelihood(data, NOISE))
    assert [item.interaction for item in verdict.unexplained] == [2]
    (one,), (noisier,) = (
        verdict.unexplained,
        judge(certain(0.5), predictor, Likelihood(data, NOISE)).unexplained,
    )
    assert one.residual == pytest.approx(0.3 / NOISE.tilt, abs=3)
    assert noisier.residual == pytest.approx(one.residual / np.exp(0.5))
    # be it as probable as an outlier as any: so far off it is none
    assert not verdict.has_only_outliers(len(MOVED))
    assert not verdict.noisy
    assert not verdict.contradicting


@pytest.mark.parametrize(("near_forks", "unexplained"), [(1, [2]), (3, [])])
def test_where_some_of_the_bodies_that_are_left_may_fall_elsewhere_nothing_is_unexplained(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch, near_forks: int, unexplained: list[int]
) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    data.observed["tilt"].values[2] += 0.3
    monkeypatch.setattr(
        predictor, "margins", lambda bodies, rows, _: np.where(rows < near_forks, 0.001, 0.3)
    )
    verdict = judge(certain(), predictor, Likelihood(data, NOISE))
    assert [one.interaction for one in verdict.unexplained] == unexplained


def test_where_every_interaction_is_an_outlier_no_touch_sensor_is_blamed(
    predictor: Predictor,
) -> None:
    data = draw(predictor, POINT, MOVED[:1], np.random.default_rng(11), outlier=0.0)
    data.observed["tilt"].values[0] += 0.3
    assert judge(certain(), predictor, Likelihood(data, NOISE)).contradicting == ()


def test_a_sensor_that_is_surely_noisier_than_announced_is_named(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    verdict = judge(certain(scale=1.0), predictor, Likelihood(data, NOISE))
    assert verdict.noisy == ("tilt", "clearance")


def test_a_touch_sensor_that_contradicts_the_body_again_and_again_is_named(
    predictor: Predictor,
) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    observed = predictor.read_all(POINT[None], MOVED).touch[:, 1]
    data.observed["touch"].values[:, 1] = observed
    for interaction in (0, 3):
        data.observed["touch"].values[interaction, 1] = not observed[interaction]
    assert judge(certain(), predictor, Likelihood(data, NOISE)) == EXPLAINED
    data.observed["touch"].values[5, 1] = not observed[5]
    verdict = judge(certain(), predictor, Likelihood(data, NOISE))
    assert verdict.contradicting == (1,)


def test_deviations_are_in_units_of_the_noise(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    before = standardised_residuals(POINT[None], predictor, Likelihood(data, NOISE))
    data.observed["clearance"].values[0] += 5 * NOISE.clearance
    data.observed["tilt"].values[1, 0] += 40 * NOISE.tilt
    after = standardised_residuals(POINT[None], predictor, Likelihood(data, NOISE))
    assert after["clearance"][0] - before["clearance"][0] == pytest.approx(5)
    assert abs(after["tilt"][1]) > 30
