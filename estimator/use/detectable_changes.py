"""What may have changed on a robot since it was identified and would show, and how probably."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr, ndtri

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array
from estimator.parameters.table import Parameter
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.noise import Noise
from estimator.posterior.posterior import systematic
from estimator.readings.observation import PredictedReadings

_PROBES: Final = 64  # programs on which a change must show
_SHOWS: Final = 0.1  # smallest share of the programs in which it must show
_SIGMAS: Final = 5.0  # standard deviations by which it must show: less may be errors of models
_MIDDLE: Final = 0.6745  # tried for an amount that is uniform between two ends, standard normal
_SIZES: Final = np.linspace(0.1, 3.0, 30)  # tried for other amounts, in their spreads


@dataclass(frozen=True, kw_only=True)
class DetectableChange:
    """One change that sensors can show, with how probable it is before any reading.

    Attributes:
        row: Row of the table of changes, which says what the change does.
        log_prior: Logarithm of its probability, if there is one of the changes.
        least: Smallest amount, in spreads: smaller ones cannot be told from what models err by. 0:
            any amount can.
    """

    row: Parameter
    log_prior: float
    least: float = 0.0

    @property
    def name(self) -> str:
        """Name of the row."""
        return self.row.name

    def amounts(self, theta: Array) -> Array:
        """Amounts that standard normal numbers stand for, as people are told, shape (n,)."""
        return self.row.as_told(self._signed_amounts(theta))

    def changed(self, bodies: Bodies, theta: Array) -> Bodies:
        """The n bodies, each changed by its own amount."""
        return self.row.applied(bodies, self._signed_amounts(theta))

    def drawn(self, uniforms: Array) -> Array:
        """Standard normal numbers of at least the least size, from n numbers in [0, 1]."""
        tail = float(ndtr(-self.least))
        ends = 2 * tail * np.clip(uniforms, 1e-9, 1 - 1e-9)
        theta: Array = np.where(ends < tail, ndtri(ends), -ndtri(2 * tail - ends))
        return theta

    def log_density(self, theta: Array) -> Array:
        """Logarithm of the density by which ``drawn`` draws, shape (n,)."""
        normal = -0.5 * theta**2 - 0.5 * math.log(2 * math.pi) - math.log(2 * ndtr(-self.least))
        return np.where(np.abs(theta) >= self.least, normal, -np.inf)

    def _signed_amounts(self, theta: Array) -> Array:
        return self.row.amounts(self.row.wide or 1.0, theta)


def detectable_changes_of(
    known: FittedPosterior, rng: np.random.Generator
) -> tuple[DetectableChange, ...]:
    """All changes of the robot that its sensors could show, and no model error would.

    Args:
        known: The body as it was identified.
        rng: Draws the programs on which changes must show.
    """
    rows = known.possible_changes
    low, high = known.program_range.T
    programs = rng.uniform(low, high, (_PROBES, len(low)))
    bodies = known.body_arrays[systematic(known.weights, 1, 0.5)]
    leasts = [(row, _least(known, row, bodies, programs)) for row in rows]
    detectable = [(row, least) for row, least in leasts if least is not None]
    sizes = Counter(row.group for row, _ in detectable)
    return tuple(
        DetectableChange(row=row, log_prior=-math.log(len(sizes) * sizes[row.group]), least=least)
        for row, least in detectable
    )


def _least(known: FittedPosterior, row: Parameter, bodies: Bodies, programs: Array) -> float | None:
    """Number of spreads from which on a change shows; ``None``: it never does."""
    if row.is_centred:
        thetas = np.concatenate([_SIZES, -_SIZES, np.zeros(1)])
    else:
        thetas = np.array([_MIDDLE])
    amounts = row.amounts(row.wide or 1.0, thetas)
    rows = np.repeat(np.arange(len(thetas)), len(programs))
    programs_tiled = np.tile(programs, (len(thetas), 1))
    changed = row.applied(bodies[np.zeros(len(thetas), dtype=np.intp)], amounts)
    before = known.predictor.read(bodies, np.zeros(len(programs), dtype=np.intp), programs)
    after = known.predictor.read(changed, rows, programs_tiled)
    repeated = before[np.tile(np.arange(len(programs)), len(thetas))]
    shows = _differ(repeated, after, known.noise).reshape(len(thetas), -1).mean(axis=1) >= _SHOWS
    if shows[-1]:  # even an amount of 0 shows, such as a servo that jammed at 0
        return 0.0
    both_signs = shows[:-1].reshape(2, -1).all(axis=0)
    onwards = np.flip(np.logical_and.accumulate(np.flip(both_signs)))  # from here on
    return float(_SIZES[np.argmax(onwards)]) if onwards.any() else None


def _differ(one: PredictedReadings, other: PredictedReadings, noise: Noise) -> Array:
    tilt = np.max(np.abs(one.tilt - other.tilt), axis=1) > _SIGMAS * noise.tilt
    clearance = np.abs(one.clearance - other.clearance) > _SIGMAS * noise.clearance
    doubtful = one.touch_doubtful | other.touch_doubtful
    touch = np.any((one.touch != other.touch) & ~doubtful, axis=1)
    differ: Array = (tilt | clearance | touch).astype(float)
    return differ
