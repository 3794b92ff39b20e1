"""The models that a run ends with, best first: a search's population, or samples of a posterior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import Array
from estimator.storage.database import reading
from estimator.storage.records import Generation
from estimator.storage.store import RunStore


@dataclass(frozen=True, kw_only=True)
class FinalPopulation:
    """The models at a run's last checkpoint; empty before the first.

    Attributes:
        genes: Shape (n, genes).
        errors: Subjective errors, shape (n,): by the reference back-end where it was asked.
        searched: The same as the search saw them.
        order: Indices, best first. Models that the reference back-end simulated come before the
            others, in its order.
    """

    genes: Array
    errors: Array
    searched: Array
    order: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.genes)

    @property
    def best(self) -> int:
        """Index of the best model."""
        return int(self.order[0])

    @classmethod
    def of(cls, store: RunStore) -> Self:
        """Reads it from a run."""
        if store.settings.method == "posterior":
            return cls._of_beliefs(store)
        checkpoint, latest = store.checkpoint(), store.latest_generation()
        if checkpoint is None or latest is None:
            nothing = np.empty(0)
            return cls(
                genes=np.empty((0, 0)),
                errors=nothing,
                searched=nothing,
                order=np.empty(0, dtype=np.intp),
            )
        finish = store.search_end.finish()
        with reading(store.directory):
            genes = np.array(checkpoint.state["population"], dtype=float)
            searched = np.array(latest.errors, dtype=float)
            if genes.shape[:1] != searched.shape:
                raise ValueError(f"{len(genes)} models have {len(searched)} errors")
            store.check_genes(genes)
            errors, later = searched.copy(), np.ones(len(searched), dtype=bool)
            if finish is not None:
                errors[list(finish.models)] = finish.simulated
                later[list(finish.models)] = False
        return cls(genes=genes, errors=errors, searched=searched, order=np.lexsort((errors, later)))

    @classmethod
    def _of_beliefs(cls, store: RunStore) -> Self:
        """The best body, with the medians of its lengths, and then the samples.

        Samples have no subjective errors of their own.
        """
        beliefs = store.beliefs()
        if not beliefs:
            nothing = np.empty(0)
            order = np.empty(0, dtype=np.intp)
            return cls(genes=np.empty((0, 0)), errors=nothing, searched=nothing, order=order)
        belief, _ = beliefs[-1]
        with reading(store.directory):
            genes = np.array([belief.best, *belief.genes], dtype=float)
            weights = np.array([np.inf, *belief.weights], dtype=float)
        unknown = np.full(len(genes), np.nan)
        order = np.argsort(-weights, kind="stable")
        return cls(genes=genes, errors=unknown, searched=unknown, order=order)


def with_last_word(store: RunStore) -> list[Generation]:
    """A run's generations, and after them the reference back-end's word as one more, if it had one.

    The best model of the last one is the best of the run, with the error that all tables give it.
    """
    generations = store.generations()
    finish = store.search_end.finish()
    if finish is None or not finish.models:
        return generations
    population, last = FinalPopulation.of(store), generations[-1]
    word = replace(
        last,
        number=last.number + 1,
        iteration=last.iteration + 1,
        errors=finish.simulated,
        best=tuple(population.genes[population.best].tolist()),
    )
    return [*generations, word]
