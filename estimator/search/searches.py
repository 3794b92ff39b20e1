"""Searches by name, and what a search is.

A search of another package belongs to the entry-point group ``bodyschema.search``: a class with the
methods below.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Protocol, Self

import numpy as np

from estimator.plugins import Registry
from estimator.search.operators import Array, Operators


class Search(Protocol):
    """A population that is optimised by ask and tell; the user brings the evaluator.

    While the errors of the population are unknown, ``ask`` hands out the population itself.

    Attributes:
        algorithm: Its name, which ``state`` holds too, so that no other goes on with it.
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
        """Error at which each genome that was asked for has lost; infinite: it must be exact."""

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
            "deterministic-crowding": "estimator.search.deterministic_crowding:"
            "DeterministicCrowding",
        }
    ),
)
