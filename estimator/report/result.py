"""A run in numbers: what ``result.json`` holds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.body.limbs import driven_limbs, leg_lengths
from estimator.body.morphology import BASE, Morphology, Part
from estimator.identification.final_population import FinalPopulation
from estimator.identification.reference_check import pairs_turned
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, touched
from estimator.report.posterior.summary import Interval, PosteriorSummary, posterior_summary
from estimator.storage.records import Counters, Finish
from estimator.storage.store import RunStore
from estimator.versions import versions
from protocol.wire.capabilities import Capabilities

BEST_MODELS = 10


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, json_schema_serialization_defaults_required=True)


class PartFound(_Record):
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


class ModelFound(_Record):
    """One model.

    Attributes:
        sensor_error: Its subjective error; by the reference where that had the last word; ``None``
            where its simulations cannot be believed.
        searched_error: The same as the search's physics saw it.
        leg_lengths_m: Length of each leg (what one motor turns as one piece), m.
        parts: Its configuration.
    """

    sensor_error: float | None
    searched_error: float | None
    leg_lengths_m: tuple[float, ...]
    parts: tuple[PartFound, ...]


class LegFound(_Record):
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


class FinishFound(_Record):
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
        complete: Whether all interactions are done and modelled.
        method: ``paper`` or ``posterior``.
        problem: Name of the problem.
        searched: What was to be found, gene by gene.
        physics: Back-end that predicted what models feel.
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
        simulations_invalid: How many of those cannot be believed, and lost for it.
        simulations_undecided: How many of those had no weight, since the body lay in balance.
        steps: Physics steps simulated.
        wall_seconds: Time spent.
        sensor_error: Smallest subjective error in the population; ``None`` before the first, and
            where no model could be simulated.
        legs: The legs, in motor order.
        best_models: The best models, best first.
        finish: How far the reference agrees, where something else searched.
        posterior: What is believed of the body, by the method posterior.
        warnings: What a person should know before trusting this.
    """

    complete: bool
    method: str = "paper"
    problem: str
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
    legs: tuple[LegFound, ...]
    best_models: tuple[ModelFound, ...]
    finish: FinishFound | None
    posterior: PosteriorSummary | None = None
    warnings: tuple[str, ...]

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


def summarise(store: RunStore) -> Result:
    """The outcome of a run as far as it has come."""
    settings, capabilities, problem = store.settings, store.capabilities, store.problem
    observations, paper = store.observations(), settings.method == "paper"
    latest, beliefs = store.latest_generation(), store.beliefs()
    counters = Counters() if latest is None else latest.counters
    if beliefs:
        counters = beliefs[-1][1]
    population = FinalPopulation.of(store)
    bodies = store.genome.decode_all(population.genes[population.order]) if len(population) else []
    end = store.finish()
    if end is not None:
        counters = counters.including(end, len(observations))
    legs = _legs(bodies, observations, capabilities, converges=not beliefs)
    posterior = posterior_summary(store)
    error = _known(population.errors[population.best]) if bodies else None
    warnings = (*_contradictions(problem, capabilities), *_warnings(legs, observations))
    if bodies and error is None and posterior is None:
        warnings = (
            "No model could be simulated, so nothing here says anything about the robot.",
            *warnings,
        )
    return Result(
        complete=store.complete,
        method=settings.method,
        problem=problem.name,
        searched=tuple(gene.name for gene in store.genome.genes),
        physics=settings.physics,
        reference=settings.reference,
        search=settings.search if paper else None,
        objective=settings.objective if paper else None,
        explore=settings.explore,
        modalities=settings.modalities,
        seed=settings.seed,
        population=settings.population if paper else None,
        generations=settings.generations if paper else None,
        versions=versions() | dict(store.settings.plugins),
        robot_uri=settings.robot,
        robot=capabilities.to_map(),
        interactions=len(observations),
        simulations_requested=counters.simulations_requested,
        simulations_run=counters.simulations_run,
        simulations_invalid=counters.simulations_invalid if paper else None,
        simulations_undecided=counters.simulations_undecided if paper else None,
        steps=counters.steps,
        wall_seconds=counters.wall_seconds,
        sensor_error=error,
        legs=legs,
        best_models=tuple(
            _model(
                body,
                (_known(population.errors[index]), _known(population.searched[index])),
                problem,
                capabilities,
                bodies if beliefs else [],
            )
            for body, index in list(zip(bodies, population.order, strict=True))[:BEST_MODELS]
        ),
        finish=_finish(end),
        posterior=posterior,
        warnings=warnings,
    )


