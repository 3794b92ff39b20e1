"""A run in numbers: what ``result.json`` holds."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError, computed_field

from estimator.report.posterior_report import PosteriorReport
from estimator.storage.posteriors import FitVerdict, Interval, Record
from estimator.storage.records import BestFit
from estimator.storage.store import RunStore
from estimator.versions import versions
from protocol.system.files import replace_text

RESULT: Final = "result.json"
PAGE: Final = "report.html"

_Document = TypeVar("_Document", bound=BaseModel)

MAIN_BODY: Final = "main body"
"""Name of the parent of parts that sit on the main body."""


class PartResult(Record):
    """One part of a model.

    Attributes:
        name: Name of the part in the problem.
        parent: Name of the part that it sits on, or ``main body``.
        mount: Mount of the parent that the part sits on.
        hinge: Hinge of the part: how a positive angle moves it.
        length_m: Length of the part from its joint's axis to its outermost tip, m.
        joint: Name of the joint that turns the part; ``None`` where it is locked.
        agreement: Share of the posterior that attaches the part in the same way: parent, mount,
            hinge. ``None`` without a posterior: a population that has converged agrees anyway.
    """

    name: str
    parent: str
    mount: str
    hinge: str
    length_m: float
    joint: str | None
    agreement: float | None


class ModelResult(Record):
    """One model of the robot's body.

    Attributes:
        sensor_error: Subjective error of the model, by the reference back-end where that simulated
            it; ``None`` where its simulations are invalid, and of the method ``posterior``.
        searched_error: Subjective error of the model by the physics that the search used; ``None``
            where simulations by it are invalid, and of the method ``posterior``.
        leg_lengths_m: Length of each leg (what one motor turns as one piece), m, in motor order.
        parts: Parts of the model, and how each is attached.
    """

    sensor_error: float | None
    searched_error: float | None
    leg_lengths_m: tuple[float, ...]
    parts: tuple[PartResult, ...]


class LegResult(Record):
    """What is known about one leg.

    Attributes:
        joint: Name of the joint that turns the leg.
        mount: Mount of the leg on the best model.
        length_m: Length of the leg on the best model, m.
        population_m: Shortest and longest length of the leg in the final population, m: how far the
            search has converged, not how certain the length is. ``None`` with a posterior, which
            says how certain it is.
        touched: Whether the leg touched the ground in some interaction; ``None``: not sensed.
    """

    joint: str
    mount: str
    length_m: float
    population_m: tuple[float, float] | None
    touched: bool | None

    @property
    def touched_in_words(self) -> str:
        """Whether the leg touched the ground, in words."""
        return in_words(self.touched)


def in_words(touched: bool | None) -> str:
    """Whether a leg touched the ground, in words; ``None``: not sensed."""
    return "not sensed" if touched is None else "yes" if touched else "never"


class FitReport(BestFit):
    """How the best model of a finished search explains the readings.

    Attributes:
        contradictions: Contradictions between the problem and what the robot states of itself.
        verdict: Whether the best model explains the readings, as sentences.
    """

    contradictions: tuple[str, ...]
    verdict: str

    # mypy knows no decorators on properties; pydantic's manual says to ignore that.
    @computed_field  # type: ignore[prop-decorator]
    @property
    def explained(self) -> bool:
        """Whether the model explains all but outliers, and the problem is the robot's."""
        return super().explained and not self.contradictions


class ReferenceResult(Record):
    """How far the reference back-end, whose ranking counts, agrees with the physics that searched.

    Attributes:
        models: Number of leading distinct models that it simulated again.
        pairs: Number of pairs of these models.
        pairs_turned: Number of pairs of which the two back-ends disagree which model is better.
        best_changed: Whether it prefers another model to the search's best.
    """

    models: int
    pairs: int
    pairs_turned: int
    best_changed: bool


