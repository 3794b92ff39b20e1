"""The method ``posterior``: samples of all bodies that explain the readings, and how sure it is."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from typing import ClassVar, Final

import numpy as np

from estimator.errors import EstimatorError
from estimator.identification.method import Listener
from estimator.identification.next_program import next_program
from estimator.parameters.table import prior_probabilities
from estimator.physics.backends import REFERENCE, in_workers, open_arrays, physics_class
from estimator.physics.base import ArrayPhysics, WorldSettings
from estimator.physics.equivalence import PROGRAMS
from estimator.posterior.checks.simulator import (
    fine,
    outliers_left,
    probability_unlisted,
    recheck,
)
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.indistinguishable import (
    Indistinguishable,
    indistinguishable_points,
    probability_of,
)
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Posterior
from estimator.posterior.sampling.sampler import Effort, Sampler
from estimator.posterior.summary import load_posterior, summarise
from estimator.randomness import Stream, generator, seeds
from estimator.readings.observation import Observation
from estimator.storage.posteriors import RIVAL, SURE, NextMovement, StoredPosterior
from estimator.storage.records import Counters
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import Executors

_NAMED: Final = 0.5  # probability of all causes, above which they explain the readings

PRECISE: Final = 0.005
"""Largest half-width of the 90 % interval of a length that counts as known, m."""


class PosteriorMethod:
    """Samples the posterior with statics; a simulator reweights what is found.

    Each population has a back-end of its own in the workers, which move its chains and weigh what
    they have found; another, on all cores, does what is done while the workers rest. The reference
    back-end checks the result in the same workers.
    """

    PHYSICS: ClassVar = "statics"
    RULE: ClassVar = "information"

    @staticmethod
    def check(config: RunConfig) -> None:
        """Refuses options of the method ``paper``, and a physics that cannot sample.

        Raises:
            EstimatorError: The config asks for such a thing.
        """
        of_paper = (config.search, config.objective, config.population, config.generations)
        if config.full_steps or any(option is not None for option in of_paper):
            raise EstimatorError(
                "search, objective, population, generations and full steps belong to the method "
                "paper: leave them out, or add --method paper"
            )
        if config.learn != "all" and config.explore not in (None, PosteriorMethod.RULE):
            raise EstimatorError(
                f"--learn {config.learn} is for the rule {PosteriorMethod.RULE}, and not for "
                f"{config.explore}: leave one of them out"
            )
        physics = config.physics or PosteriorMethod.PHYSICS
        if not issubclass(physics_class(physics), ArrayPhysics):
            raise EstimatorError(
                f"the method posterior needs a physics that takes arrays of bodies and knows path "
                f"margins, and {physics} does not: leave --physics out (then it is "
                f"{PosteriorMethod.PHYSICS}, and {REFERENCE} has the last word), or take --method "
                "paper"
            )

    def __init__(
        self, store: RunStore, executors: Executors, listener: Listener, stack: ExitStack
    ) -> None:
        settings, world, workers = store.settings, store.world, executors.workers
        self.choosing, physics = (
            stack.enter_context(closing(_taking_arrays(executors, settings.physics, world)))
            for _ in range(2)
        )
        self._store = store
        self._listener = listener
        self._make_physics = partial(open_arrays, settings.physics, world)
        self._reference = in_workers(settings.reference, fine(world), workers)
        self._workers, self._physics = workers, physics
        stored = store.posteriors()
        self._summaries = [summary for summary, _ in stored]
        self._counters = stored[-1][1] if stored else Counters()
        self._started = time.monotonic()
        self._begin()
        checkpoint = store.checkpoint()
        if checkpoint is not None:
            self._sampler.restore(checkpoint.state)
            self._posterior = load_posterior(stored[-1][0], self._predictor.unknowns)

    def _begin(self) -> None:
        """Starts from the prior, by what is known of the robot."""
        store, effort = self._store, Effort()
        self._sampler = Sampler(
            Unknowns(store.genome, store.problem.table),
            self._make_physics,
            effort,
            seeds(store.settings.seed, Stream.SEARCH, effort.populations + 1),
            workers=self._workers,
            physics=self._physics,
        )
        self._posterior = self._sampler.prior()
        self._indistinguishable = indistinguishable_in(store, self._predictor)

    @property
    def _predictor(self) -> Predictor:
        return self._sampler.predictor

    def work(self, number: int) -> float:
        """Amount of work after an interaction, in any unit; it grows from one to the next."""
        return number + 4.0

    def done(self, number: int) -> float:
        """The work of an interaction that was learnt from already, else 0."""
        return self.work(number) if number < len(self._summaries) else 0.0

    def learn(self, number: int, observations: Sequence[Observation]) -> None:
        """Samples the posterior after an interaction."""
        if number < len(self._summaries):
            return
        if self._predictor.unknowns.table is not self._store.problem.table:
            self._begin()  # the first observation has told that the robot leans in its zero pose
        before, fitted = self._posterior, self._fitted(self._posterior, observations)
        self._posterior = self._sampler.learn(fitted.likelihood)
        fitted = replace(fitted, posterior=self._posterior)
        summary = self._summarised(fitted, before)
        summary = summary.model_copy(update={"overturned": self._overturned(number, summary)})
        summary = self._with_misspecification(summary, fitted)
        self._store.save_posterior(number, summary, self._cost(), self._sampler.state())
        self._summaries.append(summary)
        settings = self._store.settings
        self._listener.worked(
            self.work(number),
            f"interaction {number + 1}/{settings.interactions}, {_how_sure(summary)}",
        )

    def posterior(self) -> FittedPosterior:
        """The posterior after the last interaction."""
        fitted = self._fitted(self._posterior, self._store.observations())
        if not self._summaries:
            return fitted
        summary = self._summaries[-1]
        return replace(fitted, best=np.array(summary.best), summary=summary)

    def is_sure(self, number: int) -> bool:
        """Whether attachments, causes and lengths are as sure as the settings ask for.

        They must have been as sure before the last movement, too. A run that has ended stays so,
        whatever the simulator said then.
        """
        wanted = self._store.settings.sure
        if wanted is None or number != len(self._summaries) - 1:
            return False
        latest = self._summaries[-2:]
        return bool(latest[-1].simulated) or (
            len(latest) == 2
            and all(
                attachments_known(summary, wanted, self._store)
                and summary.knows_cause(wanted)
                and self._lengths_known(summary)
                for summary in latest
            )
        )

    def _overturned(self, number: int, summary: StoredPosterior) -> int | None:
        """Last earlier interaction after which attachments were sure that are ruled out now.

        They must have been sure after the interaction before that one, too: of statements of 0.95
        one in twenty is wrong.

        ``None`` where all readings are explained by a robot that is otherwise than stated: it has
        not changed, it was taken to be as stated.
        """
        named = sum(cause.probability for cause in summary.causes)
        if named > _NAMED and not summary.unexplained:
            return None
        were_known = [attachments_known(earlier, SURE, self._store) for earlier in self._summaries]
        sure = [at for at in range(1, number) if were_known[at - 1] and were_known[at]]
        if not sure:
            return None
        former = np.array(self._summaries[sure[-1]].best)
        chance = probability_of(former, self._posterior, self._predictor, self._indistinguishable)
        return sure[-1] if chance < 1 - SURE else None

    def _lengths_known(self, summary: StoredPosterior) -> bool:
        """Whether all leg lengths are known to ``PRECISE`` if the robot is as stated."""
        if summary.as_stated_m:
            return all(ends.width <= 2 * PRECISE for ends in summary.as_stated_m)
        lengths = FittedPosterior.of_stored(self._store, summary, ()).leg_lengths
        low, high = np.quantile(lengths, (0.05, 0.95), axis=0)
        return bool(np.all(high - low <= 2 * PRECISE))

    def finish(self, observations: Sequence[Observation]) -> None:
        """Has some of the samples simulated, and reweights."""
        if self._store.complete:
            return
        last = len(observations) - 1
        summary = self._summaries[last]
        sampled = self._fitted(self._posterior, observations)
        likelihood = sampled.likelihood
        checked = recheck(self._posterior, self._predictor, likelihood, self._reference)
        fitted = replace(sampled, posterior=checked.posterior)
        final = self._summarised(fitted).model_copy(
            update={
                "causes": summary.causes,
                "as_stated_m": summary.as_stated_m,
                "information_gain_bits": summary.information_gain_bits,
                "overturned": summary.overturned,
                "simulated": checked.simulated,
                "ess": checked.ess,
            }
        )
        final = self._with_misspecification(final, fitted)
        modes = (mode for mode in final.modes if mode.probability >= RIVAL)
        if not final.knows_cause(SURE) or any(not mode.indistinguishable for mode in modes):
            final = final.model_copy(update={"next_movement": self._deciding(fitted)})
        self._store.save_posterior(last, final, self._cost(), None)

    def _with_misspecification(
        self, summary: StoredPosterior, fitted: FittedPosterior
    ) -> StoredPosterior:
        """The summary, with the probability of a deviation that is not in the table."""
        outliers = outliers_left(
            np.array([reading.outlier_probability for reading in summary.predicted]),
            fitted.posterior,
            self._predictor,
            fitted.likelihood,
            reference=self._reference,
        )
        table = self._predictor.unknowns.table
        amounts = {
            row.name: prior
            for row, prior in zip(table, prior_probabilities(table)[:-1].tolist(), strict=True)
            if row.may_deviate and not row.switch
        }
        unlisted = probability_unlisted(
            outliers,
            fitted.noise,
            deviating=sum(cause.probability for cause in summary.causes if cause.name in amounts),
            prior=sum(amounts.values()),
        )
        return summary.model_copy(update={"misspecification_probability": unlisted})

    def _deciding(self, fitted: FittedPosterior) -> NextMovement:
        """The movement that would tell most about what is left open."""
        with closing(self._make_physics()) as physics:
            choice = next_program(self._store, "information", fitted, physics=physics)
        return NextMovement(
            program=choice.program,
            reason=choice.reason,
            bits=choice.bits or 0.0,
            bits_about_causes=choice.bits_about_causes,
        )

    def _summarised(
        self, fitted: FittedPosterior, before: Posterior | None = None
    ) -> StoredPosterior:
        return summarise(
            fitted.posterior,
            self._predictor,
            fitted.likelihood,
            self._indistinguishable,
            before=before,
        )

    def _fitted(self, posterior: Posterior, observations: Sequence[Observation]) -> FittedPosterior:
        return FittedPosterior.in_run(self._store, posterior, observations)

    def _cost(self) -> Counters:
        """What the run has cost by now, this process's share added to what was on disk."""
        before, sampled, reference = self._counters, self._sampler.cost, self._reference
        simulations = sampled.simulations + reference.simulations
        return Counters(
            simulations_requested=before.simulations_requested + simulations,
            simulations_run=before.simulations_run + simulations,
            steps=before.steps + sampled.steps + reference.steps,
            wall_seconds=before.wall_seconds + time.monotonic() - self._started,
        )


