"""A run in numbers: what ``result.json`` holds."""

from __future__ import annotations

import inspect
import json
import re
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, ValidationError, computed_field

from estimator.report.posterior_report import PosteriorReport
from estimator.storage.posteriors import FitVerdict, Interval
from estimator.storage.records import BestFit
from estimator.storage.store import RunStore
from estimator.versions import versions

RESULT: Final = "result.json"
PAGE: Final = "report.html"
"""The last file of a finished run to be written."""


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, json_schema_serialization_defaults_required=True)


MAIN_BODY: Final = "main body"
"""What parts that sit on it say they sit on."""


class PartResult(_Record):
    """One part of a model.

    Attributes:
        name: Its name in the problem.
        parent: Name of the part that it sits on, or ``main body``.
        mount: Where on its parent.
        hinge: How a positive angle moves it.
        length_m: Joint axis to outermost tip, m.
        joint: The joint that turns it; ``None`` where it is locked.
        agreement: Share of a posterior's samples that attach it in the same way: parent, mount,
            hinge. ``None`` without a posterior: a population that has converged agrees anyway.
    """

    name: str
    parent: str
    mount: str
    hinge: str
    length_m: float
    joint: str | None
    agreement: float | None


class ModelResult(_Record):
    """One model.

    Attributes:
        sensor_error: Its subjective error; by the reference where that had the last word; ``None``
            where its simulations are invalid.
        searched_error: Its subjective error by the physics that searched.
        leg_lengths_m: Length of each leg (what one motor turns as one piece), m.
        parts: Its configuration.
    """

    sensor_error: float | None
    searched_error: float | None
    leg_lengths_m: tuple[float, ...]
    parts: tuple[PartResult, ...]


class LegResult(_Record):
    """What is known about one leg.

    Attributes:
        joint: The joint that turns it.
        mount: Where it sits on the best model.
        length_m: Its length on the best model, m.
        population_m: Its shortest and longest length in the final population, m: how far a search
            has converged, and not how sure the length is. ``None`` where a posterior says that.
        touched: Whether it touched the ground in some interaction; ``None`` where no sensor said.
    """

    joint: str
    mount: str
    length_m: float
    population_m: tuple[float, float] | None
    touched: bool | None

    @property
    def touched_in_words(self) -> str:
        """Whether it touched the ground."""
        return in_words(self.touched)


def in_words(touched: bool | None) -> str:
    """Whether a leg touched the ground; ``None`` where no sensor said."""
    return "not sensed" if touched is None else "yes" if touched else "never"


class FitReport(BestFit):
    """How the best model of a finished search explains the readings.

    Attributes:
        contradictions: Between the problem and what the robot states of itself.
        verdict: Whether it explains them, as sentences.
    """

    contradictions: tuple[str, ...]
    verdict: str

    # mypy knows no decorators on properties; pydantic's manual says to ignore that.
    @computed_field  # type: ignore[prop-decorator]
    @property
    def explained(self) -> bool:
        """Whether it explains them, but for outliers, and the problem is the robot's."""
        return super().explained and not self.contradictions


class ReferenceResult(_Record):
    """How far the reference, which has the last word, agrees with the physics that searched.

    Attributes:
        models: Leading distinct models that were simulated again.
        pairs: Pairs of them.
        pairs_turned: Pairs of which the two disagree which model is better.
        best_changed: Whether the reference prefers another model to the search's best.
    """

    models: int
    pairs: int
    pairs_turned: int
    best_changed: bool