class Result(Record):
    """The outcome of a run, so far.

    Attributes:
        complete: Whether the run is finished, its last check by the reference back-end included.
        method: Method of the run, ``paper`` or ``posterior``.
        problem: Name of the problem.
        problem_asked: Problem as it was asked for: the name of a shipped one, or its file.
        searched: Names of the genes: what the problem leaves open.
        physics: Back-end that predicted the readings of models.
        reference: Reference back-end, in which samples, or leading models that another back-end
            found, are simulated again in the end.
        search: Search that optimised the population of the method ``paper``. For the method
            ``posterior`` this is ``None``, as are ``objective``, ``population``, ``generations``,
            ``simulations_invalid`` and ``simulations_undecided``.
        objective: Objective that the search minimised.
        explore: Rule that chose the motor programs, unless they were recorded.
        modalities: Sensor modalities that count.
        seed: Seed of all randomness.
        population: Number of models in the population.
        generations: Number of generations after each interaction.
        versions: Versions of everything that computed the result, by name.
        robot_uri: Address of the robot, or of the recorded readings.
        robot: The robot's capability dictionary.
        interactions: Number of interactions performed.
        simulations_requested: Number of simulations, models x motor programs, that the search asked
            for.
        simulations_run: Number of simulations that had to be run.
        simulations_invalid: Number of those run that were invalid, which counts as the worst error.
        simulations_undecided: Number of those run that had no weight, as the body lay in balance.
        steps: Number of physics steps simulated.
        wall_seconds: Time spent, s.
        sensor_error: Subjective error of the best model; ``None`` before there is one, where no
            model could be simulated, and for the method ``posterior``.
        legs: The legs, in motor order.
        best_models: The best models, best first.
        finish: How far the reference back-end agrees with the one that searched, if it is another.
        fit: How the best model explains the readings, once a run of the method ``paper`` has ended.
        posterior: Report on the posterior, for the method ``posterior``.
        warnings: What a person should know before trusting the result, as sentences.
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
        """Reads the ``result.json`` of a finished run, which nothing changes any more.

        Returns:
            The result; ``None`` where the run is not finished, or has no report, or the file is
            missing, damaged, or another version's.
        """
        if not (store.complete and (store.directory / PAGE).exists()):
            return None
        result = read_document(store.directory / RESULT, cls)
        if result is None or not result.complete or result.versions != versions_of(store):
            return None
        return result

    @property
    def judged(self) -> PosteriorReport | FitReport | None:
        """Report that says whether any body explains the readings; ``None``: there is none yet."""
        return self.posterior or self.fit

    @property
    def leg_intervals(self) -> tuple[Interval, ...]:
        """Length of each leg, m, with its posterior interval or its range in the population."""
        if self.posterior is not None:
            return self.posterior.lengths_m
        ends = [leg.population_m or (leg.length_m, leg.length_m) for leg in self.legs]
        return tuple(
            Interval(low=low, median=leg.length_m, high=high)
            for leg, (low, high) in zip(self.legs, ends, strict=True)
        )


def read_document(file: Path, kind: type[_Document]) -> _Document | None:
    """Reads a document; ``None`` where the file is missing, damaged or of another version."""
    try:
        return kind.model_validate_json(file.read_bytes())
    except (OSError, ValidationError):
        return None


def write_document(file: Path, document: BaseModel) -> None:
    """Writes a document, such as ``result.json``, in one step.

    Raises:
        OSError: It cannot be written.
    """
    replace_text(file, document.model_dump_json(indent=2) + "\n")


def versions_of(store: RunStore) -> dict[str, str]:
    """Versions of everything that computes what is said of a run, by name."""
    return versions() | dict(store.settings.plugins)


_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_ATTRIBUTE: Final = re.compile(r"^ {4}(\w+): ((?:.+\n?)(?: {8}.+\n?)*)", re.MULTILINE)


def result_schema() -> dict[str, Any]:
    """JSON schema of ``result.json``, with the docstrings of its records as descriptions."""
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
