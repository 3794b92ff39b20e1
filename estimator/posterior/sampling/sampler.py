"""What is believed of the body after some interactions: discover, weigh, sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import SearchStateError
from estimator.parallel.workers import Workers
from estimator.physics.base import ArrayMarginPhysics
from estimator.posterior.checks.verdict import left_unexplained
from estimator.posterior.model.likelihood import Likelihood, Noise, SensorData
from estimator.posterior.model.slopes import best_of_each
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.sampling.discovery import Bodies, Discovery, share_seen
from estimator.posterior.sampling.evidence import EvidenceEstimator, ModeEvidence
from estimator.posterior.sampling.population import Population
from estimator.posterior.sampling.wandering import wandered
from estimator.posterior.sampling.weighing import sampled, weighed
from estimator.storage.beliefs import ACCIDENTS

ALGORITHM: Final = "evolutionary Monte Carlo"

_CONSIDERED: Final = 16.0  # nats below the best fit, which may be a mere spike
_NEIGHBOURS: Final = 16  # of each population, as further centres of a mode
_AGREED: Final = 0.8  # share of the posterior that both have met
_ALIKE: Final = 0.4  # the same of chains that only wander
_TOLD: Final = 6.0  # bits about attachments, by one interaction that moves few limbs
_TELLING: Final = 4  # interactions at least, until the populations ought to agree
_MORE: Final = 4  # rounds, once they turned out not to,
_LONGER: Final = 4  # each of so many times the steps
_ENOUGH: Final = 2  # rounds, where chains have wandered before, and
_DRAWS: Final = 8  # times as many draws for a mode's evidence, which has more lengths
_ACCIDENT_IN: Final = 5  # interactions, of which one may be left unexplained
_NEGLIGIBLE: Final = 0.05  # share of the posterior that a round adds


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much a sampler does after each interaction; all are counts.

    Attributes:
        populations: Independent ones.
        levels: Of each.
        width: Chains on a level.
        steps: Of one round of the search.
        rounds: Of the search, at most.
        draws: For a mode's evidence, in one round of three.
        samples: Of the posterior; a multiple of 4.
    """

    populations: int = 2
    levels: int = 10
    width: int = 32
    steps: int = 60
    rounds: int = 6
    draws: int = 200
    samples: int = 256


