"""The sampler of the posterior after each interaction: it discovers, weighs and samples modes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import Any, Final

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import SearchStateError
from estimator.physics.base import ArrayPhysics
from estimator.posterior.checks.verdict import fit_of
from estimator.posterior.discovery.beginning import Beginning
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.gauss_newton import GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.model.unknowns import Attachments, Cost, Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior, found_by_each, systematic
from estimator.posterior.sampling.mixing import mixed
from estimator.posterior.sampling.populations import Agreement, explored
from estimator.posterior.sampling.weighing import Weigher

ALGORITHM: Final = "evolutionary Monte Carlo"

_AGREED_COVERAGE: Final = 0.8  # coverage by both populations at which they agree
_EXPLORED: Final = 0.4  # coverage from which attachments are weighed while populations explore
_EXTRA_ROUNDS: Final = 4  # additional rounds where populations do not agree
_FEW_ROUNDS: Final = 3  # rounds at most, where many attachments are open and a round is long
_NEGLIGIBLE: Final = 0.05  # share of the posterior that the last round may have added
_SURE_SHARE: Final = 0.9  # share of some attachments from which no others are looked for


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much a sampler does after each interaction; all are counts.

    Attributes:
        populations: Independent populations of chains.
        levels: Levels of each population.
        chains_per_level: Chains on each level.
        steps: Steps of one round of the search.
        rounds: Largest number of rounds of the search.
        particles: Largest number of particles for the evidence of one set of attachments.
        samples: Samples of the posterior; a multiple of 8, since chains go on from them in two
            parts.
    """

    populations: int = 2
    levels: int = 10
    chains_per_level: int = 32
    steps: int = 40
    rounds: int = 6
    particles: int = 512
    samples: int = 256


