"""Lengths are found at which a body feels like another, where there are any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import Array, Morphology
from estimator.evaluation.length_search import LengthSearch
from estimator.physics.equivalence import Reference
from estimator.physics.statics import StaticsPhysics
from tests.estimator.conftest import MakeBody

ALL = ("touch", "tilt", "clearance")
RANGES = np.array([[0.01, 0.2]] * 8)


def reference(
    body: Morphology, statics: StaticsPhysics, modalities: Sequence[str] = ALL
) -> Reference:
    programs = np.radians(np.random.default_rng(0).uniform(-30, 30, (500, 4)))
    return Reference(body, programs, statics, modalities)


def with_errors(body: Morphology, errors: Array) -> Morphology:
    return replace(
        body,
        parts=tuple(
            replace(part, length=max(0.01, part.length + error))
            for part, error in zip(body.parts, errors.tolist(), strict=True)
        ),
    )


@pytest.mark.parametrize("seed", range(6))
def test_lengths_that_are_wrong_by_centimetres_are_mended(
    statics: StaticsPhysics, random_quadruped: MakeBody, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    truth = reference(body := random_quadruped(rng), statics)
    start = with_errors(body, rng.normal(0, 0.02, 8))
    assert not truth.is_like(start)
    assert LengthSearch(truth, RANGES).is_like([start])


def test_the_true_lengths_may_lie_outside_the_ranges(
    statics: StaticsPhysics, random_quadruped: MakeBody
) -> None:
    body = with_errors(random_quadruped(np.random.default_rng(1)), np.full(8, 0.15))
    truth = reference(body, statics)
    starts = [with_errors(body, np.full(8, error)) for error in (0.005, -0.005)]
    assert not any(truth.is_like(start) for start in starts)
    assert LengthSearch(truth, RANGES).is_like(starts)


def test_touch_alone_has_no_slopes_but_is_searched(
    statics: StaticsPhysics, random_quadruped: MakeBody
) -> None:
    body = random_quadruped(np.random.default_rng(2))
    truth = reference(body, statics, ("touch",))
    shorter = with_errors(body, np.array([-0.02, 0, 0, 0, 0, 0, 0, 0]))
    assert not truth.is_like(shorter)
    assert LengthSearch(truth, RANGES).is_like([shorter])
    yawing = replace(body, parts=(replace(body.parts[0], hinge=0), *body.parts[1:]))
    assert not LengthSearch(truth, RANGES).is_like([yawing])