class Sampler:
    """Samples the posterior of one problem, interaction after interaction.

    Args:
        unknowns: What the posterior is over.
        make_physics: Makes a back-end for each population.
        noise: How far readings stray.
        effort: How much to do.
        seeds: One for each population and one for what is done in common.
        workers: Move the populations' chains; results do not depend on how many there are.

    Attributes:
        predictor: Predicts readings.
    """

    def __init__(
        self,
        unknowns: Unknowns,
        make_physics: Callable[[], ArrayMarginPhysics],
        noise: Noise,
        effort: Effort,
        seeds: Sequence[np.random.SeedSequence],
        *,
        workers: Workers,
    ) -> None:
        self._noise = noise
        self._effort = effort
        self._workers = workers
        known = not unknowns.parents.any()
        self._telling = max(_TELLING, math.ceil(unknowns.bits / _TOLD) if known else 0)
        self._wanders = self._telling > _TELLING
        self.predictor = Predictor(unknowns, make_physics())
        *own, common = seeds
        self._searches = []
        for _, seed in zip(range(effort.populations), own, strict=True):
            predictor = Predictor(unknowns, make_physics())
            of_chains, of_search = map(np.random.default_rng, seed.spawn(2))
            population = Population.of_prior(
                predictor, of_chains, levels=effort.levels, width=effort.width
            )
            self._searches.append(Discovery(population, predictor, of_search, climbs=self._wanders))
        self._rng = np.random.default_rng(common)
        self._known: set[Attachments] = set()

    def state(self) -> dict[str, Any]:
        """All that ``restore`` needs, for JSON."""
        return {
            "algorithm": ALGORITHM,
            "populations": [search.population.state() for search in self._searches],
            "searching": [search.rng.bit_generator.state for search in self._searches],
            "random": self._rng.bit_generator.state,
            "known": sorted(self._known),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Goes back to a state, as if what came after it had not been.

        Raises:
            SearchStateError: It is not the state of such a sampler.
        """
        if state.get("algorithm") != ALGORITHM:
            raise SearchStateError(
                f"the run was made with {state.get('algorithm')!r}, not {ALGORITHM!r}: start a new "
                "run"
            )
        if state.keys() != self.state().keys():
            raise SearchStateError(
                "the run was made with another version of the sampler: start a new run"
            )
        for search, population, rng in zip(
            self._searches, state["populations"], state["searching"], strict=True
        ):
            search.population = Population.from_state(population, search.predictor)
            search.rng.bit_generator.state = rng
        self._rng.bit_generator.state = state["random"]
        self._known = {tuple(key) for key in state["known"]}

    @property
    def requested(self) -> int:
        """Simulations that were asked for so far, those included that early rejection spared."""
        return self.simulations + sum(one.spared for one in self._predictors)

    @property
    def steps(self) -> int:
        """How many time steps were computed so far."""
        return sum(one.steps for one in self._predictors)

    @property
    def simulations(self) -> int:
        """How many interactions were simulated so far."""
        return sum(one.simulations for one in self._predictors)

    @property
    def _predictors(self) -> list[Predictor]:
        return [self.predictor, *(search.predictor for search in self._searches)]

    def prior(self) -> Posterior:
        """What is believed before the first interaction."""
        populations = [search.population for search in self._searches]
        values = np.concatenate([one.values for one in populations])
        return Posterior(
            values=values,
            scales=np.concatenate([one.scales for one in populations]),
            weights=np.full(len(values), 1 / len(values)),
            modes=(),
            seen=0.0,
        )

    def learn(self, data: SensorData) -> Posterior:
        """What is believed after the interactions so far.

        As long as they cannot tell of all limbs, no attachments are weighed (see ``wandering``),
        unless the populations agree before, or do not find what explains the readings.

        Args:
            data: All of them.
        """
        known = set(self._known)
        for search in self._searches:
            search.observe(data, self._noise)
        if self._wanders:
            self._searches, wandering = wandered(
                self._searches, self._workers, steps=self._effort.steps
            )
            bodies = [search.best() for search in self._searches]
            best = max(bodies, key=lambda one: one.fits[0])
            told = len(data) >= self._telling or wandering.seen >= _ALIKE
            left = left_unexplained(best.values[0], self.predictor, data, self._noise)
            if not told and left <= ACCIDENTS:
                return wandering
            known.update(*(self.predictor.unknowns.keys(one.values) for one in bodies))
        return self._weighed(self._discovered(data, known), data)

    def _discovered(self, data: SensorData, known: set[Attachments]) -> _Discovered:
        """Searches in rounds, each with the hotter half of the chains drawn anew.

        They end when the readings are explained, the populations agree, and a round has found
        nothing that matters and was not known before.
        The rounds that it may take grow with the interactions, since few readings leave many
        bodies; where chains have wandered before, few are left to do.
        Where populations that ought to agree do not, or nothing explains the readings, all chains
        start anew and have longer: what one pose that ended elsewhere has led them to may be far
        from the truth.
        """
        effort, late = self._effort, len(data) >= self._telling
        steps, number, lost = effort.steps, 0, False
        predictor, unknowns = self.predictor, self.predictor.unknowns
        estimator = self._estimator(data)
        while True:
            self._searches = self._workers.map(partial(_searched, steps), self._searches)
            bodies = [search.best() for search in self._searches]
            points, fits = _union(bodies, unknowns)
            points = points[fits > fits[0] - _CONSIDERED]
            guesses = estimator.guess(points, fits[: len(points)])
            shares, keys = softmax(guesses), unknowns.keys(points)
            seen = share_seen(keys, shares, bodies, unknowns)
            fresh = sum(shares[row] for row, key in enumerate(keys) if key not in known)
            known.update(keys)
            left = left_unexplained(points[0], predictor, data, self._noise)
            explained = left <= ACCIDENTS
            credible = left <= min(ACCIDENTS, len(data) // _ACCIDENT_IN)
            number += 1
            agreed = explained and seen >= _AGREED
            lost = lost or (number > 1 and late and not self._wanders and not agreed)
            rounds = min(effort.rounds, len(data)) if credible else effort.rounds
            if (
                (credible and seen >= _AGREED and fresh <= _NEGLIGIBLE)
                or (explained and not late and self._wanders)
                or number >= (_ENOUGH if self._wanders else rounds + (_MORE if lost else 0))
            ):
                return _Discovered(bodies, points, fits[0], guesses, credible)
            steps = effort.steps * (_LONGER if lost else 1)
            for search in self._searches:
                search.start_anew(all_levels=lost)

    def _weighed(self, discovered: _Discovered, data: SensorData) -> Posterior:
        """Modes by their evidences, and samples."""
        predictor, effort = self.predictor, self._effort
        modes = weighed(
            discovered.points,
            discovered.guesses,
            partial(self._evidences, self._estimator(data), discovered.best),
            self._rng,
        )
        chains = sampled(modes, predictor, data, self._noise, self._rng, count=effort.samples)
        for search in self._searches:
            rows = self._rng.choice(effort.samples, effort.width)
            search.population.replace_coldest(chains.values[rows], chains.scales[rows])
        keys = predictor.unknowns.keys(modes.points)
        self._known = set(keys)
        named = [
            Mode(key, float(share), point, mode.effective)
            for key, share, point, mode in zip(
                keys, modes.shares, modes.points, modes.evidences, strict=True
            )
        ]
        seen = share_seen(keys, modes.shares, discovered.bodies, predictor.unknowns)
        return Posterior(
            values=chains.values,
            scales=chains.scales,
            weights=np.full(len(chains.values), 1 / len(chains.values)),
            modes=tuple(sorted(named, key=lambda mode: -mode.probability)),
            seen=seen if discovered.credible else 0.0,
        )

    def _estimator(self, data: SensorData) -> EvidenceEstimator:
        draws = self._effort.draws * (_DRAWS if self._wanders else 1)
        likelihood = Likelihood(data, self._noise)
        return EvidenceEstimator(self.predictor, data, likelihood, draws=draws)

    def _evidences(
        self, estimator: EvidenceEstimator, best: float, points: Array
    ) -> list[ModeEvidence]:
        seeds = self._rng.integers(2**32, size=len(points)).tolist()
        tasks = [
            (point, self._neighbours(point, best), seed)
            for point, seed in zip(points, seeds, strict=True)
        ]
        evidences = []
        for evidence, simulations, steps in self._workers.map(estimator.with_cost, tasks):
            evidences.append(evidence)
            self.predictor.simulations_elsewhere += simulations
            self.predictor.steps_elsewhere += steps
        return evidences

    def _neighbours(self, point: Array, best: float) -> Array:
        """Chains with a point's attachments that fit nearly as well as the best body."""
        unknowns = self.predictor.unknowns
        key = unknowns.attachments(point[None])
        chains = []
        for population in (search.population for search in self._searches):
            cold = population.values[: 2 * population.width]
            alike = np.all(unknowns.attachments(cold) == key, axis=1)
            alike &= population.posterior_fits(2) > best - _CONSIDERED
            chains.append(cold[alike][:_NEIGHBOURS])
        return np.concatenate(chains)


@dataclass(frozen=True)
class _Discovered:
    """What the search has met.

    Attributes:
        bodies: By each population.
        points: The best of each set of attachments that may matter, best first, shape (n, size).
        best: Log-likelihood of the first.
        guesses: Of their evidences, shape (n,).
        credible: Whether so few interactions are left unexplained that something can be certain.
    """

    bodies: Sequence[Bodies]
    points: Array
    best: float
    guesses: Array
    credible: bool


def _searched(steps: int, search: Discovery) -> Discovery:
    """The search after one more round."""
    search.search(steps)
    return search


def _union(discovered: Sequence[Bodies], unknowns: Unknowns) -> tuple[Array, Array]:
    values = np.concatenate([one.values for one in discovered])
    fits = np.concatenate([one.fits for one in discovered])
    order = best_of_each(unknowns.keys(values), fits)
    return values[order], fits[order]
