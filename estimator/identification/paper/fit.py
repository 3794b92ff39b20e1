"""How badly models fit what was observed, and the population that is fitted to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array, Morphology
from estimator.errors import EstimatorError
from estimator.identification.paper.objectives import Objective
from estimator.identification.paper.search import Search
from estimator.physics.base import ArrayPhysics, Physics
from estimator.physics.equivalence import Indices, Read
from estimator.problem.genome import Genome
from estimator.readings.observation import Observation, PredictedReadings
from estimator.storage.records import Counters


@dataclass(frozen=True, kw_only=True)
class ModelErrors:
    """How badly models fit observations.

    Attributes:
        errors: Error of each model over all observations, by the objective, shape (n,).
        invalid: Number of invalid simulations.
        undecided: Number of the other simulations that are undecided.
    """

    errors: Array
    invalid: int
    undecided: int


def fit_bodies(
    bodies: Sequence[Morphology],
    observations: Sequence[Observation],
    modalities: Sequence[str],
    physics: Physics,
    objective: Objective,
) -> ModelErrors:
    """Returns how badly bodies fit, each simulated in all interactions."""
    targets = _Targets.of(observations, modalities, objective)
    read = _body_by_body(bodies, physics, targets.programs)
    return targets.compare(read, np.full(len(bodies), np.inf))


def _body_by_body(bodies: Sequence[Morphology], physics: Physics, programs: Array) -> Read:
    """Reads models one by one, for back-ends that simulate bodies so."""
    return lambda models, interactions: physics.read(
        [(bodies[model], programs[one]) for model, one in zip(models, interactions, strict=True)]
    )


def _as_arrays(bodies: Bodies, physics: ArrayPhysics, programs: Array) -> Read:
    """Reads a whole population as arrays, by a back-end that takes arrays."""
    return lambda models, interactions: physics.read_bodies(bodies[models], programs[interactions])


@dataclass(frozen=True)
class _Targets:
    """What models are compared with.

    Attributes:
        observed: What the robot observed in each of k interactions.
        programs: Joint angles that the robot took, rad, shape (k, motors).
        modalities: Modalities that count.
        objective: Combines the errors of single interactions.
    """

    observed: Sequence[Observation]
    programs: Array
    modalities: Sequence[str]
    objective: Objective

    @classmethod
    def of(
        cls, observations: Sequence[Observation], modalities: Sequence[str], objective: Objective
    ) -> _Targets:
        programs = np.array([item.taken for item in observations], dtype=float)
        return cls(observations, programs, modalities, objective)

    def worst_first(self, read: Read, count: int) -> Indices:
        """Interactions in the order to try them: those a model fits worst first, shape (n, k)."""
        interactions = np.tile(np.arange(len(self.observed)), count)
        models = np.repeat(np.arange(count), len(self.observed))
        errors = self._errors(read(models, interactions), interactions).reshape(count, -1)
        return np.argsort(-errors, axis=1, kind="stable")

    def compare(self, read: Read, limits: Array, order: Indices | None = None) -> ModelErrors:
        """Tries models in one interaction after the other, in some order, until they have lost."""
        count, models = len(self.observed), len(limits)
        if order is None:
            order = np.tile(np.arange(count)[::-1], (models, 1))
        errors = np.zeros((count, models))
        undecided = np.zeros(errors.shape, dtype=bool)
        alive = np.arange(models)
        invalid = 0
        for start, end in pairwise(_rounds(count)):
            if not alive.size:
                break
            rows = np.repeat(alive, end - start)
            interactions = order[alive, start:end].ravel()
            readings = read(rows, interactions)
            errors[interactions, rows] = self._errors(readings, interactions)
            undecided[interactions, rows] = readings.undecided
            invalid += int(np.count_nonzero(~readings.valid))
            alive = alive[self.objective.lower_bound(errors[:, alive]) < limits[alive]]
        counted = int(np.count_nonzero(undecided & np.isfinite(errors)))
        total = self.objective.total(errors, undecided)
        if np.shape(total) != (models,) or np.isnan(total).any():
            raise EstimatorError(
                f"the objective {type(self.objective).__name__} gave {total!r} in total of "
                f"{models} models: it must give each a number, infinite where nothing is left"
            )
        return ModelErrors(errors=total, invalid=invalid, undecided=counted)

    def _errors(self, readings: PredictedReadings, interactions: Indices) -> Array:
        errors = np.zeros(len(interactions))
        for interaction in np.unique(interactions):
            rows = np.flatnonzero(interactions == interaction)
            target = self.observed[interaction]
            terms = self.objective.terms(readings[rows], target, self.modalities)
            if np.shape(terms) != rows.shape or not np.all(terms >= 0):
                raise EstimatorError(
                    f"the objective {type(self.objective).__name__} gave {terms!r} for {len(rows)} "
                    "models: it must give each an error of at least 0, infinite where the model's "
                    "reading is invalid"
                )
            errors[rows] = terms
        return errors


def _rounds(count: int) -> list[int]:
    """Ends of the rounds of interactions, from 0; the later a round, the more interactions.

    Most models lose in the first round; those that are left will mostly have to go through all
    interactions, and larger batches are shared better among processes.
    """
    ends = [0]
    while ends[-1] < count:
        ends.append(min(2 * ends[-1] + 1, count))
    return ends


class Modeller:
    """Evaluates and evolves models.

    Args:
        genome: The code between genes and bodies.
        physics: Predicts readings; it alone decides how well models fit.
        modalities: Modalities that count.
        counters: What the run has cost so far.
        objective: Objective by which models are fitted.
        approximation: Predicts roughly which interaction a model fits worst, so that this one comes
            first. That saves simulations and changes no verdict.
    """

    def __init__(
        self,
        genome: Genome,
        physics: Physics,
        modalities: Sequence[str],
        counters: Counters,
        *,
        objective: Objective,
        approximation: ArrayPhysics | None = None,
    ):
        self._genome = genome
        self._physics = physics
        self._objective = objective
        self._approximation = approximation
        self._modalities = tuple(modalities)
        self._requested = counters.simulations_requested
        self._run = counters.simulations_run - physics.simulations
        self._invalid = counters.simulations_invalid
        self._undecided = counters.simulations_undecided
        self._steps = counters.steps - physics.steps

    def counters(self, wall_seconds: float) -> Counters:
        """Cost of the run by now."""
        return Counters(
            simulations_requested=self._requested,
            simulations_run=self._run + self._physics.simulations,
            simulations_invalid=self._invalid,
            simulations_undecided=self._undecided,
            steps=self._steps + self._physics.steps,
            wall_seconds=wall_seconds,
        )

    def introduce(self, search: Search, observations: Sequence[Observation]) -> None:
        """Evaluates the population after an interaction, on all observations so far."""
        if len(observations) > 1:
            search.forget_errors()
        self.evolve(search, observations)

    def evolve(self, search: Search, observations: Sequence[Observation]) -> None:
        """Evaluates what the search asks for: a generation of children, or its population.

        A model that the problem forbids is as bad as can be, and is not simulated. A model that has
        reached its limit in one interaction has lost, and is not simulated in the others. Without
        an approximation the latest interaction comes first, since the parents were not selected on
        it for as long as on the others.
        """
        genome, genes = self._genome, search.ask()
        self._requested += len(genes) * len(observations)
        errors = np.full(len(genes), np.inf)
        allowed = ~genome.forbidden(genes)
        genes, limits = genes[allowed], search.limits[allowed]
        targets, order = _Targets.of(observations, self._modalities, self._objective), None
        if self._approximation is not None and len(observations) > 1 and np.isfinite(limits).any():
            guess = _as_arrays(genome.bodies(genes), self._approximation, targets.programs)
            order = targets.worst_first(guess, len(genes))
        if isinstance(self._physics, ArrayPhysics):
            read = _as_arrays(genome.bodies(genes), self._physics, targets.programs)
        else:
            read = _body_by_body(genome.decode_all(genes), self._physics, targets.programs)
        compared = targets.compare(read, limits, order)
        self._invalid += compared.invalid
        self._undecided += compared.undecided
        errors[allowed] = compared.errors
        search.tell(errors)
