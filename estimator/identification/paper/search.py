"""The interface of a search, and searches by name.

A search of another package belongs to the entry-point group ``bodyschema.search``: a class with the
methods below.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from estimator.errors import SearchOrderError, SearchStateError
from estimator.plugins import Registry
from estimator.problem.operators import Array, Operators


class Search(Protocol):
    """A population that is optimised by ask and tell; the user brings the evaluator.

    While the errors of the population are unknown, ``ask`` hands out the population itself.

    Attributes:
        algorithm: Name of the algorithm; ``state`` holds it too, so that no other continues it.
    """

    algorithm: str

    def __init__(
        self, size: int, genes: int, rng: np.random.Generator, *, operators: Operators
    ) -> None: ...

    @classmethod
    def from_state(cls, state: Mapping[str, Any], *, operators: Operators) -> Self:
        """The search that ``state`` describes; it goes on identically.

        Raises:
            SearchStateError: The state is damaged.
        """

    @property
    def population(self) -> Array:
        """The members' genes, shape (size, genes), each in 0 to 1."""

    @property
    def errors(self) -> Array:
        """The members' errors, shape (size,)."""

    @property
    def best(self) -> int:
        """Index of the member with the smallest error."""

    @property
    def limits(self) -> Array:
        """Error at which each genome that was asked for has lost; infinite: tell the exact one."""

    def ask(self) -> Array:
        """Genes to evaluate, shape (n, genes)."""

    def tell(self, errors: Array) -> None:
        """Takes the errors of what ``ask`` handed out, shape (n,); NaN loses."""

    def forget_errors(self) -> None:
        """Declares the errors void, because there is a new observation to fit."""

    def state(self) -> dict[str, Any]:
        """Everything needed to go on exactly as now, as plain values for JSON.

        Reports read the genes of the members from it, as ``population``.
        """


SEARCHES: Final[Registry[type[Search]]] = Registry(
    kind="search",
    group="bodyschema.search",
    own=MappingProxyType(
        {
            "deterministic-crowding": "estimator.identification.paper.search:DeterministicCrowding",
        }
    ),
)


_GENERATORS: Final = {"PCG64": np.random.PCG64, "PCG64DXSM": np.random.PCG64DXSM}


