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
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.model.unknowns import Attachments, Cost, Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior, found_by_each, systematic
from estimator.posterior.sampling.evidence import EvidenceEstimator
from estimator.posterior.sampling.mixing import mixed
from estimator.posterior.sampling.populations import Agreement, explored
from estimator.posterior.sampling.weighing import Weigher

ALGORITHM: Final = "evolutionary Monte Carlo"

_AGREED: Final = 0.8  # share of the posterior that both have found
_EXPLORED: Final = 0.4  # share that both populations have found while they only explore
_BITS_LEARNT: Final = 6.0  # bits about attachments, by one interaction that moves few limbs
_TELLING: Final = 4  # interactions at least, until the populations ought to agree
_MORE: Final = 4  # rounds, once they turned out not to
_FEW_ROUNDS: Final = 3  # where much is open, and each of them is long
_NEGLIGIBLE: Final = 0.05  # share of the posterior that a round adds


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much a sampler does after each interaction; all are counts.

    Attributes:
        populations: Independent ones.
        levels: Of each.
        chains_per_level: On each.
        steps: Of one round of the search.
        rounds: Of the search, at most.
        particles: For the evidence of one set of attachments, at most; even.
        samples: Of the posterior; a multiple of 8, since chains go on from them in two parts.
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
        unknowns: What the posterior is over. What may be otherwise than stated is open once bodies
            are weighed: searches look for bodies that have it as it was found to be up to then; as
            stated where much is to be found, since with wrong bodies it would be wrong, too.
        make_physics: Makes a back-end for each population.
        effort: How much to do.
        seeds: One for each population and one for what is done in common.
        workers: Move the populations' chains; results do not depend on how many there are.
        physics: Computes what is done in common, when workers rest; by default one more of
            ``make_physics``.

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
        self._explores = unknowns.many
        self._telling = math.ceil(unknowns.bits / _BITS_LEARNT) if self._explores else _TELLING
        self.predictor = Predictor(unknowns, physics or make_physics())
        self._away = np.zeros(len(unknowns.table))
        *own, common = seeds
        self._searches = []
        for _, seed in zip(range(effort.populations), own, strict=True):
            predictor = Predictor(unknowns.searched(self._away), make_physics())
            of_chains, of_search = map(np.random.default_rng, seed.spawn(2))
            population = Population.of_prior(
                predictor, of_chains, levels=effort.levels, chains_per_level=effort.chains_per_level
            )
            self._searches.append(
                Discovery(population, predictor, of_search, explores=self._explores)
            )
        self._rng = np.random.default_rng(common)
        self._known: set[Attachments] = set()
        self._cleared: set[Attachments] = set()  # nothing better was found

    def state(self) -> dict[str, Any]:
        """All that ``restore`` needs, for JSON."""
        return {
            "algorithm": ALGORITHM,
            "populations": [search.population.state() for search in self._searches],
            "searching": [search.rng.bit_generator.state for search in self._searches],
            "random": self._rng.bit_generator.state,
            "met": [search.found.tolist() for search in self._searches],
            "drawn": [search.drawn.tolist() for search in self._searches],
            "agreed_on": sorted(self._searches[0].converged),
            "known": sorted(self._known),
            "cleared": sorted(self._cleared),
            "away": self._away.tolist(),
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
        kept = (state[name] for name in ("populations", "searching", "met", "drawn"))
        for search, population, rng, found, drawn in zip(self._searches, *kept, strict=True):
            search.found, search.drawn = (
                np.array(some, dtype=float).reshape(-1, self.predictor.unknowns.genes_size)
                for some in (found, drawn)
            )
            search.population = Population.from_state(population, search.predictor)
            search.rng.bit_generator.state = rng
            search.converged = frozenset(map(tuple, state["agreed_on"]))
        self._rng.bit_generator.state = state["random"]
        self._known = {tuple(key) for key in state["known"]}
        self._cleared = {tuple(key) for key in state["cleared"]}
        self._search_robots(np.array(state["away"], dtype=float))

    @property
    def cost(self) -> Cost:
        """Counts of what was computed so far."""
        own = [search.predictor.cost for search in self._searches]
        return Cost(*map(sum, zip(self.predictor.cost, *own, strict=True)))

    def prior(self) -> Posterior:
        """Equally likely samples of the prior."""
        populations = [search.population for search in self._searches]
        values = np.concatenate([one.values for one in populations])
        scales = np.concatenate([one.scales for one in populations])
        return Posterior.equally_likely(self.predictor.unknowns.as_stated(values), scales)

    def _search_robots(self, away: Array) -> None:
        """Has searches look for bodies that are so far from what is stated, shape (rows,)."""
        self._away = away
        for search in self._searches:
            search.predictor.unknowns = self.predictor.unknowns.searched(away)

    def learn(self, likelihood: Likelihood) -> Posterior:
        """The posterior after the interactions so far.

        As long as they do not inform about all limbs, no attachments are weighed (see
        ``explored``), unless the populations agree before.

        Args:
            likelihood: Of all of them.
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
            known.update(*(self.predictor.unknowns.keys(one.values) for one in bodies))
        agreement = self._discovered(likelihood, known, searched=explores)
        return self._weighed(agreement, likelihood)

    def _discovered(
        self, likelihood: Likelihood, known: set[Attachments], *, searched: bool
    ) -> Agreement:
        """Searches in rounds.

        They end when the readings are explained, the populations agree, and a round has found
        nothing that matters and was not known before.
        The rounds that it may take grow with the interactions, since few readings leave many
        bodies, and the next one tells more than another round; but for chains that have explored
        before. So few do not make the populations agree.
        Where populations that ought to agree do not, or the readings are not explained well, all
        chains start anew: what one pose that ended elsewhere has led them to may be far from the
        truth. A population that has found what explains them best rests until others have, too.
        For the sake of one body this is done once.

        Args:
            likelihood: Of all observations.
            known: Attachments that were found before.
            searched: Whether the searches have just explored: that was a round.
        """
        effort, late = self._effort, len(likelihood) >= self._telling
        estimator = EvidenceEstimator(self.predictor, likelihood)
        number, anew = 0, 0
        going = [not searched] * len(self._searches)
        while True:
            search = partial(_searched, effort.steps, anew > 0)
            moved = iter(self._workers.map(search, compress(self._searches, going)))
            self._searches = [
                next(moved) if goes else one
                for one, goes in zip(self._searches, going, strict=True)
            ]
            bodies = [search.best() for search in self._searches]
            agreement = Agreement.of(bodies, self._away, estimator)
            fresh = agreement.share_beyond(known)
            known.update(agreement.keys)
            number += 1
            agreed = agreement.explained and agreement.coverage >= _AGREED
            improvable = agreement.improvable and agreement.leader not in self._cleared
            apart = late and number > 1 and not agreed
            restart = agreement.few and (improvable or apart)
            # That many fit as badly is no excuse.
            restart |= agreement.explains_too_little and improvable
            restart &= bool(self.predictor.unknowns.choices.size)  # else there is nothing to find
            if restart and not self._explores:
                anew += 1
                lacking = [improvable or agreement.leader not in own for own in agreement.found]
                going = [lacks or not any(lacking) for lacks in lacking]
            converged = agreement.adequate_fit and agreed and fresh <= _NEGLIGIBLE
            if self._explores:
                going = [True] * len(self._searches)
                converged |= agreement.explained and not late
                rounds = _FEW_ROUNDS
            else:
                converged &= not (0 < anew <= _MORE and improvable)
                rounds = min(effort.rounds, max(1, len(likelihood) - 1))
                rounds += _MORE if anew and (late or improvable) else 0
            if converged or number >= rounds:
                if anew > _MORE:
                    self._cleared.update(agreement.leaders)
                for one in self._searches:
                    one.converged = self._converged(agreement) if agreed else frozenset()
                return agreement

    def _converged(self, agreement: Agreement) -> frozenset[Attachments]:
        """Attachments not searched again while they explain the readings: one set, if it leads.

        Where much was to be found, all that is left, also where that leaves one interaction
        unexplained, as an outlier does: to begin anew after each later one is too dear. Two end
        the agreement.
        """
        if self._explores:
            return frozenset(agreement.keys)
        sure = agreement.adequate_fit and not agreement.improvable and agreement.leads
        return frozenset({agreement.leader} if sure else ())

    def _completed(self, posterior: Posterior) -> Posterior:
        """A posterior over what searches look for, as one over all that is open."""
        complete = self.predictor.unknowns.as_stated
        modes = (replace(mode, point=complete(mode.point[None])[0]) for mode in posterior.modes)
        return replace(posterior, values=complete(posterior.values), modes=tuple(modes))

    def _weighed(self, agreement: Agreement, likelihood: Likelihood) -> Posterior:
        """Modes by their evidences, and samples."""
        predictor, effort, unknowns = self.predictor, self._effort, self.predictor.unknowns
        weigher = Weigher(
            predictor, likelihood, self._rng, workers=self._workers, particles=effort.particles
        )
        modes = weigher.weighed(agreement.points, agreement.guesses, effort.samples)
        scales = likelihood.drawn_scales(likelihood.misfits_of(predictor, modes.values), self._rng)
        if unknowns.choices.size:
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
        whose, keys = map(unknowns.keys, (values, modes.points))
        for search, found in zip(self._searches, agreement.found, strict=True):
            own = [row for row, key in enumerate(whose) if self._explores or key in found]
            if own:
                rows = self._rng.choice(own, effort.chains_per_level)
                search.population.replace_coldest(unknowns.cube(values[rows]), scales[rows])
            rows_found = [row for row, key in enumerate(keys) if key in found]
            search.drawn = unknowns.cube(modes.drawn_of(rows_found))
        self._known = set(keys)
        if unknowns.table:
            best = modes.points[int(np.argmax(modes.shares))]
            agreement = agreement.with_fit(fit_of(best, predictor, likelihood))
            if not self._explores:
                self._search_robots(unknowns.typical(values))
        found_by = found_by_each(keys, agreement.found).tolist()
        posterior = replace(
            Posterior.equally_likely(values, scales),
            modes=tuple(
                Mode(key, float(share), point, float(behind), tuple(found))
                for key, share, point, behind, found in zip(
                    keys, modes.shares, modes.points, modes.ess, found_by, strict=True
                )
            ),
            adequate_fit=agreement.adequate_fit,
            causes=modes.causes,
            as_stated=modes.as_stated,
        )
        return renormalised(posterior, predictor, likelihood)


def _searched(steps: int, anew: bool, search: Discovery) -> Discovery:
    """The search after one more round, for which all chains may begin anew."""
    if anew:
        search.start_anew(steps)
    search.search(steps)
    return search


def renormalised(posterior: Posterior, predictor: Predictor, likelihood: Likelihood) -> Posterior:
    """The posterior under densities that add up to 1, also where bodies may fall to several sides.

    Args:
        posterior: Equally likely samples, and modes, under a likelihood that adds up to more there.
        predictor: Computes readings.
        likelihood: That one.

    Returns:
        Equally likely samples, and modes, the most probable first.
    """

    def ratios(values: Array, scales: Array) -> Array:
        as_found = likelihood.of(likelihood.misfits_of(predictor, values), scales=scales)
        ratios: Array = (likelihood.normalised(predictor, values, scales) - as_found).sum(axis=1)
        return ratios

    modes, keys = posterior.modes, predictor.unknowns.keys(posterior.values)
    of_samples = ratios(posterior.values, posterior.scales)
    factors = ratios(np.array([mode.point for mode in modes]), np.zeros((len(modes), 2)))
    for number, mode in enumerate(modes):
        own = of_samples[[key == mode.attachments for key in keys]]
        if own.size:
            factors[number] = logsumexp(own) - math.log(own.size)
    shares = np.array([mode.probability for mode in modes]) * np.exp(factors - factors.max())
    rows = systematic(softmax(of_samples), len(keys), 0.5)
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
