"""Public optimisers and samplers, each given a target: points of the unit cube and their fits.

An optimiser is restarted until its best attachments have come of ``FOUND_AGAIN`` restarts, or its
CPU time is spent: it cannot know whether they are right. CMA-ES and CatCMA run ``LANES`` instances
in step, since a call of the kernel with few bodies costs mostly the call.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

import cma
import cmaes
import emcee
import nautilus
import numpy as np
from scipy.optimize import differential_evolution

from bench.peers.comparison import Answer, Peer, Target, TimeIsUpError
from estimator.body.morphology import Array
from estimator.posterior.model.unknowns import Attachments

FOUND_AGAIN: Final = 3
LANES: Final = 16
_STAGNATION: Final = 60  # generations without a nat more, after which an instance is restarted
_NATS: Final = 1.0  # by which restarts that have found the same may differ
_WALKERS: Final = 320
_LIVE_POINTS: Final = 2000  # points, of nested sampling


class Optimiser(Protocol):
    """One instance of an optimiser, with ask and tell, in points of the cube."""

    def ask(self) -> Array:
        """The next points, shape (n, size)."""

    def tell(self, fits: Array) -> None:
        """Takes the log-likelihoods of the points that were asked for."""


class CatCma:
    """CatCMA with margin (Hamano et al. 2025): normals of lengths, frequencies of choices."""

    def __init__(self, target: Target, seed: int):
        self._unknowns = target.unknowns
        counts = self._unknowns.counts
        self._choices = counts[self._unknowns.choices]
        space = [[0.0, 1.0]] * self._unknowns.continuous.size
        categories = self._choices.tolist()
        self._search = cmaes.CatCMAwM(x_space=space, c_space=categories or None, seed=seed)
        self._asked: list[Any] = []

    def ask(self) -> Array:
        """The next points."""
        self._asked = [self._search.ask() for _ in range(self._search.population_size)]
        points = np.full((len(self._asked), self._unknowns.size), 0.5)
        points[:, self._unknowns.continuous] = [solution.x for solution in self._asked]
        if self._choices.size:
            chosen = np.array([np.argmax(solution.c, axis=1) for solution in self._asked])
            points[:, self._unknowns.choices] = (chosen + 0.5) / self._choices
        return points

    def tell(self, fits: Array) -> None:
        """Takes the log-likelihoods of the points that were asked for."""
        self._search.tell(list(zip(self._asked, (-fits).tolist(), strict=True)))


class Cma:
    """CMA-ES (Hansen) on the cube as it is: a choice is a range of its column."""

    def __init__(self, target: Target, seed: int):
        size = target.unknowns.size
        options = {"bounds": [0, 1], "seed": seed + 1, "verbose": -9}
        self._search = cma.CMAEvolutionStrategy(size * [0.5], 0.3, options)
        self._asked: list[Array] = []

    def ask(self) -> Array:
        """The next points."""
        self._asked = self._search.ask()
        return np.array(self._asked)

    def tell(self, fits: Array) -> None:
        """Takes the log-likelihoods of the points that were asked for."""
        self._search.tell(self._asked, (-fits).tolist())


class _Restarts:
    """The ends of an optimiser's restarts so far."""

    def __init__(self) -> None:
        self._ended: list[tuple[float, Attachments]] = []

    def add(self, fit: float, key: Attachments) -> bool:
        """Notes a restart's end; whether the best attachments have been found often enough."""
        self._ended.append((fit, key))
        best, leader = max(self._ended)
        agreeing = Counter(attachments for fit, attachments in self._ended if fit > best - _NATS)
        return agreeing[leader] >= FOUND_AGAIN


