from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import Array, Morphology, Part
from estimator.physics.base import Pair, WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks import simulator
from estimator.posterior.checks.simulator import (
    fine,
    leave_one_out_check,
    probability_unlisted,
    recheck,
)
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior
from estimator.readings.observation import Observation, PredictedReadings
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, draw, equally_likely, programs

RIGHT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
WRONG = np.array([0.9, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


def test_the_fine_world_lasts_as_long() -> None:
    world = WorldSettings()
    assert fine(world).step == 1 / 240
    assert fine(world).steps * fine(world).step == pytest.approx(world.steps * world.step)


def test_robots_that_are_otherwise_in_ways_that_nobody_looks_for() -> None:
    """They show by outliers, and some by nothing: no number of movements rules these out."""
    share = NOISE.outlier / 100  # an inlier's, after the readings
    by_movements = [
        probability_unlisted(np.full(count, share), NOISE) for count in (0, 1, 4, 16, 64)
    ]
    assert by_movements == sorted(by_movements, reverse=True)
    assert by_movements[0] == pytest.approx(1 / 30)
    assert 0.0099 < by_movements[-1] < by_movements[-2] < 0.0105
    one, two = (
        probability_unlisted(np.where(np.arange(8) < count, 1.0, share), NOISE) for count in (1, 2)
    )
    assert one < 0.5
    assert two > 0.9


def test_a_body_that_the_simulator_contradicts_loses_its_weight(predictor: Predictor) -> None:
    data = draw(predictor, RIGHT, programs(3, seed=9), np.random.default_rng(2))
    simulated = recheck(
        undecided(predictor, RIGHT, WRONG), predictor, Likelihood(data, NOISE), _Swapped()
    )
    assert simulated.simulated == 16
    assert simulated.posterior.modes[0].attachments == predictor.unknowns.keys(WRONG[None])[0]
    assert simulated.posterior.modes[0].probability > 0.99
    assert simulated.posterior.weights[10:].sum() > 0.99


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


FELT_LIKE = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
MOVED = np.radians([30.0, -25.0, 20.0, -15.0])
PERFORMED = np.vstack([np.zeros((2, 4)), MOVED])  # lengths tell nothing while all lies flat


class Elsewhere(StaticsPhysics):
    """A simulator in which any lengths end in one movement as those of one body do."""

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        lengths = (0.21, 0.21)
        return super().read(
            [
                (replace(body, parts=_with(body.parts, lengths)), program)
                if np.array_equal(program, MOVED)
                else (body, program)
                for body, program in pairs
            ]
        )


def _with(parts: tuple[Part, ...], lengths: tuple[float, float]) -> tuple[Part, ...]:
    first = [replace(part, length=one) for part, one in zip(parts, lengths, strict=False)]
    return (*first, *parts[2:])


def sampled() -> Posterior:
    values = np.tile(FELT_LIKE, (64, 1))
    values[:, [2, 6]] += np.random.default_rng(1).normal(0, 0.005, (64, 2))
    return equally_likely(values, FELT_LIKE)


def looked_at(
    predictor: Predictor, reference: StaticsPhysics, posterior: Posterior | None = None
) -> Posterior:
    posterior = posterior or sampled()
    data = draw(predictor, FELT_LIKE, PERFORMED, np.random.default_rng(3), outlier=0.0)
    rng, like = np.random.default_rng(4), predictor.unknowns.keys(FELT_LIKE[None])
    return leave_one_out_check(
        posterior, predictor, Likelihood(data, NOISE), reference=reference, like=like, rng=rng
    )


def test_lengths_that_only_statics_rules_out_are_believed_too(predictor: Predictor) -> None:
    wider = looked_at(predictor, Elsewhere())
    assert len(wider.values) == 64
    assert np.ptp(wider.values[:, 2]) > 0.3
    assert np.ptp(sampled().values[:, 2]) < 0.05
    assert wider.weights.sum() == 1.0
    assert wider.modes[0].point.tolist() == FELT_LIKE.tolist()


def test_samples_of_rivals_stay(predictor: Predictor) -> None:
    """A rival that held 40 % of the samples held 21 % of them afterwards."""
    posterior = sampled()
    rival = np.arange(64) % 5 < 2
    posterior.values[rival, 0] = 0.9  # its first leg sits elsewhere
    wider = looked_at(predictor, Elsewhere(), posterior)
    assert np.ptp(wider.values[:, 2]) > 0.3
    assert np.count_nonzero(wider.values[:, 0] == 0.9) == np.count_nonzero(rival)


def test_where_the_simulator_agrees_with_statics_nothing_changes(predictor: Predictor) -> None:
    same = looked_at(predictor, StaticsPhysics())
    assert np.array_equal(same.values, sampled().values)


def test_where_all_draws_lie_outside_the_problems_ranges_nothing_changes(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulator, "_WIDE", 1e9)
    posterior = looked_at(predictor, Elsewhere())
    assert np.array_equal(posterior.values, sampled().values)
