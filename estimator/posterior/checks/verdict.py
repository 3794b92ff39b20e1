"""Whether any body that the problem allows explains the readings.

An interaction is *unexplained* if it is more likely an outlier than not under nearly all samples,
although their path margins there are large. One such interaction in a run may be an outlier. Two of
them, one with a larger residual than outliers have, a noise factor that is above 2 with high
probability, or a touch sensor that contradicts the body more often than chance allows, say that the
problem does not describe the robot. The last reveals a limp leg: its foot lies on the ground where
a stiff one, short enough to carry nothing, would hang in the air.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import MEAN_LOSS, VARIANCE_LOSS
from estimator.posterior.model.sensor_data import COLUMNS, DENSITIES, SCALED
from estimator.posterior.model.special import at_least, softmax
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Mode, Posterior
from estimator.readings.modalities import MODALITIES
from estimator.storage.posteriors import FitVerdict, UnexplainedInteraction

SURE_PATH: Final = math.radians(1.0)
"""Path margin above which a body must explain an interaction, rad."""

TOO_NOISY: Final = 2.0
"""Factor on a sensor's expected noise that no sound sensor needs."""

POOR: Final = 1.0
"""Excess of a fit (``Fit.excess``) that one right body of six has."""

_SURELY: Final = 0.95  # probability that a factor lies above ``TOO_NOISY``, or that a path is sure
_BY_CHANCE: Final = 1e-3  # probability below which a touch sensor's wrong bits are no chance
STRIKING: Final = 3.0
"""Standard deviations from which a sensor is named."""


def judge(posterior: Posterior, predictor: Predictor, likelihood: Likelihood) -> FitVerdict:
    """Judges how well a posterior explains the readings.

    Args:
        posterior: The posterior after some interactions.
        predictor: Computes readings and path margins.
        likelihood: Likelihood of what was observed in these interactions.
    """
    best, weights = posterior.modes[0].point[None], posterior.weights
    misfits = likelihood.misfits_of(predictor, posterior.values)
    outliers = weights @ likelihood.inlier_share(misfits, scales=posterior.scales) < 0.5
    interactions = np.flatnonzero(outliers)
    bodies, programs = predictor.unknowns.bodies(posterior.values), likelihood.data.programs
    sure = have_sure_paths(predictor, bodies, weights, programs[interactions])
    residuals = standardised_residuals(best, predictor, likelihood)
    widened = likelihood.noise.widened(np.exp(weights @ posterior.scales))
    by_widened = standardised_residuals(best, predictor, Likelihood(likelihood.data, widened))
    farthest = np.abs(list(by_widened.values())).max(axis=0)
    unexplained = tuple(
        UnexplainedInteraction(
            interaction=index,
            sensors=tuple(
                name for name, residual in residuals.items() if abs(residual[index]) > STRIKING
            ),
            residual=float(farthest[index]),
        )
        for index in interactions[sure].tolist()
    )
    shares = weights @ (posterior.scales > math.log(TOO_NOISY))
    noisy = tuple(name for name, share in zip(SCALED, shares, strict=True) if share > _SURELY)
    contradicting = _contradicting(best, predictor, likelihood, ~outliers)
    return FitVerdict(unexplained=unexplained, noisy=noisy, contradicting=contradicting)


def judge_body(point: Array, predictor: Predictor, likelihood: Likelihood) -> FitVerdict:
    """Judges one body, shape (size,), averaged over its noise factors."""
    fits = likelihood.by_noise_factors(likelihood.misfits_of(predictor, point[None]))[0]
    factors = likelihood.noise_factors.both
    alone = Posterior(
        values=np.tile(point, (len(factors), 1)),
        scales=factors,
        weights=softmax(fits),
        modes=(Mode(attachments=(), probability=1.0, point=point, ess=math.inf, found=()),),
        adequate_fit=True,
    )
    return judge(alone, predictor, likelihood)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How well one body explains the readings.

    Attributes:
        unexplained: Number of interactions that it leaves unexplained.
        excess: Loss of log-likelihood in the other interactions beyond the mean loss of the robot's
            own body under the announced noise, in standard deviations of that loss.
    """

    unexplained: int
    excess: float

    @property
    def is_improvable(self) -> bool:
        """Whether the fit is so poor that a better body may exist."""
        return self.unexplained > 0 or self.excess > POOR


def fit_of(point: Array, predictor: Predictor, likelihood: Likelihood) -> Fit:
    """How well a body, shape (size,), explains the readings."""
    points, data = point[None], likelihood.data
    misfits = likelihood.misfits_of(predictor, points)
    outliers = likelihood.inlier_share(misfits)[0] < 0.5
    losses = (likelihood.best() - likelihood.of(misfits))[0]
    readings = sum(float(data.observed[name].count[~outliers].sum()) for name in SCALED)
    excess = float(losses[~outliers].sum()) - MEAN_LOSS * readings
    bodies, programs = predictor.unknowns.bodies(points), data.programs[outliers]
    unexplained = np.count_nonzero(have_sure_paths(predictor, bodies, np.ones(1), programs))
    return Fit(
        unexplained=int(unexplained),
        # without readings there is no loss
        excess=excess / math.sqrt(VARIANCE_LOSS * readings) if readings else 0.0,
    )


def standardised_residuals(
    point: Array, predictor: Predictor, likelihood: Likelihood
) -> dict[str, Array]:
    """Observed minus predicted in units of the noise, by modality, shape (k,) each.

    Each touch bit that differs adds the standard deviations that are as unlikely as a wrong bit. Of
    the two tilts the larger deviation counts. 0 where nothing was read.

    Args:
        point: A body, shape (1, size).
        predictor: Computes readings.
        likelihood: Likelihood of the observations.
    """
    (misfits,) = likelihood.misfits_of(predictor, point)
    return {
        name: DENSITIES[name].standardised_residual(
            misfits[:, COLUMNS[name]], likelihood.data.observed[name], likelihood.noise.of(name)
        )
        for name in MODALITIES
    }


def _contradicting(
    point: Array, predictor: Predictor, likelihood: Likelihood, counts: Flags
) -> tuple[int, ...]:
    """Touch sensors with more wrong bits, in the interactions that count, than chance allows."""
    observed = likelihood.data.observed["touch"].values
    readings = likelihood.readings_of(predictor, point)
    present = counts[:, None] & ~np.isnan(observed) & ~readings.touch_doubtful
    wrong = np.sum(present & (observed != readings.touch), axis=0)
    chance = at_least(wrong, np.sum(present, axis=0), likelihood.noise.touch)
    return tuple(np.flatnonzero(chance < _BY_CHANCE).tolist())


def have_sure_paths(predictor: Predictor, bodies: Bodies, weights: Array, programs: Array) -> Flags:
    """Whether nearly all of n bodies land surely in each of k programs, shape (k,)."""
    rows = np.repeat(np.arange(len(bodies)), len(programs))
    margins = predictor.margins(bodies, rows, np.tile(programs, (len(bodies), 1)))
    return weights @ (margins.reshape(len(bodies), len(programs)) > SURE_PATH) > _SURELY
