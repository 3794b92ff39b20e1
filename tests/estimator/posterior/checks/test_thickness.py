from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.posterior.checks.thickness import better_thickness
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior
from tests.estimator.two_unknown_rows import NOISE, draw, programs

POINT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
MOVED = programs(8, seed=4)


def around(point: np.ndarray) -> Posterior:
    values = np.tile(point, (12, 1))
    values[:, [2, 6]] = np.random.default_rng(1).uniform(0.3, 0.7, (12, 2))
    return Posterior(
        values=values,
        scales=np.zeros((12, 2)),
        weights=np.full(12, 1 / 12),
        modes=(Mode((), 1.0, point, 12.0),),
        seen=1.0,
    )


@pytest.mark.parametrize(("true", "said"), [(1.0, None), (2.0, 2.0), (2.8, 2.8)])
def test_the_thickness_that_the_readings_speak_for_is_said_only_where_the_problems_is_wrong(
    predictor: Predictor, true: float, said: float | None
) -> None:
    robot = predictor.with_thickness(true)
    data = draw(robot, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    assert better_thickness(around(POINT), predictor, data, NOISE) == said


def test_one_movement_that_ended_elsewhere_says_nothing_of_thickness(predictor: Predictor) -> None:
    data = draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)
    thick = draw(
        predictor.with_thickness(2.0), POINT, MOVED, np.random.default_rng(11), outlier=0.0
    )
    felt = {name: replace(one, values=one.values.copy()) for name, one in data.felt.items()}
    for name, one in felt.items():
        one.values[3] = thick.felt[name].values[3]
    elsewhere = replace(data, felt=felt)
    assert better_thickness(around(POINT), predictor, elsewhere, NOISE) is None


def test_margins_are_of_the_same_parts_as_readings(predictor: Predictor) -> None:
    bodies, rows = predictor.unknowns.bodies(POINT[None]), np.zeros(len(MOVED), dtype=np.intp)
    thick = predictor.with_thickness(2.0).margins(bodies, rows, MOVED)
    as_if = predictor.margins(replace(bodies, radius=2.0 * bodies.radius), rows, MOVED)
    assert thick.tolist() == as_if.tolist()
    assert thick.tolist() != predictor.margins(bodies, rows, MOVED).tolist()
