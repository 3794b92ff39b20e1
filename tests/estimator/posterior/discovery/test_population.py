from __future__ import annotations

import json

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.population import HOTTEST, Population
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise, drawn_scales
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from estimator.readings.observation import Observation
from tests.estimator.posterior.sampling.enumeration import NODES, WEIGHTS
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, draw, programs

POOR = Noise(tilt=0.2, clearance=0.05, touch=0.25, outlier=0.3, nearby=1e-6)


def test_without_readings_the_chains_stay_with_the_prior(predictor: Predictor) -> None:
    from scipy import stats  # takes a second, which other tests need not wait for

    nothing = Observation(angles=(0.1, 0.2, 0.0, 0.0), touch=(None,) * 4)
    blind = SensorData.of([nothing], MODALITIES, CAP)
    population = Population.of_prior(
        predictor, np.random.default_rng(1), levels=4, chains_per_level=32
    )
    population.observe(Likelihood(blind, NOISE), surely=True)
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


def test_chains_fit_as_well_as_every_body_weighed(short: Predictor) -> None:
    """Chains that begin with exact draws and move on fit as their levels' targets do.

    Were acceptance numbers squared, in any of the four places that draw them, they would not.
    """
    noise, levels, chains_per_level, steps = Noise(tilt=0.25, clearance=0.06), 2, 32, 60
    counts = np.array((4, 6, 2, 4, 6))
    keys = np.array(list(np.ndindex(*counts)))
    point, rng = (keys[777] + 0.5) / counts, np.random.default_rng(6)
    data = draw(short, point, programs(2, seed=3), rng, noise=noise)
    likelihood = Likelihood(data, noise)
    misfits = likelihood.misfits_of(short, (keys + 0.5) / counts, branches=0)
    noise_scales = HOTTEST ** np.linspace(0, 1, levels)
    factors: Array = np.array(np.meshgrid(NODES, NODES)).reshape(2, -1).T

    def fits(bodies: Array, level: int, scales: Array) -> Array:
        wide = np.full(len(bodies), noise_scales[level])
        each: Array = likelihood.of(misfits[bodies], wide, scales).sum(axis=1)
        return each

    body: Array = np.tile(np.arange(len(keys)), len(factors))
    pair: Array = np.repeat(factors, len(keys), axis=0)
    exact = [fits(body, level, pair) for level in range(levels)]
    prior = np.repeat(np.outer(WEIGHTS, WEIGHTS).ravel(), len(keys))
    shares = [prior * np.exp(one) / np.sum(prior * np.exp(one)) for one in exact]
    means = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        rows = np.concatenate(
            [rng.choice(prior.size, chains_per_level, p=share) for share in shares]
        )
        values = (keys[body[rows]] + rng.random((levels * chains_per_level, counts.size))) / counts
        chains = Population(short, rng, values, pair[rows], levels=levels)
        chains.observe(Likelihood(data, noise), surely=True)
        seen = np.zeros((2, levels))
        for _ in range(steps):
            chains.step()
            chosen = np.minimum(chains.values * counts, counts - 1).astype(int)
            bodies = np.ravel_multi_index(tuple(chosen.T), tuple(counts)).reshape(
                levels, chains_per_level
            )
            scales = chains.scales.reshape(levels, chains_per_level, 2)
            seen[0] += [fits(bodies[k], k, scales[k]).mean() for k in range(levels)]
            seen[1] += scales.mean(axis=(1, 2))
        means.append(seen / steps)
    spread = np.std(means, axis=0, ddof=1) / np.sqrt(len(means))
    expected = [
        [share @ one for share, one in zip(shares, exact, strict=True)],
        [share @ pair.mean(axis=1) for share in shares],
    ]
    assert np.abs((np.mean(means, axis=0) - expected) / spread).max() < 3


def gain(population: Population, predictor: Predictor, data: SensorData) -> float:
    """Takes 20 steps; by how much the coldest level's log-likelihoods grow in the mean."""
    likelihood, cold = Likelihood(data, POOR), slice(0, population.chains_per_level)

    def fits() -> Array:
        misfits = likelihood.misfits_of(predictor, population.values[cold])
        each: Array = likelihood.of(misfits, scales=population.scales[cold]).sum(axis=1)
        return each

    population.observe(Likelihood(data, POOR), surely=False)
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


def test_the_joint_distribution_is_left_alone(narrow: Predictor) -> None:
    """Geweke: bodies from the prior, readings from the model, some steps: still the prior.

    Chains are samples here, fall to either side, and move lengths too.

    Readings are so poor that draws from the prior, weighed, stand for every chain's target.
    """
    values, scales, gains = [], [], []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        population = Population.of_prior(narrow, rng, levels=1, chains_per_level=8)
        own = (population.values[0], programs(3, seed=8), rng)
        data = draw(narrow, *own, scales=population.scales[0], outlier=0.3, noise=POOR)
        weigh_prior(population, narrow, data, rng)
        gains.append(gain(population, narrow, data))
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


def test_a_population_goes_on_as_if_it_had_not_been_put_away(predictor: Predictor) -> None:
    data = draw(predictor, np.full(7, 0.4), programs(2), np.random.default_rng(1))
    population = Population.of_prior(
        predictor, np.random.default_rng(3), levels=4, chains_per_level=8
    )
    population.observe(Likelihood(data, NOISE), surely=True)
    population.step()
    copy = Population.from_state(json.loads(json.dumps(population.state())), predictor)
    copy.observe(Likelihood(data, NOISE), surely=True)
    for one in (population, copy):
        one.step()
    assert np.array_equal(copy.values, population.values)
    assert np.array_equal(copy.scales, population.scales)
