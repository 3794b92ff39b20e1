"""Crossover, mutation and distance, by name.

The paper says "a genetic algorithm using deterministic crowding (Mahfoud, 1995)" on real-valued
genes in [0, 1] and no more. What it leaves open is chosen here, and can be chosen otherwise in a
problem file. Operators work on whole generations: row i of every array belongs to pair i.

Genes stay in [0, 1] by reflection at the ends: clipping would pile parts up at the shortest and
longest lengths.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

Array: TypeAlias = NDArray[np.float64]
Distance: TypeAlias = Callable[[Array, Array], Array]
"""Two arrays of shape (m, genes) in, distance of each row's two members out, shape (m,)."""

Permit: TypeAlias = Callable[[Array], Array]
"""Genomes in, shape (m, genes), with forbidden ones changed into others out."""

# These are read by pydantic when a problem file names an operator.
Share: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Width: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]

_STRICT: Final = {"extra": "forbid"}


@dataclass(frozen=True, kw_only=True)
class UniformCrossover:
    """Each gene changes places within the pair with probability one half.

    Attributes:
        rate: Share of the pairs that are crossed at all.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = _STRICT
    kind: Literal["uniform"] = "uniform"
    rate: Share = 1.0

    def __call__(
        self, first: Array, second: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Two children per pair."""
        swap = rng.random(first.shape) < 0.5
        swap &= rng.random((len(first), 1)) < self.rate
        return np.where(swap, second, first), np.where(swap, first, second)


@dataclass(frozen=True, kw_only=True)
class BlendCrossover:
    """Each gene is drawn from the interval between the parents, widened (BLX-α).

    Eshelman and Schaffer 1993. With α = 0.5 a gene lands outside its parents' interval as often as
    inside, so crossover alone does not draw the population together, and yet its steps shrink
    as the population converges.

    Attributes:
        alpha: How far the interval reaches beyond either parent, as a share of their distance.
        rate: Share of the pairs that are crossed at all.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = _STRICT
    kind: Literal["blend"] = "blend"
    alpha: Width = 0.5
    rate: Share = 1.0

    def __call__(
        self, first: Array, second: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Two children per pair."""
        weights = rng.uniform(-self.alpha, 1 + self.alpha, (2, *first.shape))
        crossed = rng.random((len(first), 1)) < self.rate
        first_child = np.where(crossed, first + weights[0] * (second - first), first)
        second_child = np.where(crossed, second + weights[1] * (first - second), second)
        return reflect(first_child), reflect(second_child)


@dataclass(frozen=True, kw_only=True)
class GaussianMutation:
    """Adds a normal step to some genes.

    Attributes:
        rate: Probability of a step, per gene; ``None`` means one gene per child on average.
        sigma: Standard deviation of a step, as a share of the gene's range.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = _STRICT
    kind: Literal["gaussian"] = "gaussian"
    rate: Share | None = None
    sigma: Width = 0.05

    def __call__(self, genes: Array, rng: np.random.Generator) -> Array:
        """The mutated genes."""
        stepped = rng.random(genes.shape) < _rate(self.rate, genes)
        return reflect(genes + stepped * rng.normal(0.0, self.sigma, genes.shape))


@dataclass(frozen=True, kw_only=True)
class ResetMutation:
    """Draws some genes anew: a step in a gene that stands for a choice means nothing.

    Attributes:
        rate: Probability of a new value, per gene; ``None`` means one gene per child on average.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = _STRICT
    kind: Literal["reset"] = "reset"
    rate: Share | None = None

    def __call__(self, genes: Array, rng: np.random.Generator) -> Array:
        """The mutated genes."""
        drawn = rng.random(genes.shape) < _rate(self.rate, genes)
        return np.where(drawn, rng.random(genes.shape), genes)


Crossover: TypeAlias = UniformCrossover | BlendCrossover
Mutation: TypeAlias = GaussianMutation | ResetMutation


def euclidean(first: Array, second: Array) -> Array:
    """Euclidean distance of genomes, every gene counting alike."""
    distances: Array = np.linalg.norm(first - second, axis=1)
    return distances


def as_they_are(genes: Array) -> Array:
    """Returns genes unchanged, for problems in which none are forbidden."""
    return genes


@dataclass(frozen=True, kw_only=True)
class Operators:
    """What a genetic algorithm does to genes.

    Attributes:
        crossover: Makes two children of two parents.
        mutation: Changes a child.
        distance: Says which parent a child resembles; genotypic, because the paper names no other.
        permit: Changes genomes that are forbidden into others; shape (n, genes) in and out.
    """

    crossover: Crossover = field(default_factory=BlendCrossover)
    mutation: Mutation = field(default_factory=GaussianMutation)
    distance: Distance = euclidean
    permit: Permit = as_they_are


def reflect(genes: Array) -> Array:
    """Folds values outside [0, 1] back into it, however far they strayed."""
    folded: Array = 1.0 - np.abs(genes % 2.0 - 1.0)
    return folded


def _rate(rate: float | None, genes: Array) -> float:
    return 1 / genes.shape[1] if rate is None else rate
