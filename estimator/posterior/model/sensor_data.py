"""What a robot felt, as arrays, and how far from it predicted readings lie."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.model.densities import DENSITIES, Felt
from estimator.posterior.model.unknowns import Columns
from estimator.readings.observation import Observation, PredictedReadings

_ENDS: Final = (0, *accumulate(density.misfits for density in DENSITIES.values()))
COLUMNS: Final = {name: slice(*ends) for name, ends in zip(DENSITIES, pairwise(_ENDS), strict=True)}
"""Of each modality among the misfits."""

SILENT: Final = _ENDS[-1]
"""Column of the misfits that is 1 where the model predicts nothing; the modalities' come before."""

ASTRAY: Final = SILENT + 1
"""Column that is 0 where the model falls as statics has it, else the number of the lean by which it
comes to where it explains what was felt."""

MISFITS: Final = ASTRAY + 1


@dataclass(frozen=True, kw_only=True)
class SensorData:
    """What a robot felt, as arrays over k interactions.

    Attributes:
        programs: Angles that the motors took, rad, shape (k, motors).
        felt: The readings by modality.
        cap: The distance sensor's range, m.
    """

    programs: Array
    felt: Mapping[str, Felt]
    cap: float

    @classmethod
    def of(
        cls, observations: Sequence[Observation], modalities: Collection[str], cap: float
    ) -> SensorData:
        """Collects the readings of the modalities that count."""
        return cls(
            programs=np.array([item.angles for item in observations], dtype=float),
            felt={
                name: density.felt(observations, counts=name in modalities)
                for name, density in DENSITIES.items()
            },
            cap=cap,
        )

    def __len__(self) -> int:
        return len(self.programs)

    def __getitem__(self, turns: slice | Columns) -> SensorData:
        """Some of the interactions."""
        felt = {name: values[turns] for name, values in self.felt.items()}
        return SensorData(programs=self.programs[turns], felt=felt, cap=self.cap)

    def misfits(self, readings: PredictedReadings, turns: Columns) -> Array:
        """The misfits of n readings, each in one of the interactions.

        Args:
            readings: Of n bodies.
            turns: Which interaction each is of, shape (n,).

        Returns:
            Shape (n, MISFITS).
        """
        values = np.empty((len(turns), MISFITS))
        for name, density in DENSITIES.items():
            density.misfit(self.felt[name][turns], readings, values[:, COLUMNS[name]])
        values[:, SILENT] = readings.undecided | ~readings.valid
        values[:, ASTRAY] = 0.0
        return values

    def residuals(self, misfits: Array, turns: Columns) -> Array:
        """Observed minus predicted tilt (rad) and clearance (m), shape (n, 3); 0 where unknown.

        Args:
            misfits: Shape (n, MISFITS).
            turns: Which interaction each is of, shape (n,).
        """
        return np.column_stack(
            [
                density.residual(misfits[:, COLUMNS[name]], self.felt[name][turns])
                for name, density in DENSITIES.items()
                if density.residuals
            ]
        )
