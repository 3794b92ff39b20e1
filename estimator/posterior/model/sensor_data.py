"""Observations as arrays, and the misfits of predicted readings, modality by modality.

What a body predicts enters the likelihood through few numbers per interaction, its *misfits*,
whatever the noise. So the noise can be widened, as it is on the hotter levels of a search, without
a simulation. ``mixture`` makes densities of misfits.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.posterior.model.unknowns import Columns
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings

MODEL_TILT: Final = math.radians(0.2)  # what a model of capsules cannot know of tilt, rad
MODEL_CLEARANCE: Final = 0.8e-3  # and of clearance, m

_SHARE_BEYOND: Final = 0.1  # share of arbitrary poses whose clearance lies beyond the range


@dataclass(frozen=True, kw_only=True)
class ObservedModality:
    """One modality's readings of k interactions.

    Attributes:
        values: What was read, shape (k, values), or (k, 1) of a modality that does not count; NaN
            where missing.
        beyond: Whether what is measured lies beyond the sensor's range, shape (k,).
    """

    values: Array
    beyond: Flags

    def __getitem__(self, interactions: Columns) -> ObservedModality:
        """The readings of some of the interactions."""
        chosen = ObservedModality(  # take is several times as fast as an index
            values=self.values.take(interactions, axis=0), beyond=self.beyond.take(interactions)
        )
        chosen.__dict__["complete"] = self.complete  # not to be computed again
        return chosen

    @cached_property
    def present(self) -> Flags:
        """Which values are not missing, shape (k, values)."""
        return ~np.isnan(self.values)

    @cached_property
    def complete(self) -> bool:
        """Whether no value is missing, here or in the interactions that these were chosen from."""
        return bool(self.present.all())

    @property
    def count(self) -> NDArray[np.int64]:
        """How many values are not missing, shape (k,)."""
        counts: NDArray[np.int64] = np.sum(self.present, axis=1)
        return counts


class Density(ABC):
    """The probability of one modality's readings.

    Attributes:
        name: Name of the modality.
        misfits: How many numbers say how far a prediction is from what was observed.
        residuals: How many of the misfits, the first ones, are observed minus predicted on a
            continuous scale. If there are any the robot's noise may be another than announced, by
            an unknown factor.
        beside: How far readings stray, in their unit, where a robot ends beside the pose predicted.
    """

    name: ClassVar[str]
    misfits: ClassVar[int]
    residuals: ClassVar[int]
    beside: ClassVar[float]

    def observed(self, observations: Sequence[Observation], *, counts: bool) -> ObservedModality:
        """The readings of some interactions; all are missing where the modality does not count."""
        modality, values = MODALITIES[self.name], np.full((len(observations), 1), np.nan)
        if counts:  # else the robot may have other sensors than its models
            values = np.array([modality.values(item) for item in observations], dtype=float)
        return ObservedModality(values=values, beyond=np.zeros(len(values), dtype=bool))

    @abstractmethod
    def misfit(self, observed: ObservedModality, readings: PredictedReadings, into: Array) -> None:
        """Writes the misfits of n predictions into an array of shape (n, misfits)."""

    def residual(self, misfits: Array, observed: ObservedModality) -> Array:
        """Observed minus predicted, shape (…, k, residuals); 0 where unknown."""
        return misfits[..., : self.residuals]

    @abstractmethod
    def standardised_residual(
        self, misfits: Array, observed: ObservedModality, noise: float
    ) -> Array:
        """Residual in units of the noise, shape (k,); 0 where nothing was read."""

    @abstractmethod
    def log_anywhere(self, count: NDArray[np.int64], beyond: Flags, cap: float) -> Array:
        """Logarithm of the density of readings in an arbitrary pose, shape (k,).

        Args:
            count: How many values were read, shape (k,).
            beyond: As in ``ObservedModality``.
            cap: The range of the distance sensor, m.
        """


class TouchDensity(Density):
    """Bits that are wrong by chance. Misfits: how many differ, and how many are doubtful."""

    name = "touch"
    misfits = 2
    residuals = 0
    beside = 0.0

    def misfit(self, observed: ObservedModality, readings: PredictedReadings, into: Array) -> None:
        """How many bits differ, and of how many the model is not sure."""
        doubtful = readings.touch_doubtful
        differ = (observed.values != readings.touch) & ~doubtful
        if not observed.complete:
            differ, doubtful = observed.present & differ, observed.present & doubtful
        into[:, 0], into[:, 1] = _counted(differ), _counted(doubtful)

    def standardised_residual(
        self, misfits: Array, observed: ObservedModality, noise: float
    ) -> Array:
        """Number of bits that differ, times the standard deviations that are as unlikely as one."""
        return misfits[:, 0] * math.sqrt(-2 * math.log(noise))

    def log_anywhere(self, count: NDArray[np.int64], beyond: Flags, cap: float) -> Array:
        """Each bit is as likely set as not."""
        return math.log(0.5) * count.astype(float)


class TiltDensity(Density):
    """Normal density of each angle by itself. Misfits: observed minus predicted, rad."""

    name = "tilt"
    misfits = 2
    residuals = 2
    beside = math.radians(3.0)

    def misfit(self, observed: ObservedModality, readings: PredictedReadings, into: Array) -> None:
        """Observed minus predicted, both angles, rad."""
        np.subtract(observed.values, readings.tilt, out=into)
        if not observed.complete:
            np.copyto(into, 0.0, where=~observed.present)

    def standardised_residual(
        self, misfits: Array, observed: ObservedModality, noise: float
    ) -> Array:
        """The larger of both angles' residuals, in units of the noise."""
        ratios = misfits / noise
        larger: Array = ratios[np.arange(len(ratios)), np.argmax(np.abs(ratios), axis=1)]
        return larger

    def log_anywhere(self, count: NDArray[np.int64], beyond: Flags, cap: float) -> Array:
        """Uniform over ±90°."""
        return -math.log(math.pi) * count.astype(float)


