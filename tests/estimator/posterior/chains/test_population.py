from __future__ import annotations

import json

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.posterior.chains.population import HOTTEST, Population
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.noise_factors import drawn_scales
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from estimator.readings.observation import Observation
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, draw, programs

POOR = Noise(tilt=0.2, clearance=0.05, touch=0.25, outlier=0.3, nearby=1e-6)


def test_without_readings_the_chains_stay_with_the_prior(predictor: Predictor) -> None:
    from scipy import stats  # takes a second, which other tests need not wait for

    nothing = Observation(angles=(0.1, 0.2, 0.0, 0.0), touch=(None,) * 4)
    blind = SensorData.of([nothing], MODALITIES, CAP)
    population = Population.of_prior(predictor, np.random.default_rng(1), levels=4, width=32)
    population.observe(blind, NOISE, surely=True)
    values, scales = [], []
    for _ in range(12):
        for _ in range(15):
            population.step()
        values.append(population.values.copy())
        scales.append(population.scales.copy())
    pooled = np.concatenate(values)
    for column in range(pooled.shape[1]):
        assert stats.kstest(pooled[:, column], "uniform").pvalue > 1e-4
    drawn = drawn_scales((5000, 2), np.random.default_rng(2))
    assert stats.ks_2samp(np.concatenate(scales).ravel(), drawn.ravel()).statistic < 0.06


def test_the_joint_distribution_is_left_alone(short: Predictor) -> None:
    """Geweke: bodies from the prior, readings from the model, some steps: still the prior.

    Every chain begins with an exact draw from its level's target, by enumeration, so any bias comes
    from the steps. Fits that grew or shrank show what marginals do not.
    """
    values, scales, gains = [], [], []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        population = Population.of_prior(short, rng, levels=3, width=4)
        own = (population.values[0], programs(2, seed=8), rng)
        data = draw(short, *own, scales=population.scales[0])
        start_exactly(population, short, data, rng)
        gains.append(gain(population, short, data, NOISE, surely=True))
        values.append(population.values[0])
        scales.append(population.scales[0])
    still_the_prior(short, values, scales, gains)


def gain(
    population: Population, predictor: Predictor, data: SensorData, noise: Noise, *, surely: bool
) -> float:
    """Takes 20 steps; by how much the coldest level's log-likelihoods grow in the mean."""
    likelihood, cold = Likelihood(data, noise), slice(0, population.width)

    def fits() -> Array:
        misfits = likelihood.misfits_of(predictor, population.values[cold], surely=surely)
        each: Array = likelihood.of(misfits, scales=population.scales[cold]).sum(axis=1)
        return each

    population.observe(data, noise, surely=surely)
    before = fits()
    for _ in range(20):
        population.step()
    return float(np.mean(fits() - before))


def still_the_prior(
    predictor: Predictor, values: list[Array], scales: list[Array], gains: list[float]
) -> None:
    """Refuses marginals that are not the prior's, and fits that grew or shrank."""
    from scipy import stats  # takes a second, which other tests need not wait for

    chosen = predictor.unknowns.attachments(np.array(values))
    for column, count in enumerate((4, 6, 2, 4, 6)):
        seen = np.bincount(chosen[:, column], minlength=count)
        assert stats.chisquare(seen).pvalue > 1e-3
    for length in np.array(values)[:, predictor.unknowns.continuous].T:
        assert stats.kstest(length, "uniform").pvalue > 1e-3
    prior = drawn_scales(20_000, np.random.default_rng(0))
    for factors in np.array(scales).T:
        assert stats.ks_2samp(factors, prior).pvalue > 1e-3
    assert stats.wilcoxon(gains).pvalue > 1e-3


