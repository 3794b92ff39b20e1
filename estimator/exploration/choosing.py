"""The next motor program: the one that is expected to tell most, and what it would tell about."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import Array
from estimator.exploration.few_limbs import LimbGenes, with_few_limbs
from estimator.exploration.information_gain import Forecast, InformationGain
from estimator.exploration.situation import Models
from estimator.physics.base import Readings
from estimator.posterior.model.likelihood import LEANS
from estimator.posterior.model.unknowns import Columns, Predictor

_CANDIDATES: Final = 1000
_DRAWS: Final = 100
_LIKELY: Final = 100  # of the best candidates, which are looked at for forks
_REFINED: Final = 8  # of the best of these, each by
_VARIANTS: Final = 8
_SPREADS: Final = (math.radians(6.0), math.radians(3.0))
_FINALISTS: Final = 10  # compared by more readings
_MORE_DRAWS: Final = 800


@dataclass(frozen=True, kw_only=True)
class InformativeProgram:
    """A motor program, and what it would tell.

    Attributes:
        program: rad, shape (motors,).
        bits: Information that it is expected to give about the body.
        about: The same about each column of the cube: about a choice, or about the half of its
            range in which a length lies; shape (size,).
    """

    program: Array
    bits: float
    about: Array


class Chooser:
    """Chooses motor programs.

    Args:
        predictor: Computes readings.
        gain: Computes information.
        ends: Lowest and highest target of each motor, rad, shape (motors, 2).
        limbs: Of which few are moved at a time, while much is open.
    """

    def __init__(
        self,
        predictor: Predictor,
        gain: InformationGain,
        ends: Array,
        limbs: Sequence[LimbGenes] = (),
    ) -> None:
        self._predictor = predictor
        self._gain = gain
        self._ends = ends
        self._limbs = limbs

    def choose(self, samples: Models, rng: np.random.Generator) -> InformativeProgram:
        """The motor program that is expected to tell most.

        Args:
            samples: Equally likely models.
            rng: The choice's own.
        """
        low, high = self._ends.T
        programs = with_few_limbs(
            rng.uniform(low, high, (_CANDIDATES, len(low))),
            self._limbs,
            self._predictor.unknowns.decided(samples.genes),
            rng,
        )
        quick = self._read(samples, programs, LEANS[0], quickly=True)
        bits = self._bits(samples, Forecast.of(quick, len(samples.genes)), rng, _DRAWS)
        programs = programs[np.argsort(-bits, kind="stable")[:_LIKELY]]
        bits = self._bits(samples, self._sure_forecast(samples, programs), rng, _DRAWS)
        for spread in _SPREADS:
            best = np.repeat(
                programs[np.argsort(-bits, kind="stable")[:_REFINED]], _VARIANTS, axis=0
            )
            near = np.clip(best + rng.normal(0, spread, best.shape), low, high)
            near = np.where(best == 0, 0.0, near)
            programs = np.concatenate([programs, near])
            more = self._bits(samples, self._sure_forecast(samples, near), rng, _DRAWS)
            bits = np.concatenate([bits, more])
        programs = programs[np.argsort(-bits, kind="stable")[:_FINALISTS]]
        sure = self._bits(samples, self._sure_forecast(samples, programs), rng, _MORE_DRAWS)
        winner = int(np.argmax(sure))
        return InformativeProgram(
            program=programs[winner],
            bits=float(sure[winner]),
            about=self._about(samples, programs[winner : winner + 1], rng),
        )

    def _bits(
        self, samples: Models, forecast: Forecast, rng: np.random.Generator, draws: int
    ) -> Array:
        groups = np.arange(len(samples.genes))
        return self._gain.of(forecast, samples.scales, groups, rng, draws=draws)

    def _sure_forecast(self, samples: Models, programs: Array) -> Forecast:
        """What samples will feel, silent where a sample may fall to more sides than one."""
        plumb = self._read(samples, programs, LEANS[0])
        forecast = Forecast.of(plumb, len(samples.genes))
        for lean in LEANS[1:]:
            forks = self._gain.apart(plumb, self._read(samples, programs, lean))
            forecast.silent[forks.reshape(forecast.silent.shape)] = True
        return forecast

    def _read(
        self, samples: Models, programs: Array, lean: Array, *, quickly: bool = False
    ) -> Readings:
        count = len(samples.genes)
        bodies = self._predictor.unknowns.bodies(samples.genes)
        rows = np.tile(np.arange(count), len(programs))
        repeated = np.repeat(programs, count, axis=0)
        return self._predictor.read(bodies, rows, repeated, lean, quickly=quickly)

    def _about(self, samples: Models, program: Array, rng: np.random.Generator) -> Array:
        unknowns = self._predictor.unknowns
        forecast = self._sure_forecast(samples, program)
        about = np.zeros(unknowns.size)
        for column, groups in _groups(
            samples.genes, unknowns.choices, unknowns.attachments(samples.genes)
        ):
            about[column] = self._gain.of(
                forecast, samples.scales, groups, rng, draws=4 * len(groups)
            )[0]
        for column in unknowns.continuous:
            halves = (samples.genes[:, column] > np.median(samples.genes[:, column])).astype(
                np.int64
            )
            about[column] = self._gain.of(
                forecast, samples.scales, halves, rng, draws=4 * len(halves)
            )[0]
        return np.maximum(about, 0.0)


def _groups(
    values: Array, columns: Columns, chosen: NDArray[np.int64]
) -> Sequence[tuple[int, NDArray[np.int64]]]:
    return [(int(column), chosen[:, index]) for index, column in enumerate(columns)]
