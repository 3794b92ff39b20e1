"""A population of chains on levels of noise: evolutionary Monte Carlo (Liang and Wong 2001).

A genetic algorithm whose selection is Metropolis's. Level 0 has the posterior as its target; on the
levels above, the noise of the readings is taken to be wider, so that a body is guided from 20° away
(an exponent on the likelihood would leave it on the plateau of the outliers). Neighbouring levels
exchange their chains. Of each chain the misfits are kept, so an exchange costs no simulation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Self

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.moves import exchange_parts, propose
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import drawn_scales, log_prior
from estimator.posterior.model.sensor_data import BRANCH, MISFITS
from estimator.posterior.model.unknowns import Columns, Predictor

HOTTEST: Final = 25.0
"""Factor on the noise on the hottest level."""

EVERY: Final = 5
"""Steps between two samples."""

_CROSSINGS: Final = 0.25  # probability per step that chains exchange parts
_SCALE_STEP: Final = 0.3  # standard deviation of a step of a noise factor's logarithm


class Population:
    """Chains of one population; ``step`` moves them once they have observed something.

    Args:
        predictor: Predictor of this population alone.
        rng: Random generator of this population alone.
        values: Points of the cube, level by level, shape (levels · chains_per_level, size).
        scales: Logarithms of the points' factors on tilt's and clearance's noise, shape (…, 2).
        levels: Number of levels; each has equally many points, a multiple of 4.

    Attributes:
        values: As above, like ``scales`` and ``levels``.
        chains_per_level: Number of chains on a level.
    """

    def __init__(
        self,
        predictor: Predictor,
        rng: np.random.Generator,
        values: Array,
        scales: Array,
        *,
        levels: int = 1,
    ) -> None:
        self._predictor = predictor
        self._rng = rng
        self.values = values
        self.scales = scales
        self.levels = levels
        self.chains_per_level = len(values) // levels
        self._noise_scales = np.repeat(HOTTEST ** np.linspace(0, 1, levels), self.chains_per_level)

    @classmethod
    def of_prior(
        cls, predictor: Predictor, rng: np.random.Generator, *, levels: int, chains_per_level: int
    ) -> Self:
        """Chains that are drawn from the prior, ``chains_per_level`` of them on each level."""
        values = rng.random((levels * chains_per_level, predictor.unknowns.size))
        return cls(
            predictor,
            rng,
            predictor.unknowns.permitted(values),
            drawn_scales((levels * chains_per_level, 2), rng),
            levels=levels,
        )

    def observe(self, likelihood: Likelihood, *, surely: bool) -> None:
        """Takes in all that was observed so far; the chains stay where they are.

        Args:
            likelihood: Likelihood of all of it.
            surely: Whether every chain is taken to fall as statics has it, and every proposal to
                the side to which its chain has fallen. That costs less: for chains that search.
        """
        self._likelihood, self._surely = likelihood, surely
        self._misfits = np.empty((len(self.values), len(likelihood), MISFITS))
        self._update_fits(slice(None))

    def restart(self) -> None:
        """Draws all chains from the prior; only before sampling."""
        drawn = self._rng.random(self.values.shape)
        self.values = self._predictor.unknowns.permitted(drawn)
        self.scales = drawn_scales(self.scales.shape, self._rng)
        self._update_fits(slice(None))

    def replace_coldest(self, values: Array, scales: Array) -> None:
        """Puts other points on level 0, shape (chains_per_level, size); only before sampling."""
        cold = slice(0, self.chains_per_level)
        self.values[cold], self.scales[cold] = values, scales
        self._update_fits(cold)

    def step(self) -> None:
        """Moves every chain once, and exchanges levels. The joint target is left invariant."""
        rows = np.arange(len(self.values))
        for half in (0, 1):
            self._move(rows[half::2], rows[1 - half :: 2])
        if self._rng.random() < _CROSSINGS:
            self._cross()
        self._rescale()
        self._exchange_levels()

    def coldest(self) -> Self:
        """The chains of level 0 by themselves, which may fall to any side: they draw samples."""
        cold = slice(0, self.chains_per_level)
        chains = type(self)(
            self._predictor, self._rng, self.values[cold].copy(), self.scales[cold].copy()
        )
        chains.observe(self._likelihood, surely=False)
        return chains

    def posterior_fits(self, levels: int) -> Array:
        """Log-likelihood of the chains of the lowest levels under level 0's noise, shape (n,).

        Noise factors are integrated out instead of the chains' own: bodies are compared by it.
        """
        return self._likelihood.integrated(self._misfits[: levels * self.chains_per_level])

    def state(self) -> Mapping[str, Any]:
        """All that ``from_state`` needs, for JSON."""
        return {
            "levels": self.levels,
            "values": self.values.tolist(),
            "scales": self.scales.tolist(),
            "random": self._rng.bit_generator.state,
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any], predictor: Predictor) -> Self:
        """Restores the population from its ``state``; it has to observe again."""
        rng = np.random.default_rng()
        rng.bit_generator.state = state["random"]
        values, scales = (np.array(state[name], dtype=float) for name in ("values", "scales"))
        return cls(predictor, rng, values, scales, levels=int(state["levels"]))

    def _update_fits(self, rows: slice) -> None:
        self._misfits[rows] = self._likelihood.misfits_of(
            self._predictor, self.values[rows], branches=0 if self._surely else None
        )
        self._fits = self._likelihood.of(self._misfits, self._noise_scales, self.scales)

    def _move(self, rows: Columns, still: Columns) -> None:
        """Proposes new points for half of the chains, and takes those that are accepted."""
        rng, half = self._rng, self.chains_per_level // 2
        level = rows // self.chains_per_level
        first = rng.integers(half, size=rows.size)
        second = (first + rng.integers(1, half, size=rows.size)) % half
        partners = np.stack([still[level * half + first], still[level * half + second]], axis=1)
        proposed = propose(self.values, rows, partners, self._predictor.unknowns, rng)
        limits = np.log(rng.random(rows.size)) + self._fits[rows].sum(axis=1)
        allowed = ~self._predictor.unknowns.forbidden(proposed)
        rows, proposed = rows[allowed], proposed[allowed]
        misfits, fits = self._proposed(rows, proposed)
        accepted = fits.sum(axis=1) > limits[allowed]
        self._take(rows[accepted], proposed[accepted], misfits[accepted], fits[accepted])

    def _proposed(self, rows: Columns, fresh: Array) -> tuple[Array, Array]:
        """Misfits of points that some chains may move to, and their log-likelihoods there."""
        branches = self._misfits[rows][..., BRANCH] if self._surely else None
        misfits = self._likelihood.misfits_of(self._predictor, fresh, branches=branches)
        return misfits, self._likelihood.of(misfits, self._noise_scales[rows], self.scales[rows])

    def _take(self, rows: Columns, values: Array, misfits: Array, fits: Array) -> None:
        self.values[rows], self._misfits[rows], self._fits[rows] = values, misfits, fits

    def _cross(self) -> None:
        """Exchanges a part between chains of one level, in pairs that accept together."""
        rng, unknowns = self._rng, self._predictor.unknowns
        chains = np.arange(len(self.values)).reshape(self.levels, self.chains_per_level)
        halves = np.split(rng.permuted(chains, axis=1), 2, axis=1)
        first, second = (half.ravel() for half in halves)
        proposed = np.concatenate(
            exchange_parts(self.values[first], self.values[second], unknowns, rng)
        )
        allowed = np.tile(~unknowns.forbidden(proposed).reshape(2, -1).any(axis=0), 2)
        pair, proposed = np.concatenate([first, second])[allowed], proposed[allowed]
        misfits, fits = self._proposed(pair, proposed)
        gain = (fits - self._fits[pair]).sum(axis=1).reshape(2, -1).sum(axis=0)
        accepted = np.tile(np.log(rng.random(len(gain))) < gain, 2)
        self._take(pair[accepted], proposed[accepted], misfits[accepted], fits[accepted])

    def _rescale(self) -> None:
        """Moves the noise factors, which costs no simulation."""
        rng, old = self._rng, self.scales
        proposed = old + rng.normal(0, _SCALE_STEP, old.shape) * (rng.random(old.shape) < 0.5)
        fits = self._likelihood.of(self._misfits, self._noise_scales, proposed)
        prior = (log_prior(proposed) - log_prior(old)).sum(axis=1)
        gain = (fits - self._fits).sum(axis=1) + prior
        accepted = np.log(rng.random(len(old))) < gain
        self.scales[accepted], self._fits[accepted] = proposed[accepted], fits[accepted]

    def _exchange_levels(self) -> None:
        rng, count = self._rng, self.chains_per_level
        for start in (0, 1):
            lower = np.arange(start, self.levels - 1, 2)
            cold = (lower[:, None] * count + np.arange(count)).ravel()
            hot = rng.permuted(cold.reshape(-1, count) + count, axis=1).ravel()
            up = self._likelihood.of(
                self._misfits[cold], self._noise_scales[hot], self.scales[cold]
            )
            down = self._likelihood.of(
                self._misfits[hot], self._noise_scales[cold], self.scales[hot]
            )
            gain = (up + down - self._fits[cold] - self._fits[hot]).sum(axis=1)
            accepted = np.log(rng.random(cold.size)) < gain
            a, b = cold[accepted], hot[accepted]
            for array in (self.values, self.scales, self._misfits):
                array[a], array[b] = array[b], array[a]
            self._fits[a], self._fits[b] = down[accepted], up[accepted]
