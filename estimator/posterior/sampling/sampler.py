"""What is believed of the body after some interactions: discover, weigh, sample."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import SearchStateError
from estimator.physics.base import ArrayMarginPhysics
from estimator.posterior.checks.verdict import left_unexplained
from estimator.posterior.model.likelihood import Likelihood, Noise, SensorData
from estimator.posterior.model.slopes import best_of_each
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.sampling.discovery import Bodies, Discovery, share_seen
from estimator.posterior.sampling.evidence import EvidenceEstimator
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
    """

    def __init__(
        self,
        unknowns: Unknowns,
        make_physics: Callable[[], ArrayMarginPhysics],
        noise: Noise,
        effort: Effort,
        seeds: Sequence[np.random.SeedSequence],
    ) -> None:
        self._noise = noise
        self._effort = effort
        known = not unknowns.parents.any()
        self._telling = max(_TELLING, math.ceil(unknowns.bits / _TOLD) if known else 0)
        self._predictors = [Predictor(unknowns, make_physics()) for _ in range(effort.populations)]
        *own, common = seeds
        pairs = [seed.spawn(2) for seed in own]
        self._populations = [
            Population(
                predictor, np.random.default_rng(chains), levels=effort.levels, width=effort.width
            )
            for predictor, (chains, _) in zip(self._predictors, pairs, strict=True)
        ]
        self._searching = [np.random.default_rng(search) for _, search in pairs]
        self._rng = np.random.default_rng(common)
        self._known: set[Attachments] = set()

    def state(self) -> dict[str, Any]:
        """All that ``restore`` needs, for JSON."""
        return {
            "algorithm": ALGORITHM,
            "populations": [population.state() for population in self._populations],
            "searching": [rng.bit_generator.state for rng in self._searching],
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
        self._populations = [
            Population.from_state(one, predictor)
            for one, predictor in zip(state["populations"], self._predictors, strict=True)
        ]
        for rng, one in zip(self._searching, state["searching"], strict=True):
            rng.bit_generator.state = one
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
    def predictor(self) -> Predictor:
        """Predicts readings, for what comes after the sampling."""
        return self._predictors[0]

    @property
    def simulations(self) -> int:
        """How many interactions were simulated so far."""
        return sum(predictor.simulations for predictor in self._predictors)

    def prior(self) -> Posterior:
        """What is believed before the first interaction."""
        values = np.concatenate([one.values for one in self._populations])
        return Posterior(
            values=values,
            scales=np.concatenate([one.scales for one in self._populations]),
            weights=np.full(len(values), 1 / len(values)),
            modes=(),
            seen=0.0,
        )

    def learn(self, data: SensorData) -> Posterior:
        """What is believed after the interactions so far.

        The search goes on in rounds, each with the hotter half of the chains drawn anew, until the
        readings are explained, the populations agree, and a round has found nothing that matters
        and was not believed before.
        The rounds it may take grow with the interactions, since few readings leave many bodies.
        As long as they cannot tell of all limbs, no attachments are weighed (see ``wandering``),
        unless the populations agree before, or do not find what explains the readings; afterwards
        few rounds are left to do.
        Where populations that ought to agree do not, or nothing explains the readings, all chains
        start anew and have longer: what one pose that ended elsewhere has led them to may be far
        from the truth.

        Args:
            data: All of them.
        """
        late, wanders = len(data) >= self._telling, self._telling > _TELLING
        searches = [
            Discovery(population, predictor, data, self._noise, rng, climbs=wanders)
            for population, predictor, rng in zip(
                self._populations, self._predictors, self._searching, strict=True
            )
        ]
        known = set(self._known)
        if wanders:
            wandering = wandered(
                self._populations,
                searches,
                self.predictor.unknowns,
                self._searching,
                steps=self._effort.steps,
            )
            best = max((search.best() for search in searches), key=lambda one: one.fits[0])
            told = late or wandering.seen >= _ALIKE
            left = left_unexplained(best.values[0], self.predictor, data, self._noise)
            if not told and left <= ACCIDENTS:
                return wandering
            known.update(*(self.predictor.unknowns.keys(one.best().values) for one in searches))
        predictor = self.predictor
        likelihood = Likelihood(data, self._noise)
        draws = self._effort.draws * (_DRAWS if wanders else 1)
        estimator = EvidenceEstimator(predictor, data, likelihood, draws=draws)
        steps, number, lost = self._effort.steps, 0, False
        with ThreadPoolExecutor(len(searches)) as threads:
            while True:
                discovered = list(threads.map(Discovery.search, searches, itertools.repeat(steps)))
                points, fits = _union(discovered, predictor.unknowns)
                points = points[fits > fits[0] - _CONSIDERED]
                guesses = estimator.guess(points, fits[: len(points)])
                shares = softmax(guesses)
                keys = predictor.unknowns.keys(points)
                seen = share_seen(keys, shares, discovered, predictor.unknowns)
                fresh = sum(shares[row] for row, key in enumerate(keys) if key not in known)
                known.update(keys)
                left = left_unexplained(points[0], predictor, data, self._noise)
                explained = left <= ACCIDENTS
                credible = left <= min(ACCIDENTS, len(data) // _ACCIDENT_IN)
                if credible and seen >= _AGREED and fresh <= _NEGLIGIBLE:
                    break
                if explained and not late and wanders:
                    break
                number += 1
                agreed = explained and seen >= _AGREED
                lost = lost or (number > 1 and late and not wanders and not agreed)
                rounds = min(self._effort.rounds, len(data)) if credible else self._effort.rounds
                if number >= (_ENOUGH if wanders else rounds + (_MORE if lost else 0)):
                    break
                steps = self._effort.steps * (_LONGER if lost else 1)
                for search in searches:
                    search.start_anew(all_levels=lost)
        modes = weighed(
            points, guesses, estimator, partial(self._neighbours, best=fits[0]), self._rng
        )
        chains = sampled(modes, predictor, data, self._noise, self._rng, count=self._effort.samples)
        for population in self._populations:
            rows = self._rng.choice(self._effort.samples, population.width)
            population.replace_coldest(chains.values[rows], chains.scales[rows])
        keys = predictor.unknowns.keys(modes.points)
        self._known = set(keys)
        named = [
            Mode(key, float(share), point, mode.effective)
            for key, share, point, mode in zip(
                keys, modes.shares, modes.points, modes.evidences, strict=True
            )
        ]
        return Posterior(
            values=chains.values,
            scales=chains.scales,
            weights=np.full(len(chains.values), 1 / len(chains.values)),
            modes=tuple(sorted(named, key=lambda mode: -mode.probability)),
            seen=share_seen(keys, modes.shares, discovered, predictor.unknowns)
            if credible
            else 0.0,
        )

    def _neighbours(self, point: Array, best: float) -> Array:
        """Chains with a point's attachments that fit nearly as well as the best body."""
        unknowns = self.predictor.unknowns
        key = unknowns.attachments(point[None])
        chains = []
        for population in self._populations:
            cold = population.values[: 2 * population.width]
            alike = np.all(unknowns.attachments(cold) == key, axis=1)
            alike &= population.posterior_fits(2) > best - _CONSIDERED
            chains.append(cold[alike][:_NEIGHBOURS])
        return np.concatenate(chains)


def _union(discovered: Sequence[Bodies], unknowns: Unknowns) -> tuple[Array, Array]:
    values = np.concatenate([one.values for one in discovered])
    fits = np.concatenate([one.fits for one in discovered])
    order = best_of_each(unknowns.keys(values), fits)
    return values[order], fits[order]
