"""What the family of the noise states of itself, whichever it is."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.stats import kstest

from estimator.body.morphology import Array
from estimator.posterior.model import noise
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise, drawn_scales, log_prior
from estimator.posterior.model.sensor_data import (
    BRANCH,
    COLUMNS,
    MISFITS,
    NO_PREDICTION,
    SensorData,
)
from estimator.readings.observation import Observation

GRID = np.sinh(np.linspace(-20, 20, 400_001))  # dense at 0, and far enough for heavy tails


def log_densities(deviations: Array) -> Array:
    shapes = [noise.log_shape(one) for one in deviations.tolist()]
    return noise.LOG_PEAK + np.array(shapes)


DENSITY = np.exp(log_densities(GRID))


def mean(values: Array) -> float:
    return float(np.trapezoid(values * DENSITY, GRID))


def test_it_adds_up_to_one_and_is_highest_at_nothing() -> None:
    assert mean(np.ones_like(GRID)) == pytest.approx(1.0, abs=1e-8)
    assert noise.log_shape(0.0) == 0.0
    assert noise.log_shape(-1.3) == noise.log_shape(1.3) < 0.0


def test_a_right_body_loses_what_is_said() -> None:
    loss = noise.LOG_PEAK - log_densities(GRID)
    assert mean(loss) == pytest.approx(noise.MEAN_LOSS, abs=1e-6)
    spread = mean(loss**2) - mean(loss) ** 2
    assert spread == pytest.approx(noise.VARIANCE_LOSS, abs=1e-6)


@pytest.mark.parametrize("deviation", [-40.0, -3.0, -0.1, 0.0, 0.5, 4.0, 29.0])
def test_the_tail_is_the_sum_of_the_density_beyond(deviation: float) -> None:
    beyond = np.concatenate([[deviation], GRID[deviation < GRID]])
    logs = log_densities(beyond)
    total = np.log(np.trapezoid(np.exp(logs - logs.max()), beyond)) + logs.max()
    assert noise.log_above(deviation) == pytest.approx(total, rel=1e-4, abs=1e-8)


def test_far_out_the_tail_goes_on_where_it_is_computed_otherwise() -> None:
    near, far = (noise.log_above(deviation) for deviation in (29.999999, 30.000001))
    assert near == pytest.approx(far, abs=1e-4)
    assert math.isfinite(noise.log_above(1e6))


def test_the_tail_of_many_is_the_tail_of_each_where_it_counts() -> None:
    residuals = np.array([-9.0, -0.4, 0.0, 3.0, 29.0])
    tails = [noise.log_above(one) for one in residuals.tolist()]
    assert noise.log_tail(residuals) == pytest.approx(np.array(tails), rel=1e-12, abs=1e-15)
    assert noise.log_tail(np.array([1e6])) == pytest.approx(noise.log_above(noise._FAR))


def test_densities_of_all_pairs_come_of_one_product() -> None:
    read, predicted = np.array([0.3, -1.2]), np.array([0.31, 0.28, -1.0])
    spread = np.array([0.01, 0.02, 0.5])
    product = noise.read_factors(read) @ noise.predicted_factors(predicted, spread).T
    away = (read[:, None] - predicted) / spread
    exact = log_densities(away.ravel()).reshape(2, 3) - np.log(spread)
    assert product == pytest.approx(exact, abs=1e-9)


def test_steps_weigh_a_residual_by_the_slope_there() -> None:
    away = np.array([-7.0, -0.4, 0.3, 2.0, 11.0])
    slope = (log_densities(away + 1e-5) - log_densities(away - 1e-5)) / 2e-5
    assert noise.step_weight(away) == pytest.approx(-slope / away, rel=1e-6)


def test_a_reading_tells_so_much_about_the_logarithm_of_the_noise() -> None:
    slope = 1 - noise.step_weight(GRID) * GRID**2  # of the log-density, and minus it
    assert mean(slope**2) == pytest.approx(noise.SCALE_INFORMATION, abs=1e-6)


def test_draws_are_of_it() -> None:
    draws = noise.drawn((40, 50), np.random.default_rng(5))
    assert draws.shape == (40, 50)
    above = np.vectorize(noise.log_above)
    assert kstest(draws.ravel(), lambda z: 1 - np.exp(above(z))).pvalue > 0.01


NOISE = Noise(tilt=0.01, clearance=0.004)
CAP = 0.2


def readings_of(rng: np.random.Generator, count: int) -> SensorData:
    """Some without a clearance, some beyond the range, some without touch."""
    observations = []
    for _ in range(count):
        beyond = bool(rng.random() < 0.2)
        clearance = CAP if beyond else float(rng.uniform(0, CAP))
        tilt = tuple(rng.normal(0, 0.1, 2).tolist())
        observations.append(
            Observation(
                angles=(0.0,),
                touch=(True, None if rng.random() < 0.3 else False),
                tilt=tilt,
                clearance=None if rng.random() < 0.2 else clearance,
                clearance_saturated=beyond,
            )
        )
    return SensorData.of(observations, ("touch", "tilt", "clearance"), CAP)


def misfits_of(rng: np.random.Generator, points: int, count: int, factor: float) -> Array:
    misfits = np.zeros((points, count, MISFITS))
    strayed = rng.normal(0, factor * NOISE.tilt, (points, count, 2))
    misfits[..., COLUMNS["tilt"]] = strayed
    strays = rng.normal(0, factor * NOISE.clearance, (points, count))
    misfits[..., COLUMNS["clearance"].start] = strays
    misfits[..., COLUMNS["touch"].start] = rng.random((points, count)) < 0.1
    misfits[..., NO_PREDICTION] = rng.random((points, count)) < 0.05
    misfits[..., BRANCH] = np.where(rng.random((points, count)) < 0.1, 2, 0)
    return misfits


@pytest.mark.parametrize("count", [1, 7, 8, 25])
def test_each_pair_of_factors_gives_what_the_mixture_gives(count: int) -> None:
    rng = np.random.default_rng(count)
    likelihood = Likelihood(readings_of(rng, count), NOISE)
    misfits = misfits_of(rng, 3, count, 3.0)
    factors = likelihood.noise_factors
    terms = likelihood.by_noise_factors(misfits) - factors.log_weights
    for node, pair in enumerate(factors.both):
        one_by_one = likelihood.of(misfits, scales=np.tile(pair, (3, 1))).sum(axis=1)
        assert terms[:, node] == pytest.approx(one_by_one, abs=1e-9)


def test_what_is_drawn_has_the_density_of_the_prior_and_is_seldom_quieter() -> None:
    drawn = drawn_scales(20_000, np.random.default_rng(1))
    edges = np.linspace(-0.6, 2.0, 14)
    heights = [
        quad(lambda one: math.exp(log_prior(np.array(one))), *ends)[0] for ends in pairwise(edges)
    ]
    expected = np.array(heights) / sum(heights)
    seen = np.histogram(drawn, edges)[0] / len(drawn)
    assert seen == pytest.approx(expected, abs=0.015)
    assert np.mean(drawn < 0) == pytest.approx(0.15 / 0.65, abs=0.015)


@pytest.mark.parametrize("factor", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("count", [3, 24])
def test_the_integral_over_noise_factors_is_that_of_adaptive_quadrature(
    count: int, factor: float
) -> None:
    rng = np.random.default_rng(round(10 * factor))
    likelihood = Likelihood(readings_of(rng, count), NOISE)
    misfits = misfits_of(rng, 1, count, factor)
    (fit,) = likelihood.integrated(misfits)
    factors = likelihood.noise_factors.both
    log_whole = math.log(quad(lambda scale: math.exp(log_prior(np.array(scale))), -2, 4)[0])
    peak = factors[np.argmax(likelihood.by_noise_factors(misfits)[0])]

    def density(clearance: float, tilt: float) -> float:
        scales = np.array([[tilt, clearance]])
        prior = log_prior(scales).sum() - 2 * log_whole
        return math.exp(likelihood.of(misfits, scales=scales).sum() + prior - fit)

    around = [(float(one) - 1.5, float(one) + 1.5) for one in peak]
    mass = dblquad(density, *around[0], *around[1], epsabs=1e-4, epsrel=1e-4)[0]
    assert mass == pytest.approx(1.0, abs=0.01)
