"""What the family of the noise states of itself, whichever it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import kstest

from estimator.body.morphology import Array
from estimator.posterior.model import noise_family

GRID = np.sinh(np.linspace(-20, 20, 400_001))  # dense at 0, and far enough for heavy tails


def log_densities(deviations: Array) -> Array:
    shapes = [noise_family.log_shape(one) for one in deviations.tolist()]
    return noise_family.LOG_PEAK + np.array(shapes)


DENSITY = np.exp(log_densities(GRID))


def mean(values: Array) -> float:
    return float(np.trapezoid(values * DENSITY, GRID))


def test_it_adds_up_to_one_and_is_highest_at_nothing() -> None:
    assert mean(np.ones_like(GRID)) == pytest.approx(1.0, abs=1e-8)
    assert noise_family.log_shape(0.0) == 0.0
    assert noise_family.log_shape(-1.3) == noise_family.log_shape(1.3) < 0.0


def test_a_right_body_loses_what_is_said() -> None:
    loss = noise_family.LOG_PEAK - log_densities(GRID)
    assert mean(loss) == pytest.approx(noise_family.MEAN_LOSS, abs=1e-6)
    spread = mean(loss**2) - mean(loss) ** 2
    assert spread == pytest.approx(noise_family.VARIANCE_LOSS, abs=1e-6)


@pytest.mark.parametrize("deviation", [-40.0, -3.0, -0.1, 0.0, 0.5, 4.0, 29.0])
def test_the_tail_is_the_sum_of_the_density_beyond(deviation: float) -> None:
    beyond = np.concatenate([[deviation], GRID[deviation < GRID]])
    logs = log_densities(beyond)
    total = np.log(np.trapezoid(np.exp(logs - logs.max()), beyond)) + logs.max()
    assert noise_family.log_above(deviation) == pytest.approx(total, rel=1e-4, abs=1e-8)


def test_far_out_the_tail_goes_on_where_it_is_computed_otherwise() -> None:
    near, far = (noise_family.log_above(deviation) for deviation in (29.999999, 30.000001))
    assert near == pytest.approx(far, abs=1e-4)
    assert math.isfinite(noise_family.log_above(1e6))


def test_steps_weigh_a_residual_by_the_slope_there() -> None:
    away = np.array([-7.0, -0.4, 0.3, 2.0, 11.0])
    slope = (log_densities(away + 1e-5) - log_densities(away - 1e-5)) / 2e-5
    assert noise_family.step_weight(away) == pytest.approx(-slope / away, rel=1e-6)


def test_a_reading_tells_so_much_about_the_logarithm_of_the_noise() -> None:
    slope = 1 - noise_family.step_weight(GRID) * GRID**2  # of the log-density, and minus it
    assert mean(slope**2) == pytest.approx(noise_family.SCALE_INFORMATION, abs=1e-6)


def test_draws_are_of_it() -> None:
    draws = noise_family.drawn((40, 50), np.random.default_rng(5))
    assert draws.shape == (40, 50)
    above = np.vectorize(noise_family.log_above)
    assert kstest(draws.ravel(), lambda z: 1 - np.exp(above(z))).pvalue > 0.01