def _finish(end: Finish | None) -> FinishFound | None:
    if end is None:
        return None
    turned, pairs = pairs_turned(end)
    return FinishFound(
        models=len(end.models),
        pairs=pairs,
        pairs_turned=turned,
        best_changed=bool(end.models) and int(np.argmin(end.simulated)) != 0,
    )


def _legs(
    bodies: Sequence[Morphology],
    observations: Sequence[Observation],
    capabilities: Capabilities,
    *,
    converges: bool,
) -> tuple[LegFound, ...]:
    if not bodies:
        return ()
    lengths = leg_lengths(bodies if converges else bodies[:1])
    low, high = lengths.min(axis=0), lengths.max(axis=0)
    return tuple(
        LegFound(
            joint=_joint(limb.motor, capabilities) or "",
            mount=limb.mount,
            length_m=limb.length,
            population_m=(float(low[index]), float(high[index])) if converges else None,
            touched=touched(limb.sensors, observations),
        )
        for index, limb in enumerate(driven_limbs(bodies[0]))
    )


def _model(
    body: Morphology,
    errors: tuple[float | None, float | None],
    problem: Problem,
    capabilities: Capabilities,
    samples: Sequence[Morphology],
) -> ModelFound:
    names = [rule.name for rule in problem.parts]
    return ModelFound(
        sensor_error=errors[0],
        searched_error=errors[1],
        leg_lengths_m=tuple(limb.length for limb in driven_limbs(body)),
        parts=tuple(
            PartFound(
                name=name,
                parent="main body" if part.parent == BASE else names[part.parent],
                mount=body.mount(row).name,
                hinge=body.hinge(row).name,
                length_m=part.length,
                joint=_joint(part.motor, capabilities),
                agreement=_agreement(row, part, samples) if samples else None,
            )
            for row, (name, part) in enumerate(zip(names, body.parts, strict=True))
        ),
    )


def _known(error: float) -> float | None:
    """An error for JSON, which knows no infinity."""
    return float(error) if math.isfinite(error) else None


def _agreement(row: int, part: Part, samples: Sequence[Morphology]) -> float:
    others = (sample.parts[row] for sample in samples)
    attached = part.parent, part.mount, part.hinge
    return float(np.mean([(one.parent, one.mount, one.hinge) == attached for one in others]))


def _joint(motor: int | None, capabilities: Capabilities) -> str | None:
    return None if motor is None else capabilities.joints[motor].name


def _contradictions(problem: Problem, capabilities: Capabilities) -> Iterator[str]:
    """What the problem says otherwise than the robot."""
    for sentence in problem.differences(capabilities):
        yield f"{sentence[0].upper()}{sentence[1:]}."


def _warnings(legs: Sequence[LegFound], observations: Sequence[Observation]) -> tuple[str, ...]:
    warnings = [
        f"The leg at {leg.joint} never touched the ground: its length is little more than a guess."
        for leg in legs
        if leg.touched is False
    ]
    unsettled = [str(number) for number, item in enumerate(observations, 1) if not item.settled]
    if unsettled:
        warnings.append(
            f"The robot was not at rest when interaction {', '.join(unsettled)} was read."
        )
    at_end = sorted({name for item in observations for name in item.saturated_joints})
    if at_end:
        warnings.append(f"At the end of what they can reach stood, at times: {', '.join(at_end)}.")
    return tuple(warnings)
