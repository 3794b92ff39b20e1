from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import Part
from estimator.physics.base import Pair, Readings
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks import leave_one_out
from estimator.posterior.checks.leave_one_out import leave_one_out_check
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Posterior
from tests.estimator.two_unknown_rows import NOISE, draw, equally_likely

FELT_LIKE = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
MOVED = np.radians([30.0, -25.0, 20.0, -15.0])
PERFORMED = np.vstack([np.zeros((2, 4)), MOVED])  # lengths tell nothing while all lies flat


class Elsewhere(StaticsPhysics):
    """A simulator in which any lengths end in one movement as those of one body do."""

    def read(self, pairs: Sequence[Pair]) -> Readings:
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
        posterior, predictor, data, NOISE, reference=reference, like=like, rng=rng
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
    monkeypatch.setattr(leave_one_out, "_WIDE", 1e9)
    posterior = looked_at(predictor, Elsewhere())
    assert np.array_equal(posterior.values, sampled().values)
