"""What is believed of the body after some interactions: discover, weigh, sample."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import SearchStateError
from estimator.physics.base import ArrayMarginPhysics
from estimator.posterior.checks.verdict import explains
from estimator.posterior.model.likelihood import Likelihood, Noise, SensorData
from estimator.posterior.model.slopes import best_of_each
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Attachments, Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.sampling.discovery import Bodies, Discovery, share_seen
from estimator.posterior.sampling.evidence import EvidenceEstimator, ModeEvidence
from estimator.posterior.sampling.population import EVERY, Population
from estimator.posterior.sampling.wandering import wandered

ALGORITHM: Final = "evolutionary Monte Carlo"

_CONSIDERED: Final = 16.0  # nats below the best fit, which may be a mere spike
_WEIGHED: Final = 9.0  # nats below the best evidence
_NEIGHBOURS: Final = 16  # of each population, as further centres of a mode
_MOST: Final = 120  # modes whose evidence is estimated
_AGREED: Final = 0.8  # share of the posterior that both have met
_ALIKE: Final = 0.4  # the same of chains that only wander
_TOLD: Final = 6.0  # bits about attachments, by one interaction that moves few limbs
_TELLING: Final = 4  # interactions at least, until the populations ought to agree
_MORE: Final = 4  # rounds, once they turned out not to,
_LONGER: Final = 4  # each of so many times the steps
_ENOUGH: Final = 2  # rounds, where chains have wandered before, and
_DRAWS: Final = 8  # times as many draws for a mode's evidence, which has more lengths
_BURN_IN: Final = 5  # times the steps of sampling, where few draws stand for a mode,
_BURN_INS: Final = 4  # so often, chains that got lost taken back in between
_LEAST_POWER: Final = 1e-3
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
        frozen: Steps of valid sampling after the search.
    """

    populations: int = 2
    levels: int = 10
    width: int = 32
    steps: int = 60
    rounds: int = 6
    draws: int = 200
    frozen: int = 20


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

    def state(self) -> dict[str, Any]:
        """All that ``restore`` needs, for JSON."""
        return {
            "algorithm": ALGORITHM,
            "populations": [population.state() for population in self._populations],
            "searching": [rng.bit_generator.state for rng in self._searching],
            "random": self._rng.bit_generator.state,
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
        self._populations = [
            Population.from_state(one, predictor)
            for one, predictor in zip(state["populations"], self._predictors, strict=True)
        ]
        for rng, one in zip(self._searching, state["searching"], strict=True):
            rng.bit_generator.state = one
        self._rng.bit_generator.state = state["random"]

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
        readings are explained, the populations agree, and a round has found nothing that matters.
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
        known: set[Attachments] = set()
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
            if not told and explains(best.values[0], self.predictor, data, self._noise):
                return wandering
            known.update(*(self.predictor.unknowns.keys(one.best().values) for one in searches))
        predictor = self.predictor
        likelihood = Likelihood(data, self._noise)
        draws = self._effort.draws * (_DRAWS if wanders else 1)
        estimator = EvidenceEstimator(predictor, data, likelihood, draws=draws)
        rounds = _ENOUGH if wanders else min(self._effort.rounds, len(data))
        steps, number, lost = self._effort.steps, 0, False
        with ThreadPoolExecutor(len(searches)) as threads:
            while number < rounds + (_MORE if lost else 0):
                discovered = list(threads.map(Discovery.search, searches, itertools.repeat(steps)))
                points, fits = _union(discovered, predictor.unknowns)
                kept = fits > fits[0] - _CONSIDERED
                points = points[kept]
                guesses = estimator.guess(points, fits[kept])
                order = np.argsort(-guesses, kind="stable")[:_MOST]
                points, guesses = points[order], guesses[order]
                shares = softmax(guesses)
                keys = predictor.unknowns.keys(points)
                seen = share_seen(keys, shares, discovered, predictor.unknowns)
                fresh = sum(shares[row] for row, key in enumerate(keys) if key not in known)
                known.update(keys)
                explained = explains(points[0], predictor, data, self._noise)
                if explained and seen >= _AGREED and fresh <= _NEGLIGIBLE:
                    break
                if explained and not late and wanders:
                    break
                number += 1
                agreed = explained and seen >= _AGREED
                lost = lost or (number > 1 and late and not wanders and not agreed)
                steps = self._effort.steps * (_LONGER if lost else 1)
                for search in searches:
                    search.start_anew(all_levels=lost)
        modes: list[ModeEvidence] = []
        for point, guess in zip(points, guesses, strict=True):
            if modes and guess < max(one.log_evidence for one in modes) - _WEIGHED:
                break
            modes.append(estimator.of(point, self._neighbours(point, fits[0]), self._rng))
        return self._weigh(points[: len(modes)], modes, discovered)

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

    def _burn_in(self) -> None:
        """Brings the coldest chains, which began too far out, to where the posterior is."""
        allowance = _CONSIDERED + self.predictor.unknowns.continuous.size
        for _ in range(_BURN_INS):
            self._sampled(_BURN_IN * self._effort.frozen)
            for population in self._populations:
                fits = population.posterior_fits(1)
                lost = np.flatnonzero(fits < fits.max() - allowance)
                kept = np.flatnonzero(fits >= fits.max() - allowance)
                rows = np.arange(len(fits))
                rows[lost] = self._rng.choice(kept, lost.size)
                population.replace_coldest(population.values[rows], population.scales[rows])

    def _sampled(self, steps: int) -> tuple[Array, Array]:
        values, scales = [], []
        for step in range(steps):
            for population in self._populations:
                population.step_coldest()
            if step % EVERY == EVERY - 1:
                for population in self._populations:
                    cold = slice(0, population.width)
                    values.append(population.values[cold].copy())
                    scales.append(population.scales[cold].copy())
        return np.concatenate(values), np.concatenate(scales)

    def _weigh(
        self, points: Array, modes: Sequence[ModeEvidence], discovered: Sequence[Bodies]
    ) -> Posterior:
        logs = np.array([mode.log_evidence for mode in modes])
        shares = softmax(logs)
        keys = self.predictor.unknowns.keys(points)
        named = [
            Mode(key, float(share), point, mode.effective)
            for key, share, point, mode in zip(keys, shares, points, modes, strict=True)
        ]
        count = self._effort.width
        spread = [_spread_out(mode.weights, count) for mode in modes]
        for population in self._populations:
            which = self._rng.choice(len(modes), count, p=shares)
            drawn = [
                (int(mode), int(self._rng.choice(len(spread[mode]), p=spread[mode])))
                for mode in which
            ]
            population.replace_coldest(
                np.array([modes[mode].values[row] for mode, row in drawn]),
                np.array([modes[mode].scales[row] for mode, row in drawn]),
            )
        poor = modes[int(np.argmax(shares))].effective < count
        if poor:
            self._burn_in()
        values, scales = self._sampled(self._effort.frozen)
        return Posterior(
            values=values,
            scales=scales,
            weights=np.full(len(values), 1 / len(values)),
            modes=tuple(sorted(named, key=lambda mode: -mode.probability)),
            seen=share_seen(keys, shares, discovered, self.predictor.unknowns),
        )


def _spread_out(weights: Array, wanted: int) -> Array:
    """Weights raised to a power, so that at least so many draws count: a start for chains."""
    power = 1.0
    while True:
        spread = weights**power
        spread /= spread.sum()
        if 1 / np.sum(spread**2) >= wanted or power < _LEAST_POWER:
            return spread
        power /= 2


def _union(discovered: Sequence[Bodies], unknowns: Unknowns) -> tuple[Array, Array]:
    values = np.concatenate([one.values for one in discovered])
    fits = np.concatenate([one.fits for one in discovered])
    order = best_of_each(unknowns.keys(values), fits)
    return values[order], fits[order]