class DeterministicCrowding:
    """A population that is optimised while its niches are kept.

    Args:
        size: Number of members of the population; even, because they mate in pairs.
        genes: Number of genes of a member, each in [0, 1].
        rng: The search's own source of randomness, as ``numpy.random.default_rng`` makes it.
        operators: Crossover, mutation and distance.
        population: The first population, shape (size, genes); drawn at random when absent.

    Raises:
        SearchStateError: The size is odd, there are no genes, or the state of ``rng`` cannot be
            saved.
    """

    algorithm = "deterministic crowding"

    def __init__(
        self,
        size: int,
        genes: int,
        rng: np.random.Generator,
        *,
        operators: Operators | None = None,
        population: Array | None = None,
    ) -> None:
        if size < 2 or size % 2:
            raise SearchStateError(f"the population must be even and at least 2, not {size}")
        if genes < 1:
            raise SearchStateError(f"a genome must have at least one gene, not {genes}")
        if type(rng.bit_generator).__name__ not in _GENERATORS:
            raise SearchStateError(
                f"the random generator must be {' or '.join(_GENERATORS)}, not "
                f"{type(rng.bit_generator).__name__}: pass numpy.random.default_rng(seed)"
            )
        self._rng = rng
        self._operators = operators or Operators()
        if population is None:
            population = self._operators.permit(rng.random((size, genes)))
        self._population = _checked_genes(population, (size, genes))
        self._errors: Array | None = None
        self._generation = 0
        self._children: Array | None = None
        self._rivals: NDArray[np.intp] = np.arange(size)
        self._awaits_errors = False
        self._rng_state = rng.bit_generator.state

    @property
    def population(self) -> Array:
        """The members' genes, shape (size, genes)."""
        return self._population.copy()

    @property
    def errors(self) -> Array:
        """The members' errors, shape (size,); infinite for members that could not be evaluated.

        Raises:
            SearchOrderError: They are unknown: the population must first be asked for and told.
        """
        if self._errors is None:
            raise SearchOrderError(
                "the population's errors are unknown: call ask(), evaluate, then tell(errors)"
            )
        return self._errors.copy()

    @property
    def best(self) -> int:
        """Index of the member with the smallest error; the first of equals."""
        return int(np.argmin(self.errors))

    @property
    def limits(self) -> Array:
        """Error that each genome that was asked for must beat, shape (size,).

        A child whose error turns out to be no smaller than its limit loses whatever the exact
        figure, so its evaluation may stop there and tell any number from the limit upwards.
        Infinite for members of the population, whose errors must be exact.

        Raises:
            SearchOrderError: Nothing was asked for.
        """
        if not self._awaits_errors:
            raise SearchOrderError("limits belong to what was asked for: call ask() first")
        if self._errors is None:
            return np.full(len(self._population), np.inf)
        return self._errors[self._rivals]

    def ask(self) -> Array:
        """Genes to evaluate, shape (size, genes).

        Raises:
            SearchOrderError: The last ones were not told yet.
        """
        if self._awaits_errors:
            raise SearchOrderError("ask() was called twice: call tell(errors) in between")
        self._awaits_errors = True
        if self._errors is None:
            return self._population.copy()
        self._children, self._rivals = self._breed()
        return self._children.copy()

    def tell(self, errors: Array) -> None:
        """Takes the errors of what ``ask`` handed out.

        Args:
            errors: Errors, shape (size,). NaN loses, like infinity.

        Raises:
            SearchOrderError: Nothing was asked for.
            SearchStateError: The shape is wrong, or an error is minus infinity.
        """
        if not self._awaits_errors:
            raise SearchOrderError("tell(errors) answers ask(): call ask() first")
        checked = _checked_errors(errors, len(self._population))
        if self._children is None or self._errors is None:
            self._errors = checked
        else:
            wins = checked < self._errors[self._rivals]
            winners = self._rivals[wins]
            self._population[winners] = self._children[wins]
            self._errors[winners] = checked[wins]
            self._generation += 1
        self._awaits_errors = False
        self._children = None
        self._rng_state = self._rng.bit_generator.state

    def forget_errors(self) -> None:
        """Declares the errors void, because there is a new observation to fit.

        The population stays, and is what the next ``ask`` hands out.

        Raises:
            SearchOrderError: Something was asked for and not told yet.
        """
        if self._awaits_errors:
            raise SearchOrderError("forget_errors() was called between ask() and tell(errors)")
        self._errors = None

    def state(self) -> dict[str, Any]:
        """Everything needed to go on exactly as now, as plain values for JSON.

        Between ``ask`` and ``tell`` it is the state before ``ask``, which is to be called again.
        """
        errors = None
        if self._errors is not None:
            errors = [error if np.isfinite(error) else None for error in self._errors.tolist()]
        return {
            "algorithm": self.algorithm,
            "generation": self._generation,
            "population": self._population.tolist(),
            "errors": errors,
            "random": self._rng_state,
        }

    @classmethod
    def from_state(
        cls, state: Mapping[str, Any], *, operators: Operators | None = None
    ) -> DeterministicCrowding:
        """The search that ``state`` describes; with the same operators it goes on identically.

        Raises:
            SearchStateError: The state is incomplete or contradicts itself.
        """
        try:
            population = np.array(state["population"], dtype=float)
            size, genes = population.shape
            random = state["random"]
            generator = _GENERATORS[random["bit_generator"]](0)
            generator.state = random
            errors = state["errors"]
            if errors is not None:
                errors = [np.inf if error is None else error for error in errors]
                errors = _checked_errors(np.array(errors, dtype=float), size)
            generation = int(state["generation"])
        except (KeyError, TypeError, ValueError) as error:
            raise SearchStateError(
                f"the saved state of the search is damaged ({type(error).__name__}: {error}): "
                "start the run anew"
            ) from error
        rng = np.random.Generator(generator)
        search = cls(size, genes, rng, operators=operators, population=population)
        search._errors = errors
        search._generation = generation
        return search

    def _breed(self) -> tuple[Array, NDArray[np.intp]]:
        """A generation of children and, for each, the member that it competes with."""
        apply = self._operators
        mates = self._rng.permutation(len(self._population)).reshape(2, -1)
        first, second = self._population[mates[0]], self._population[mates[1]]
        child, sibling = apply.crossover(first, second, self._rng)
        child, sibling = apply.mutation(child, self._rng), apply.mutation(sibling, self._rng)
        child, sibling = apply.permit(child), apply.permit(sibling)
        straight = apply.distance(first, child) + apply.distance(second, sibling)
        crossed = apply.distance(first, sibling) + apply.distance(second, child)
        swap = crossed < straight
        rivals = np.where(swap, mates[::-1], mates)
        return np.concatenate([child, sibling]), rivals.ravel()


def _checked_genes(genes: Array, shape: tuple[int, int]) -> Array:
    population = np.array(genes, dtype=float)
    if population.shape != shape:
        raise SearchStateError(f"the population must have shape {shape}, not {population.shape}")
    if not np.all((population >= 0) & (population <= 1)):
        raise SearchStateError("every gene of the population must lie in 0 to 1")
    return population


def _checked_errors(errors: Array, size: int) -> Array:
    values = np.array(errors, dtype=float)
    if values.shape != (size,):
        raise SearchStateError(f"tell() needs {size} errors, not an array of shape {values.shape}")
    if np.any(values == -np.inf):
        raise SearchStateError("an error of minus infinity would never be replaced")
    return np.where(np.isnan(values), np.inf, values)
