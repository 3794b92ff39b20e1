"""Bodies that deviate from a problem are fitted alike, whoever does it."""

from __future__ import annotations

import numpy as np

from estimator.parallel.executors import ThisProcess, WorkerProcesses
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.misspecification import fit_alternatives
from estimator.posterior.model.unknowns import Predictor
from tests.estimator.posterior.checks.test_misspecification import (
    ASKEW,
    DEAD,
    HEAVY,
    POINT,
    THICK,
    around,
    felt_by,
)
from tests.estimator.two_unknown_rows import NOISE


def test_who_fits_what_departs_makes_no_difference(predictor: Predictor) -> None:
    data, few = felt_by(predictor), (THICK, ASKEW, DEAD, HEAVY)
    fitted, costs = [], []
    with WorkerProcesses(1) as another:
        for workers in (ThisProcess(), another):
            counting, reference = Predictor(predictor.unknowns, StaticsPhysics()), StaticsPhysics()
            fitted.append(
                fit_alternatives(
                    *(around(POINT), counting, data, NOISE, few),
                    reference=reference,
                    workers=workers,
                )
            )
            costs.append(counting.simulations)
    one, other = fitted
    assert [alternative.deviation for alternative in one] == [
        alternative.deviation for alternative in other
    ]
    assert all(np.array_equal(a.gains, b.gains) for a, b in zip(one, other, strict=True))
    assert costs[0] == costs[1] > 1000