def test_the_joint_distribution_is_left_alone_where_lengths_are_open(narrow: Predictor) -> None:
    """The same with chains that are samples, fall to either side, and move lengths too.

    Readings are so poor that draws from the prior, weighed, stand for every chain's target.
    """
    values, scales, gains = [], [], []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        population = Population.of_prior(narrow, rng, levels=1, width=8)
        own = (population.values[0], programs(3, seed=8), rng)
        data = draw(narrow, *own, scales=population.scales[0], outlier=0.3, noise=POOR)
        weigh_prior(population, narrow, data, rng)
        gains.append(gain(population, narrow, data, POOR, surely=False))
        values.append(population.values[0])
        scales.append(population.scales[0])
    still_the_prior(narrow, values, scales, gains)


def weigh_prior(
    population: Population, predictor: Predictor, data: SensorData, rng: np.random.Generator
) -> None:
    """Draws every chain but the first, which the readings came from, from weighed prior draws."""
    points = rng.random((1500, predictor.unknowns.size))
    scales = drawn_scales((len(points), 2), rng)
    likelihood = Likelihood(data, POOR)
    misfits = likelihood.misfits_of(predictor, points)
    logs = likelihood.of(misfits, scales=scales).sum(axis=1)
    shares = np.exp(logs - logs.max())
    assert shares.sum() ** 2 / np.sum(shares**2) > 8
    rows = rng.choice(len(points), len(population.values) - 1, p=shares / shares.sum())
    population.values[1:], population.scales[1:] = points[rows], scales[rows]


def test_proposals_that_are_given_up_early_would_have_been_refused(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = draw(predictor, np.full(7, 0.4), programs(6), np.random.default_rng(1))

    def after_steps() -> tuple[Population, int]:
        population = Population.of_prior(predictor, np.random.default_rng(3), levels=4, width=8)
        population.observe(data, NOISE, surely=True)
        before = predictor.spared
        for _ in range(20):
            population.step()
        return population, predictor.spared - before

    def hopeful(likelihood: Likelihood, width: Array, scales: Array) -> Array:
        """Gives no proposal up before all of it is known."""
        del likelihood, scales
        return np.full((len(width), len(data)), 1e9)

    early, spared = after_steps()
    monkeypatch.setattr(Likelihood, "best", hopeful)
    patient, none_spared = after_steps()
    assert np.array_equal(early.values, patient.values)
    assert np.array_equal(early.scales, patient.scales)
    assert spared > none_spared == 0


def start_exactly(
    population: Population, predictor: Predictor, data: SensorData, rng: np.random.Generator
) -> None:
    """Draws every chain but the first, which the readings came from, from its own target."""
    counts = np.array((4, 6, 2, 4, 6))
    keys = np.array(list(np.ndindex(*counts)))
    every = (keys + 0.5) / counts
    likelihood = Likelihood(data, NOISE)
    misfits = likelihood.misfits_of(predictor, every, surely=True)
    widths = np.repeat(HOTTEST ** np.linspace(0, 1, population.levels), population.width)
    tried = 25
    each = np.tile(misfits, (tried, 1, 1))
    for chain in range(1, len(population.values)):
        factors = drawn_scales((tried, 2), rng)
        scales = np.repeat(factors, len(every), axis=0)
        logs = likelihood.of(each, np.full(len(each), widths[chain]), scales).sum(axis=1)
        which = int(np.argmax(logs + rng.gumbel(size=logs.size)))
        factor, body = divmod(which, len(every))
        population.scales[chain] = factors[factor]
        population.values[chain] = (keys[body] + rng.random(counts.size)) / counts


def test_a_population_goes_on_as_if_it_had_not_been_put_away(predictor: Predictor) -> None:
    data = draw(predictor, np.full(7, 0.4), programs(2), np.random.default_rng(1))
    population = Population.of_prior(predictor, np.random.default_rng(3), levels=4, width=8)
    population.observe(data, NOISE, surely=True)
    population.step()
    copy = Population.from_state(json.loads(json.dumps(population.state())), predictor)
    copy.observe(data, NOISE, surely=True)
    for one in (population, copy):
        one.step()
    assert np.array_equal(copy.values, population.values)
    assert np.array_equal(copy.scales, population.scales)
