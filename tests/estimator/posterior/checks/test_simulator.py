from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from estimator.body.morphology import Array, Morphology
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.simulator import fine, probability_unlisted, recheck
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior
from estimator.readings.observation import Observation, PredictedReadings
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, POINT, draw, programs

WRONG = np.array([0.9, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


def test_the_fine_world_lasts_as_long() -> None:
    world = WorldSettings()
    assert fine(world).step == 1 / 240
    assert fine(world).steps * fine(world).step == pytest.approx(world.steps * world.step)


def test_robots_that_are_otherwise_in_ways_that_nobody_looks_for() -> None:
    """They show by outliers, and some by nothing: no number of movements rules these out."""
    share = NOISE.outlier / 100  # an inlier's, after the readings
    unlisted = partial(probability_unlisted, noise=NOISE, deviating=0.04, prior=0.04)
    by_movements = [unlisted(np.full(count, share)) for count in (0, 1, 4, 16, 64)]
    assert by_movements == sorted(by_movements, reverse=True)
    assert by_movements[0] == pytest.approx(1 / 30)
    assert 0.0202 < by_movements[-1] < by_movements[-2] < 0.0208
    one, two = (unlisted(np.where(np.arange(8) < count, 1.0, share)) for count in (1, 2))
    assert one < 0.5
    assert two > 0.9


def test_a_robot_with_a_large_deviation_may_have_something_else_instead() -> None:
    """Few robots have one by an amount, so many of those that read so are not in the table."""
    outliers = np.full(8, NOISE.outlier / 100)
    by_share = [
        probability_unlisted(outliers, NOISE, deviating=share, prior=0.04)
        for share in (0.0, 0.04, 0.5, 1.0)
    ]
    assert by_share == sorted(by_share)
    assert by_share[0] < 0.012
    assert 0.15 < by_share[-1] < 0.25
    assert probability_unlisted(outliers, NOISE, deviating=1.0, prior=0.4) < 0.03
    assert probability_unlisted(outliers, NOISE, deviating=0.0, prior=0.0) < 0.012


def test_a_body_that_the_simulator_contradicts_loses_its_weight(predictor: Predictor) -> None:
    data = draw(predictor, POINT, programs(3, seed=9), np.random.default_rng(2))
    simulated = recheck(
        undecided(predictor, POINT, WRONG), predictor, Likelihood(data, NOISE), _Swapped()
    )
    assert simulated.simulated == 16
    assert simulated.posterior.modes[0].attachments == predictor.unknowns.keys(WRONG[None])[0]
    assert simulated.posterior.modes[0].probability > 0.99
    assert simulated.posterior.weights[10:].sum() > 0.99


def test_samples_are_simulated_by_their_weights(predictor: Predictor) -> None:
    """Some stand for what is improbable: these are hardly among them."""
    data = draw(predictor, POINT, programs(3, seed=9), np.random.default_rng(2))
    likelihood, longer = Likelihood(data, NOISE), POINT.copy()
    longer[[1, 4]] = 0.9
    samples = undecided(predictor, POINT, longer)
    (mode, _), weights = samples.modes, np.repeat([0.0999999, 1e-7], 10)
    one_set = replace(samples, modes=(replace(mode, probability=1.0),), weights=weights)
    checked = recheck(one_set, predictor, likelihood, _Swapped())
    assert checked.simulated == 8
    assert checked.ess == pytest.approx(8)


def test_where_engines_differ_the_simulator_has_the_last_word(predictor: Predictor) -> None:
    """This body falls onto its side in PyBullet, and in statics stays upright, with 2° to spare."""
    fallen = np.array([0.38, 0.37, 0.83, 0.73, 0.28, 0.36, 0.39])
    other = fallen.copy()
    other[0] = 0.9  # its first leg at the back
    program = np.radians([-11.5, -25.8, -27.2, -16.6])
    pair = (predictor.unknowns.decode_all(fallen[None])[0], program)
    with PyBulletPhysics(fine(WorldSettings())) as pybullet:
        observed, computed = pybullet.read([pair]), StaticsPhysics().read([pair])
        assert np.degrees(np.abs(observed.tilt - computed.tilt).max()) > 45
        observation = Observation(
            angles=tuple(program.tolist()),
            touch=tuple(observed.touch[0].tolist()),
            tilt=(float(observed.tilt[0, 0]), float(observed.tilt[0, 1])),
            clearance=float(observed.clearance[0]),
            clearance_saturated=bool(observed.saturated[0]),
        )
        data = SensorData.of([observation], MODALITIES, CAP)
        likelihood = Likelihood(data, NOISE)
        fits = likelihood.of(likelihood.misfits_of(predictor, np.stack([fallen, other])))
        assert np.ptp(fits) < 1.0  # to statics both are as poor
        checked = recheck(
            undecided(predictor, fallen, other), predictor, Likelihood(data, NOISE), pybullet
        )
    first, *_ = checked.posterior.modes
    assert first.attachments == predictor.unknowns.keys(fallen[None])[0]
    assert first.probability > 0.99
    assert checked.posterior.weights[:10].sum() > 0.99
    assert checked.ess < 16


def undecided(predictor: Predictor, one: Array, other: Array) -> Posterior:
    """Ten samples of each of two bodies, as probable as each other."""
    both = np.stack([one, other])
    return Posterior(
        values=np.repeat(both, 10, axis=0),
        scales=np.zeros((20, 2)),
        weights=np.full(20, 0.05),
        modes=tuple(
            Mode(key, 0.5, point, 10.0, (True, True))
            for key, point in zip(predictor.unknowns.keys(both), both, strict=True)
        ),
        adequate_fit=True,
    )


class _Swapped(StaticsPhysics):
    """A simulator in which every body whose first leg sits on the left sits at the back instead."""

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        return super().read([(_swapped(body), program) for body, program in pairs])


def _swapped(body: Morphology) -> Morphology:
    first, *others = body.parts
    side = {0: 3, 3: 0}.get(first.mount, first.mount)
    return replace(body, parts=(replace(first, mount=side), *others))