class Result(_Record):
    """The outcome of a run, so far.

    Attributes:
        complete: Whether the run has come to its end, what a simulator says of it included.
        method: ``paper`` or ``posterior``.
        problem: Name of the problem.
        problem_asked: What was asked for: the name of one that ships, or its file.
        searched: Names of the genes: what the problem leaves open.
        physics: Back-end that predicted the readings of models.
        reference: Back-end that had the last word, where that is another.
        search: What optimised the population of the method ``paper``; like the objective, what
            counts its models and its generations, and what came of its simulations, ``None`` for
            the method ``posterior``.
        objective: What that minimised.
        explore: What chose the motor programs, unless they were recorded.
        modalities: Modalities that the subjective error counts.
        seed: Source of all randomness.
        population: Models in the population.
        generations: Generations after each interaction.
        versions: Of everything that computed.
        robot_uri: Where the readings came from.
        robot: The robot's capability dictionary.
        interactions: Interactions performed.
        simulations_requested: Models x motor programs that the search asked for.
        simulations_run: How many of them had to be simulated.
        simulations_invalid: How many of those were invalid, which counts as the worst error.
        simulations_undecided: How many of those had no weight, since the body lay in balance.
        steps: Physics steps simulated.
        wall_seconds: Time spent.
        sensor_error: Smallest subjective error in the population; ``None`` before the first, and
            where no model could be simulated.
        legs: The legs, in motor order.
        best_models: The best models, best first.
        finish: How far the reference agrees, where something else searched.
        fit: Whether the best model explains the readings, once the method paper has ended.
        posterior: What the posterior says, by the method posterior.
        warnings: What a person should know before trusting this.
    """

    complete: bool
    method: str = "paper"
    problem: str
    problem_asked: str = ""
    searched: tuple[str, ...]
    physics: str
    reference: str = "pybullet"
    search: str | None
    objective: str | None
    explore: str = "random"
    modalities: tuple[str, ...]
    seed: int
    population: int | None
    generations: int | None
    versions: dict[str, str]
    robot_uri: str
    robot: dict[str, Any]
    interactions: int
    simulations_requested: int
    simulations_run: int
    simulations_invalid: int | None
    simulations_undecided: int | None
    steps: int
    wall_seconds: float
    sensor_error: float | None
    legs: tuple[LegResult, ...]
    best_models: tuple[ModelResult, ...]
    finish: ReferenceResult | None
    fit: FitReport | None = None
    posterior: PosteriorReport | None = None
    warnings: tuple[str, ...]

    @classmethod
    def of_finished(cls, store: RunStore) -> Result | None:
        """What a finished run's ``result.json`` holds, and its other files: nothing changes it.

        Returns:
            ``None`` where the run is not finished, or has no report, or the file is missing,
            damaged, or another version's.
        """
        if not (store.complete and (store.directory / PAGE).exists()):
            return None
        try:
            kept = cls.model_validate_json((store.directory / RESULT).read_bytes())
        except (OSError, ValidationError):
            return None
        return kept if kept.complete and kept.versions == versions_of(store) else None

    @property
    def judged(self) -> PosteriorReport | FitReport | None:
        """What says whether any body explains the readings; ``None``: nothing does yet."""
        return self.posterior or self.fit

    @property
    def leg_intervals(self) -> tuple[Interval, ...]:
        """Length of each leg, m, as the posterior has it, or with its range in the population."""
        if self.posterior is not None:
            return self.posterior.lengths_m
        ends = [leg.population_m or (leg.length_m, leg.length_m) for leg in self.legs]
        return tuple(
            Interval(low=low, median=leg.length_m, high=high)
            for leg, (low, high) in zip(self.legs, ends, strict=True)
        )


def versions_of(store: RunStore) -> dict[str, str]:
    """Of everything that computes what is said of a run."""
    return versions() | dict(store.settings.plugins)


_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_ATTRIBUTE: Final = re.compile(r"^ {4}(\w+): ((?:.+\n?)(?: {8}.+\n?)*)", re.MULTILINE)


def result_schema() -> dict[str, Any]:
    """What ``result.json`` holds, with the docstrings of its records as descriptions."""
    schema = Result.model_json_schema(mode="serialization")
    for record in (schema, *schema["$defs"].values()):
        record["description"] = _describe(record, record["description"])
    for kind in (PosteriorReport, FitReport):
        for base in kind.__mro__[1:]:
            if issubclass(base, FitVerdict):
                _describe(schema["$defs"][kind.__name__], inspect.getdoc(base) or "")
    return {"$schema": _DIALECT, **schema, "title": "result.json"}


def _describe(record: dict[str, Any], docstring: str) -> str:
    """Gives a record's fields the descriptions of a docstring; returns its summary."""
    summary, _, attributes = docstring.partition("\n\nAttributes:\n")
    for name, text in _ATTRIBUTE.findall(attributes):
        record["properties"][name]["description"] = " ".join(text.split())
    return summary


if __name__ == "__main__":
    print(json.dumps(result_schema(), indent=2))