class ClearanceDensity(Density):
    """Normal density within the sensor's range. Misfit: observed minus predicted, m.

    A reading at the end of the range has the probability of the tail beyond; its misfit is -inf
    where the model predicts that end, too.
    """

    name = "clearance"
    misfits = 1
    residuals = 1
    beside = 0.01

    def observed(self, observations: Sequence[Observation], *, counts: bool) -> ObservedModality:
        """The readings, and in which interactions the ground lay beyond the range."""
        values = super().observed(observations, counts=counts).values
        saturated = np.array([item.clearance_saturated for item in observations], dtype=bool)
        return ObservedModality(values=values, beyond=saturated & ~np.isnan(values[:, 0]))

    def misfit(self, observed: ObservedModality, readings: PredictedReadings, into: Array) -> None:
        """Observed minus predicted, m."""
        np.subtract(observed.values[:, 0], readings.clearance, out=into[:, 0])
        if not observed.complete:
            into[~observed.present] = 0.0
        into[readings.saturated & observed.beyond, 0] = -np.inf

    def residual(self, misfits: Array, observed: ObservedModality) -> Array:
        """Observed minus predicted, m; 0 where the ground lay beyond the range, too."""
        return np.where(observed.beyond[:, None], 0.0, misfits)

    def standardised_residual(
        self, misfits: Array, observed: ObservedModality, noise: float
    ) -> Array:
        """The residual in units of the noise."""
        return self.residual(misfits, observed)[:, 0] / noise

    def log_anywhere(self, count: NDArray[np.int64], beyond: Flags, cap: float) -> Array:
        """Uniform over the range, and a share beyond it."""
        within = np.where(count > 0, math.log((1 - _SHARE_BEYOND) / cap), 0.0)
        return np.where(beyond, math.log(_SHARE_BEYOND), within)


def _counted(flags: Flags) -> Array:
    """Number of flags set in each row, shape (n,); several times as fast as ``sum``."""
    return flags.astype(float) @ np.ones(flags.shape[1])


DENSITIES: Final[Mapping[str, Density]] = MappingProxyType(
    {density.name: density for density in (TiltDensity(), ClearanceDensity(), TouchDensity())}
)
"""Densities by modality, in the order in which terms are added up, and in which misfits, residuals
and noise factors are columns of arrays."""

SCALED: Final = tuple(name for name, density in DENSITIES.items() if density.residuals)
"""Modalities whose noise has an unknown factor, in the order of the factors."""


_ENDS: Final = (0, *accumulate(density.misfits for density in DENSITIES.values()))
COLUMNS: Final = {name: slice(*ends) for name, ends in zip(DENSITIES, pairwise(_ENDS), strict=True)}
"""Columns of each modality among the misfits."""

NO_PREDICTION: Final = _ENDS[-1]
"""Column of the misfits that is 1 where the model predicts nothing; the modalities' come before."""

BRANCH: Final = NO_PREDICTION + 1
"""Column of the misfits that is 0 where the model falls as statics has it, else the number in
``GRAVITY_TILTS`` under which it explains what was observed."""

STANCE: Final = BRANCH + 1
"""Column of the misfits that says on what the body rests: see ``PredictedReadings``."""

MISFITS: Final = STANCE + 1  # number of columns of the misfits


@dataclass(frozen=True, kw_only=True)
class SensorData:
    """What a robot observed, as arrays over k interactions.

    Attributes:
        programs: Angles that the motors took, rad, shape (k, motors).
        observed: The readings by modality.
        cap: The distance sensor's range, m.
    """

    programs: Array
    observed: Mapping[str, ObservedModality]
    cap: float

    @classmethod
    def of(
        cls, observations: Sequence[Observation], modalities: Collection[str], cap: float
    ) -> SensorData:
        """Collects the readings of the modalities that count."""
        return cls(
            programs=np.array([item.taken for item in observations], dtype=float),
            observed={
                name: density.observed(observations, counts=name in modalities)
                for name, density in DENSITIES.items()
            },
            cap=cap,
        )

    def __len__(self) -> int:
        return len(self.programs)

    def __getitem__(self, interactions: slice | Columns) -> SensorData:
        """Some of the interactions."""
        rows = np.arange(len(self))[interactions]
        observed = {name: values[rows] for name, values in self.observed.items()}
        return SensorData(programs=self.programs[rows], observed=observed, cap=self.cap)

    def misfits(self, readings: PredictedReadings, interactions: Columns) -> Array:
        """The misfits of n readings, each in one of the interactions, shape (n, MISFITS).

        Args:
            readings: Predicted readings of n bodies.
            interactions: Which interaction each is of, shape (n,).
        """
        values = np.empty((len(interactions), MISFITS))
        for name, density in DENSITIES.items():
            density.misfit(self.observed[name][interactions], readings, values[:, COLUMNS[name]])
        values[:, NO_PREDICTION] = readings.undecided | ~readings.valid
        values[:, BRANCH], values[:, STANCE] = 0.0, readings.stance
        return values

    def residuals(self, misfits: Array) -> Array:
        """Observed minus predicted tilt (rad) and clearance (m), shape (n, k, 3); 0 where unknown.

        The misfits have the shape (n, k, MISFITS).
        """
        residuals = [
            density.residual(misfits[..., COLUMNS[name]], self.observed[name])
            for name, density in DENSITIES.items()
        ]
        return np.concatenate(residuals, axis=-1)