def _in_lanes(make: Callable[[Target, int], Optimiser], target: Target, seed: int) -> Answer:
    seeds = iter(np.random.SeedSequence(seed).generate_state(100_000).tolist())
    lanes = [make(target, next(seeds)) for _ in range(LANES)]
    bests = [(-np.inf, target.best)] * LANES
    stagnant, restarts = [0] * LANES, _Restarts()
    try:
        while True:
            asked = [lane.ask() for lane in lanes]
            fits = np.split(target(np.concatenate(asked)), np.cumsum([len(a) for a in asked])[:-1])
            for number, (lane, points, values) in enumerate(zip(lanes, asked, fits, strict=True)):
                lane.tell(values)
                row, stagnant[number] = int(np.argmax(values)), stagnant[number] + 1
                if values[row] > bests[number][0]:
                    if values[row] > bests[number][0] + _NATS:
                        stagnant[number] = 0
                    bests[number] = float(values[row]), np.clip(points[row], 0.0, 1.0)
                if stagnant[number] >= _STAGNATION:
                    fit, point = bests[number]
                    if restarts.add(fit, target.key(point)):
                        return Answer(point=target.best, stated=None, finished=True)
                    lanes[number] = make(target, next(seeds))
                    bests[number], stagnant[number] = (-np.inf, point), 0
    except TimeIsUpError:
        return Answer(point=target.best, stated=None, finished=False)


def _evolved(target: Target, seed: int) -> Answer:
    """Answer of SciPy's differential evolution."""
    restarts, bounds = _Restarts(), [(0.0, 1.0)] * target.unknowns.size
    seeds = np.random.SeedSequence(seed).spawn(1000)
    try:
        for child in seeds:
            optimum = differential_evolution(
                lambda columns: -target(np.atleast_2d(columns.T)),
                bounds,
                vectorized=True,
                updating="deferred",
                polish=False,
                tol=1e-4,
                rng=np.random.default_rng(child),
            )
            if restarts.add(-float(optimum.fun), target.key(optimum.x)):
                return Answer(point=target.best, stated=None, finished=True)
    except TimeIsUpError:
        pass
    return Answer(point=target.best, stated=None, finished=False)


def _walked(target: Target, seed: int) -> Answer:
    """Answer of emcee (Foreman-Mackey et al. 2013), by differences of walkers, until time is up."""
    rng, size = np.random.default_rng(seed), target.unknowns.size

    out_of_time = False

    def density(points: Array) -> Array:
        nonlocal out_of_time
        try:
            fits = target(points)
        except TimeIsUpError:  # emcee would print it
            out_of_time = True
            return np.full(len(points), -np.inf)
        fits[np.any((points < 0) | (points > 1), axis=1)] = -np.inf
        return fits

    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(_WALKERS, size, density, moves=moves, vectorize=True)
    sampler._random.seed(seed)
    visited: list[Array] = []
    for state in sampler.sample(rng.random((_WALKERS, size)), iterations=10**6, store=False):
        if out_of_time:
            break
        visited.append(state.coords.copy())
    late = np.concatenate(visited[len(visited) // 2 :])
    keys = Counter(target.unknowns.keys(np.clip(late, 0.0, 1.0)))
    share = keys[target.key(target.best)] / len(late)
    return Answer(point=target.best, stated=share, finished=False)


def _nested(target: Target, seed: int) -> Answer:
    """Answer of Nautilus (Lange 2023): nested sampling with networks that learn where to draw."""
    size = target.unknowns.size
    sampler = nautilus.Sampler(
        lambda cube: cube, target, n_dim=size, n_live=_LIVE_POINTS, vectorized=True, seed=seed
    )
    try:
        finished = bool(sampler.run(n_eff=1000))
    except TimeIsUpError:
        finished = False
    if not finished:
        return Answer(point=target.best, stated=None, finished=False)
    points, log_weights, _ = sampler.posterior()
    agrees = [key == target.key(target.best) for key in target.unknowns.keys(points)]
    share = float(np.exp(log_weights)[agrees].sum() / np.exp(log_weights).sum())
    return Answer(point=target.best, stated=share, finished=True)


PEERS: Final[Mapping[str, Peer]] = {
    "CatCMA with margin": lambda target, seed: _in_lanes(CatCma, target, seed),
    "CMA-ES": lambda target, seed: _in_lanes(Cma, target, seed),
    "differential evolution": _evolved,
    "emcee": _walked,
    "nautilus": _nested,
}
