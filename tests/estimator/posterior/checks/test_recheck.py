from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import Morphology
from estimator.physics.base import Pair, Readings, WorldSettings
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.recheck import fine, recheck
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior
from tests.estimator.two_unknown_rows import NOISE, draw, programs

RIGHT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
WRONG = np.array([0.9, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


def test_the_fine_world_lasts_as_long() -> None:
    world = WorldSettings()
    assert fine(world).step == 1 / 240
    assert fine(world).steps * fine(world).step == pytest.approx(world.steps * world.step)


def test_a_body_that_the_simulator_contradicts_loses_its_weight(predictor: Predictor) -> None:
    data = draw(predictor, RIGHT, programs(3, seed=9), np.random.default_rng(2))
    keys = predictor.unknowns.keys(np.stack([RIGHT, WRONG]))
    values = np.repeat(np.stack([RIGHT, WRONG]), 10, axis=0)
    before = Posterior(
        values=values,
        scales=np.zeros((20, 2)),
        weights=np.full(20, 0.05),
        modes=tuple(
            Mode(key, 0.5, point, 10.0, (True, True))
            for key, point in zip(keys, (RIGHT, WRONG), strict=True)
        ),
        credible=True,
    )
    simulated = recheck(before, predictor, data, NOISE, _Swapped())
    assert simulated.simulated == 16
    assert simulated.posterior.modes[0].attachments == keys[1]
    assert simulated.posterior.modes[0].probability > 0.99
    assert simulated.posterior.weights[10:].sum() > 0.99


class _Swapped(StaticsPhysics):
    """A simulator in which every body whose first leg sits on the left sits at the back instead."""

    def read(self, pairs: Sequence[Pair]) -> Readings:
        return super().read([(_swapped(body), program) for body, program in pairs])


def _swapped(body: Morphology) -> Morphology:
    first, *others = body.parts
    side = {0: 3, 3: 0}.get(first.mount, first.mount)
    return replace(body, parts=(replace(first, mount=side), *others))