class Sampler:
    """Samples the posterior of one problem, interaction after interaction.

    Args:
        unknowns: The cube that the posterior is over. Deviations from what is stated are open when
            bodies are weighed. Searches take those of the last posterior as fixed
            (``mean_deviations``); where many attachments are open none, since a wrong body's
            deviations are wrong, too.
        make_physics: Makes a back-end for each population.
        effort: How much to do.
        seeds: One seed for each population, and one more for the sampler itself.
        workers: Executor that moves the populations' chains; its number of workers changes no
            result.
        physics: Computes readings in this process; by default a back-end made by ``make_physics``.

    Attributes:
        predictor: Predicts readings.
    """

    def __init__(
        self,
        unknowns: Unknowns,
        make_physics: Callable[[], ArrayPhysics],
        effort: Effort,
        seeds: Sequence[np.random.SeedSequence],
        *,
        workers: Executor,
        physics: ArrayPhysics | None = None,
    ) -> None:
        self._effort = effort
        self._workers = workers
        self._explores, self._telling = unknowns.many, unknowns.telling
        self._restartable = bool(unknowns.choices.size) and not unknowns.many
        self.predictor = Predictor(unknowns, physics or make_physics())
        self._deviations = np.zeros(len(unknowns.table))
        *search_seeds, sampler_seed = seeds
        self._beginning = Beginning(
            unknowns=unknowns,
            make_physics=make_physics,
            levels=effort.levels,
            chains_per_level=effort.chains_per_level,
        )
        self._searches = [
            self._beginning.search(self._deviations, seed)
            for _, seed in zip(range(effort.populations), search_seeds, strict=True)
        ]
        self._rng = np.random.default_rng(sampler_seed)
        self._known: set[Attachments] = set() if unknowns.choices.size else {()}
        self._cleared: set[Attachments] = set()  # than which many rounds have found nothing better
        self._verified: set[Attachments] = set()  # beside which a restart has found little
        self._causes: dict[int, Array] = {}  # the last point weighed with each large deviation

    def state(self) -> dict[str, Any]:
        """All that ``restore`` needs, for JSON."""
        return {
            "algorithm": ALGORITHM,
            "populations": [search.population.state() for search in self._searches],
            "searching": [search.rng.bit_generator.state for search in self._searches],
            "random": self._rng.bit_generator.state,
            "starts": [search.starts.tolist() for search in self._searches],
            "converged": sorted(self._searches[0].converged),
            "known": sorted(self._known),
            "cleared": sorted(self._cleared),
            "verified": sorted(self._verified),
            "causes": [[row, point.tolist()] for row, point in sorted(self._causes.items())],
            "deviations": self._deviations.tolist(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Goes back to a state, as if what came after it had not been.

        Raises:
            SearchStateError: The state is not that of such a sampler.
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
        names = ("populations", "searching", "starts")
        by_search = zip(self._searches, *(state[name] for name in names), strict=True)
        for search, population, rng, starts in by_search:
            points = np.array(starts, dtype=float)
            search.starts = points.reshape(-1, self.predictor.unknowns.genes_size)
            search.population = Population.from_state(population, search.predictor)
            search.rng.bit_generator.state = rng
            search.converged = frozenset(map(tuple, state["converged"]))
        self._rng.bit_generator.state = state["random"]
        self._known, self._cleared, self._verified = (
            set(map(tuple, state[name])) for name in ("known", "cleared", "verified")
        )
        self._causes = {row: np.array(point, dtype=float) for row, point in state["causes"]}
        self._search_with(np.array(state["deviations"], dtype=float))

    @property
    def cost(self) -> Cost:
        """Counts of what was computed so far."""
        costs = [search.predictor.cost for search in self._searches]
        return Cost(*map(sum, zip(self.predictor.cost, *costs, strict=True)))

    def prior(self) -> Posterior:
        """Equally likely samples of the prior."""
        populations = [search.population for search in self._searches]
        values = np.concatenate([population.values for population in populations])
        scales = np.concatenate([population.scales for population in populations])
        return Posterior.equally_likely(self.predictor.unknowns.as_stated(values), scales)

    def _search_with(self, deviations: Array) -> None:
        """Has searches look for bodies with these deviations, shape (rows,)."""
        self._deviations = deviations
        for search in self._searches:
            search.predictor.unknowns = self.predictor.unknowns.with_fixed_deviations(deviations)

    def learn(self, likelihood: Likelihood) -> Posterior:
        """The posterior after the interactions so far.

        While the readings do not inform about all limbs no attachments are weighed (see
        ``explored``), unless the populations agree earlier.

        Args:
            likelihood: Likelihood of all these interactions.
        """
        known = set(self._known)
        for search in self._searches:
            search.observe(likelihood)
        explores = self._explores and not self._searches[0].converged
        if explores:
            self._searches, exploring, share = explored(
                self._searches,
                self._workers,
                steps=self._effort.steps,
                rounds=_FEW_ROUNDS if len(likelihood) >= self._telling - 1 else 1,
            )
            if len(likelihood) < self._telling and share < _EXPLORED:
                return self._completed(exploring)
            bodies = [search.best() for search in self._searches]
            known.update(*(self.predictor.unknowns.keys(points.values) for points in bodies))
        agreement = self._discovered(likelihood, known, searched=explores)
        return self._weighed(agreement, likelihood)

    def _discovered(
        self, likelihood: Likelihood, known: set[Attachments], *, searched: bool
    ) -> Agreement:
        """Searches in rounds, until the populations have converged.

        They have converged when the readings are explained, the populations agree, and the last
        round has added next to nothing to the posterior. The more interactions, the more rounds are
        allowed: few readings leave many bodies, and the next reading tells more than another round.
        Where populations that should agree do not, or the readings are explained poorly, all
        chains restart: one pose that ended on another branch may have led them far from the truth.
        A population that has found the best body rests until the others have found it. Once chains
        have restarted many times for one poorly fitting body, they no longer do for it.
        Before attachments converge one population restarts, until they have been probable once
        where readings can tell: what all have kept so far may not be all that there is.

        Args:
            likelihood: Likelihood of all observations.
            known: Attachments that were found before.
            searched: Whether the searches have just explored, which was a round.
        """
        effort, can_tell = self._effort, len(likelihood) >= self._telling
        solver = GaussNewton(self.predictor, likelihood)
        rounds_made, restarts = 0, 0
        going = [not searched] * len(self._searches)
        while True:
            self._search(going, restarts=restarts > 0)
            bodies = [search.best() for search in self._searches]
            agreement = Agreement.of(bodies, self._deviations, solver)
            added = 1 - agreement.share_of(known)
            known.update(agreement.keys)
            rounds_made += 1
            agreed = agreement.explained and agreement.coverage >= _AGREED_COVERAGE
            improvable = agreement.fit.is_improvable and agreement.leader not in self._cleared
            disagreed = can_tell and rounds_made > 1 and not agreed
            restart = agreement.few and (improvable or disagreed)
            # also where many sets of attachments fit as badly
            restart |= agreement.explains_too_little and improvable
            if restart and self._restartable:
                restarts += 1
                lacking = [improvable or agreement.leader not in found for found in agreement.found]
                going = [lacks or not any(lacking) for lacks in lacking]
            converged = agreement.adequate_fit and agreed and added <= _NEGLIGIBLE
            if self._explores:
                going = [True] * len(self._searches)
                converged |= agreement.explained and not can_tell
                rounds = _FEW_ROUNDS
            else:
                converged &= not (0 < restarts <= _EXTRA_ROUNDS and improvable)
                rounds = min(effort.rounds, max(1, len(likelihood) - 1))
                rounds += _EXTRA_ROUNDS if restarts and can_tell else 0
            if converged or rounds_made >= rounds:
                settled = self._converged(agreement) if agreed else frozenset()
                if self._restartable and not (restarts or settled <= self._verified):
                    restarts += 1
                    going = [row == rounds_made % len(going) for row in range(len(going))]
                    continue
                if can_tell and agreement.share_of(settled) > _SURE_SHARE:
                    self._verified |= settled
                if restarts > _EXTRA_ROUNDS:
                    self._cleared.update(agreement.leaders)
                for search in self._searches:
                    search.converged = settled
                return agreement

    def _search(self, going: Sequence[bool], *, restarts: bool) -> None:
        """One more round of those searches that are going."""
        search = partial(_searched, self._effort.steps, restarts)
        moved = iter(self._workers.map(search, compress(self._searches, going)))
        self._searches = [
            next(moved) if goes else kept for kept, goes in zip(self._searches, going, strict=True)
        ]

    def _converged(self, agreement: Agreement) -> frozenset[Attachments]:
        """Attachments not searched again while they explain the readings: one set, if it leads.

        Where many attachments are open: all sets that are left, also where they leave one
        interaction unexplained, as an outlier does, since restarts are too dear there. Two
        unexplained interactions end it.
        """
        if self._explores:
            return frozenset(agreement.keys)
        sure = agreement.adequate_fit and not agreement.fit.is_improvable
        leads = sure and agreement.share_of({agreement.leader}) > 0.5
        return frozenset({agreement.leader} if leads else ())

    def _completed(self, posterior: Posterior) -> Posterior:
        """A posterior over genomes as one over all unknowns, without deviations."""
        complete = self.predictor.unknowns.as_stated
        modes = (replace(mode, point=complete(mode.point[None])[0]) for mode in posterior.modes)
        return replace(posterior, values=complete(posterior.values), modes=tuple(modes))

    def _weighed(self, agreement: Agreement, likelihood: Likelihood) -> Posterior:
        """Modes by their evidences, and samples."""
        predictor, effort, unknowns = self.predictor, self._effort, self.predictor.unknowns
        weigher = Weigher(
            predictor,
            likelihood,
            self._rng,
            workers=self._workers,
            particles=effort.particles,
            causes=self._causes,
        )
        weigher.weigh(agreement.points, agreement.guesses)
        agreement = agreement.with_fit(fit_of(weigher.best, predictor, likelihood))
        can_tell = self._restartable and len(likelihood) >= self._telling
        if unknowns.table and can_tell and agreement.fit.is_improvable:
            points, cost = self._beginning.found_with_each(
                likelihood, effort.steps, self._rng, self._workers
            )
            predictor.add_cost(cost)
            weigher.weigh_causes(points)
            agreement = agreement.with_fit(fit_of(weigher.best, predictor, likelihood))
        self._causes |= weigher.causes
        modes = weigher.summed(effort.samples)
        misfits = likelihood.misfits_of(predictor, np.vstack([modes.values, modes.rare]))
        all_scales = likelihood.drawn_scales(misfits, self._rng)
        scales, rare_scales = np.split(all_scales, [len(modes.values)])
        if unknowns.choices.size and modes.shares.max() < _SURE_SHARE:
            modes, scales = mixed(
                modes,
                scales,
                predictor,
                likelihood,
                self._rng,
                workers=self._workers,
                steps=effort.steps,
            )
        values = modes.values
        sample_keys, keys = map(unknowns.keys, (values, modes.points))
        for search, found in zip(self._searches, agreement.found, strict=True):
            allowed = [row for row, key in enumerate(sample_keys) if self._explores or key in found]
            if allowed:
                rows = self._rng.choice(allowed, effort.chains_per_level)
                search.population.replace_coldest(unknowns.cube(values[rows]), scales[rows])
            draws = modes.drawn_of([row for row, key in enumerate(keys) if key in found])
            search.starts = np.vstack([search.starts, unknowns.cube(draws)])
        self._known = set(keys)
        if unknowns.table and not self._explores:
            best = modes.points[int(np.argmax(modes.shares))]
            self._search_with(unknowns.mean_deviations(values, best))
        found_by = found_by_each(keys, agreement.found).tolist()
        posterior = replace(
            Posterior.equally_likely(values, scales),
            modes=tuple(
                Mode(key, float(share), point, float(ess), tuple(found))
                for key, share, point, ess, found in zip(
                    keys, modes.shares, modes.points, modes.ess, found_by, strict=True
                )
            ),
            adequate_fit=agreement.adequate_fit,
            causes=modes.causes,
            as_stated=modes.as_stated,
        )
        posterior = renormalised(posterior, predictor, likelihood)
        common_share = 1 - modes.rare_shares.sum()
        return replace(
            posterior,
            values=np.vstack([posterior.values, modes.rare]),
            scales=np.vstack([posterior.scales, rare_scales]),
            weights=np.concatenate([common_share * posterior.weights, modes.rare_shares]),
        )


def _searched(steps: int, restarts: bool, search: Discovery) -> Discovery:
    """The search after one more round, before which all chains may restart."""
    if restarts:
        search.restart(steps)
    search.search(steps)
    return search


def renormalised(posterior: Posterior, predictor: Predictor, likelihood: Likelihood) -> Posterior:
    """The posterior under a normalised likelihood, also where bodies may fall to several sides.

    Args:
        posterior: Equally likely samples, and modes, under ``likelihood``, whose densities add up
            to more than 1 there.
        predictor: Computes readings.
        likelihood: Likelihood of all observations.

    Returns:
        Equally likely samples, and modes, the most probable first.
    """

    def ratios(values: Array, scales: Array) -> Array:
        as_it_is = likelihood.of(likelihood.misfits_of(predictor, values), scales=scales)
        ratios: Array = (likelihood.normalised(predictor, values, scales) - as_it_is).sum(axis=1)
        return ratios

    modes, keys = posterior.modes, predictor.unknowns.keys(posterior.values)
    sample_ratios = ratios(posterior.values, posterior.scales)
    factors = ratios(np.array([mode.point for mode in modes]), np.zeros((len(modes), 2)))
    for number, mode in enumerate(modes):
        mode_ratios = sample_ratios[[key == mode.attachments for key in keys]]
        if mode_ratios.size:
            factors[number] = logsumexp(mode_ratios) - math.log(mode_ratios.size)
    shares = np.array([mode.probability for mode in modes]) * np.exp(factors - factors.max())
    rows = systematic(softmax(sample_ratios), len(keys), 0.5)
    changed = (
        replace(mode, probability=share)
        for mode, share in zip(modes, (shares / shares.sum()).tolist(), strict=True)
    )
    return replace(
        posterior,
        values=posterior.values[rows],
        scales=posterior.scales[rows],
        modes=tuple(sorted(changed, key=lambda mode: -mode.probability)),
    )
