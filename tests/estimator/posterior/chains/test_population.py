from __future__ import annotations

import json

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.posterior.chains.population import HOTTEST, Population
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import SCALE_SPREAD, Predictor
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
    assert float(np.std(np.concatenate(scales))) == pytest.approx(SCALE_SPREAD, rel=0.1)


def test_the_joint_distribution_is_left_alone(short: Predictor) -> None:
    """Geweke: bodies from the prior, readings from the model, some steps: still the prior.

    Every chain begins with an exact draw from its level's target, by enumeration, so any bias comes
    from the steps. Fits that grew or shrank show what marginals do not.
    """
    from scipy import stats  # takes a second, which other tests need not wait for

    moved = programs(2, seed=8)
    chains, scales, gains = [], [], []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        population = Population.of_prior(short, rng, levels=3, width=4)
        data = draw(short, population.values[0], moved, rng, scales=population.scales[0])
        start_exactly(population, short, data, rng)
        population.observe(data, NOISE, surely=True)
        likelihood = Likelihood(data, NOISE)
        before = cold_fits(population, short, likelihood, surely=True)
        for _ in range(20):
            population.step()
        after = cold_fits(population, short, likelihood, surely=True)
        gains.append(float(np.mean(after - before)))
        chains.append(short.unknowns.keys(population.values[:1])[0])
        scales.append(population.scales[0])
    for column, count in enumerate((4, 6, 2, 4, 6)):
        seen = np.bincount([key[column] for key in chains], minlength=count)
        assert stats.chisquare(seen).pvalue > 1e-3
    for factors in np.array(scales).T:
        assert stats.kstest(factors, "norm", args=(0, SCALE_SPREAD)).pvalue > 1e-3
    assert stats.wilcoxon(gains).pvalue > 1e-3


def cold_fits(
    population: Population, predictor: Predictor, likelihood: Likelihood, *, surely: bool
) -> Array:
    """Log-likelihoods of the chains of the coldest level, shape (width,)."""
    cold = slice(0, population.width)
    misfits = likelihood.misfits_of(predictor, population.values[cold], surely=surely)
    fits: Array = likelihood.of(misfits, scales=population.scales[cold]).sum(axis=1)
    return fits


def test_the_joint_distribution_is_left_alone_where_lengths_are_open(narrow: Predictor) -> None:
    """The same with chains that are samples, fall to either side, and move lengths too.

    Readings are so poor that draws from the prior, weighed, stand for every chain's target.
    """
    from scipy import stats  # takes a second, which other tests need not wait for

    unknowns, moved = narrow.unknowns, programs(3, seed=8)
    values, scales, gains = [], [], []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        population = Population.of_prior(narrow, rng, levels=1, width=8)
        own = (population.values[0], moved, rng)
        data = draw(narrow, *own, scales=population.scales[0], outlier=0.3, noise=POOR)
        weigh_prior(population, narrow, data, rng)
        population.observe(data, POOR, surely=False)
        likelihood = Likelihood(data, POOR)
        before = cold_fits(population, narrow, likelihood, surely=False)
        for _ in range(20):
            population.step()
        after = cold_fits(population, narrow, likelihood, surely=False)
        gains.append(float(np.mean(after - before)))
        values.append(population.values[0])
        scales.append(population.scales[0])
    chosen, lengths = (
        unknowns.attachments(np.array(values)),
        np.array(values)[:, unknowns.continuous],
    )
    for column, count in enumerate((4, 6, 2, 4, 6)):
        assert stats.chisquare(np.bincount(chosen[:, column], minlength=count)).pvalue > 1e-3
    for length in lengths.T:
        assert stats.kstest(length, "uniform").pvalue > 1e-3
    for factors in np.array(scales).T:
        assert stats.kstest(factors, "norm", args=(0, SCALE_SPREAD)).pvalue > 1e-3
    assert stats.wilcoxon(gains).pvalue > 1e-3


def weigh_prior(
    population: Population, predictor: Predictor, data: SensorData, rng: np.random.Generator
) -> None:
    """Draws every chain but the first, which the readings came from, from weighed prior draws."""
    points = rng.random((3000, predictor.unknowns.size))
    scales = rng.normal(0, SCALE_SPREAD, (len(points), 2))
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

    early, spared = after_steps()
    hopeful = lambda likelihood, width, scales: np.full((len(width), len(data)), 1e9)  # noqa: E731
    monkeypatch.setattr(Likelihood, "best", hopeful)  # until all of it is known
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
        factors = rng.normal(0, SCALE_SPREAD, (tried, 2))
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
