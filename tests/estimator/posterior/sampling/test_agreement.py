from __future__ import annotations

import numpy as np
import pytest

from estimator.posterior.checks.verdict import Fit
from estimator.posterior.discovery.discovery import BestPoints
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.sampling.agreement import Agreement, attachments_found
from estimator.posterior.sampling.evidence import EvidenceEstimator
from tests.estimator.two_unknown_rows import NOISE, draw, programs

POINT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])


def test_attachments_met_with_lengths_that_explain_nothing_are_not_met(
    predictor: Predictor,
) -> None:
    data = draw(predictor, POINT, programs(4), np.random.default_rng(2))
    likelihood = Likelihood(data, NOISE)
    estimator = EvidenceEstimator(predictor, data, likelihood, draws=1)
    best, fits = GaussNewton(predictor, data, likelihood).polished(POINT[None])
    elsewhere = best.copy()
    elsewhere[:, predictor.unknowns.continuous] = 0.95
    (key,) = predictor.unknowns.keys(best)
    for values, found in ((best, {key}), (elsewhere, set())):
        bodies = BestPoints(values=values, fits=fits)
        assert attachments_found(bodies, best, estimator, predictor.unknowns) == found


def test_attachments_about_as_probable_as_the_leaders_lead_too() -> None:
    agreement = Agreement(
        points=np.zeros((3, 1)),
        keys=[(0,), (1,), (2,)],
        best=0.0,
        guesses=np.array([-1.0, 0.0, -4.0]),
        found=({(0,), (1,)}, set()),
        fit=Fit(unexplained=0, excess=1.5),
        may_err=True,
    )
    assert agreement.leader == (1,)
    assert agreement.leaders == [(0,), (1,)]
    assert agreement.share_beyond({(1,)}) == pytest.approx(0.28, abs=0.01)


OPEN, KNOWN = (0,), ()


@pytest.mark.parametrize(
    ("key", "unexplained", "excess", "may_err", "adequate_fit"),
    [
        (OPEN, 0, 0.9, False, True),
        (OPEN, 0, 1.1, False, False),
        (OPEN, 1, 0.0, False, False),
        (OPEN, 1, 0.9, True, True),
        (OPEN, 1, 1.1, True, False),  # an outlier, and the others are explained poorly
        (OPEN, 0, 2.3, True, True),
        (OPEN, 0, 2.4, True, False),
        (OPEN, 2, 0.0, True, False),
        (KNOWN, 0, 2.3, False, True),  # no other body can explain it better
        (KNOWN, 0, 2.4, False, False),
        (KNOWN, 1, 0.0, False, False),
        (KNOWN, 1, 2.3, True, True),
        (KNOWN, 2, 0.0, True, False),
    ],
)
def test_what_explains_the_readings_poorly_is_not_credible(
    key: tuple[int, ...], unexplained: int, excess: float, may_err: bool, adequate_fit: bool
) -> None:
    agreement = Agreement(
        points=np.zeros((1, 1)),
        keys=[key],
        best=0.0,
        guesses=np.zeros(1),
        found=(),
        fit=Fit(unexplained=unexplained, excess=excess),
        may_err=may_err,
    )
    assert agreement.adequate_fit == adequate_fit
