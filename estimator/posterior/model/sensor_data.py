"""What a robot observed, as arrays, and how far from it predicted readings lie."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.physics.base import Readings
from estimator.posterior.model.densities import DENSITIES, ObservedModality
from estimator.posterior.model.unknowns import Columns
from estimator.readings.observation import Observation

_ENDS: Final = (0, *accumulate(density.misfits for density in DENSITIES.values()))
COLUMNS: Final = {name: slice(*ends) for name, ends in zip(DENSITIES, pairwise(_ENDS), strict=True)}
"""Of each modality among the misfits."""

NO_PREDICTION: Final = _ENDS[-1]
"""Column of the misfits that is 1 where the model predicts nothing; the modalities' come before."""

BRANCH: Final = NO_PREDICTION + 1
"""Column that is 0 where the model falls as statics has it, else the number of the lean by which it
comes to where it explains what was observed."""

MISFITS: Final = BRANCH + 1


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
            programs=np.array([item.angles for item in observations], dtype=float),
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
        observed = {name: values[interactions] for name, values in self.observed.items()}
        return SensorData(programs=self.programs[interactions], observed=observed, cap=self.cap)

    def misfits(self, readings: Readings, interactions: Columns) -> Array:
        """The misfits of n readings, each in one of the interactions.

        Args:
            readings: Of n bodies.
            interactions: Which interaction each is of, shape (n,).

        Returns:
            Shape (n, MISFITS).
        """
        values = np.empty((len(interactions), MISFITS))
        for name, density in DENSITIES.items():
            density.misfit(self.observed[name][interactions], readings, values[:, COLUMNS[name]])
        values[:, NO_PREDICTION] = readings.undecided | ~readings.valid
        values[:, BRANCH] = 0.0
        return values

    def residuals(self, misfits: Array, interactions: Columns) -> Array:
        """Observed minus predicted tilt (rad) and clearance (m), shape (n, 3); 0 where unknown.

        Args:
            misfits: Shape (n, MISFITS).
            interactions: Which interaction each is of, shape (n,).
        """
        return np.column_stack(
            [
                density.residual(misfits[:, COLUMNS[name]], self.observed[name][interactions])
                for name, density in DENSITIES.items()
                if density.residuals
            ]
        )