def attachments_known(summary: StoredPosterior, wanted: float, store: RunStore) -> bool:
    """Whether attachments are so probable, readings are explained, and problem and robot agree."""
    contradicted = store.problem.contradictions(store.capabilities)
    return (summary.probability or 0.0) >= wanted and summary.explained and not contradicted


def _how_sure(summary: StoredPosterior) -> str:
    if summary.probability is None:
        return f"how sure the best body's attachments are is not known: {summary.not_known}"
    fit = "" if summary.explained else ", but it does not explain the readings"
    return f"best body's attachments {100 * summary.probability:.0f} % sure{fit}"


def _taking_arrays(executors: Executors, name: str, world: WorldSettings) -> ArrayPhysics:
    """A back-end for arrays of bodies: on all cores here, on one where a cluster does the work."""
    opened = executors.open_physics(name, world)
    if isinstance(opened, ArrayPhysics):
        return opened
    opened.close()
    return open_arrays(name, world)


def indistinguishable_in(store: RunStore, predictor: Predictor) -> Indistinguishable:
    """The test by a run's sensors in random movements, which its seed determines."""
    rng = generator(store.settings.seed, Stream.EQUIVALENCE)
    movements = [store.problem.random_program(rng, store.capabilities) for _ in range(PROGRAMS)]
    return partial(
        indistinguishable_points, predictor, np.array(movements), store.settings.modalities
    )
