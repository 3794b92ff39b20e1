"""What a package from outside might bring; ``outside_package.install`` copies this file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from estimator import (
    Choice,
    Observation,
    Operators,
    PredictedReadings,
    Result,
    SearchStateError,
    Situation,
)
from protocol import Capabilities

Array = NDArray[np.float64]


class RandomSearch:
    """A search: each member gives way to the first random genome that is better."""

    algorithm = "random search"

    def __init__(
        self, size: int, genes: int, rng: np.random.Generator, *, operators: Operators
    ) -> None:
        del operators
        self._rng = rng
        self.population = rng.random((size, genes))
        self.errors = np.full(size, np.nan)
        self._asked = self.population

    @classmethod
    def from_state(cls, state: Mapping[str, Any], *, operators: Operators) -> Self:
        try:
            population = np.array(state["population"])
            size, genes = population.shape
            search = cls(size, genes, np.random.default_rng(), operators=operators)
            search.population = population
            search.errors = np.array(state["errors"])
            search._rng.bit_generator.state = state["random"]
        except (KeyError, TypeError, ValueError) as error:
            raise SearchStateError(f"the state of the random search is damaged: {error}") from error
        return search

    @property
    def best(self) -> int:
        return int(np.argmin(self.errors))

    @property
    def limits(self) -> Array:
        return np.where(np.isnan(self.errors), np.inf, self.errors)

    def ask(self) -> Array:
        unknown = bool(np.isnan(self.errors).any())
        self._asked = self.population if unknown else self._rng.random(self.population.shape)
        return self._asked

    def tell(self, errors: Array) -> None:
        better = np.isnan(self.errors) | (errors < self.errors)
        self.population = np.where(better[:, None], self._asked, self.population)
        self.errors = np.where(better, errors, self.errors)

    def forget_errors(self) -> None:
        self.errors = np.full(len(self.population), np.nan)

    def state(self) -> dict[str, Any]:
        return {
            "algorithm": self.algorithm,
            "population": self.population.tolist(),
            "errors": self.errors.tolist(),
            "random": self._rng.bit_generator.state,
        }


class WrongTouches:
    """An objective: how many touches a model gets wrong, over all interactions."""

    def __init__(self, capabilities: Capabilities) -> None:
        del capabilities

    def terms(
        self, readings: PredictedReadings, observed: Observation, modalities: Sequence[str]
    ) -> Array:
        del modalities
        wrong = np.count_nonzero(readings.touch != observed.touch, axis=1).astype(float)
        errors: Array = np.where(readings.valid, wrong, np.inf)
        return errors

    def lower_bound(self, terms: Array) -> Array:
        bound: Array = np.sum(terms, axis=0)
        return bound

    def total(self, terms: Array, undecided: NDArray[np.bool_]) -> Array:
        del undecided
        return self.lower_bound(terms)


def steepest(situation: Situation) -> Choice:
    """An exploration rule: of ten random programs, the one that tilts the models most."""
    programs, known = situation.random_programs(10), situation.posterior
    tilts = np.abs(known.predict(programs).tilt).sum(2) @ known.weights
    winner = int(np.argmax(tilts))
    return Choice(program=programs[winner], reason=f"tilts by {tilts[winner]:.3f}")


def page(result: Result, directory: Path) -> str:
    """A report: HTML."""
    rows = "".join(
        f"<tr><td>{escape(leg.joint)}<td>{1000 * leg.length_m:.0f} mm" for leg in result.legs
    )
    image = '<img src="plots/lengths.png">' if (directory / "plots/lengths.png").exists() else ""
    return f"<!doctype html><title>{escape(result.problem)}</title><table>{rows}</table>{image}"
