from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.body.morphology import Base
from estimator.errors import SearchStateError
from estimator.executors import ThisProcess, WorkerProcesses
from estimator.parameters.table import CARE
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.verdict import Fit
from estimator.posterior.discovery.discovery import Discovery
from estimator.posterior.model.gauss_newton import Free, GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling import populations, sampler
from estimator.posterior.sampling.mixing import mixed
from estimator.posterior.sampling.sampler import Effort
from estimator.posterior.sampling.tempering import Target, tempered
from estimator.posterior.sampling.weighing import drawn
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.conftest import BODY
from tests.estimator.little_effort import little_search
from tests.estimator.posterior.sampling.enumeration import NODES, WEIGHTS, distance, enumerated
from tests.estimator.two_unknown_rows import (
    NOISE,
    POINT,
    QUICK,
    TWO_UNKNOWN_ROWS,
    draw,
    make_sampler,
    programs,
)

WIDE = Noise(tilt=0.12, clearance=0.03)


@pytest.fixture
def little() -> Iterator[None]:
    with little_search():
        yield


def test_probabilities_of_attachments_agree_with_enumeration(narrow: Predictor) -> None:
    data = draw(narrow, POINT, programs(3, seed=3), np.random.default_rng(6))
    exact = enumerated(narrow, data, WIDE, (4, 6, 2, 4, 6))
    effort = Effort(levels=4, chains_per_level=16, steps=40, rounds=1, particles=8000, samples=1000)
    posterior = make_sampler(narrow, effort=effort, seed=3).learn(Likelihood(data, WIDE))
    sampled = {mode.attachments: mode.probability for mode in posterior.modes}
    assert distance(sampled, exact) < 0.03  # evidences are known to some 4 %


def test_the_body_is_identified_and_its_lengths_bracketed(predictor: Predictor) -> None:
    data = draw(predictor, POINT, programs(6), np.random.default_rng(2))
    posterior = make_sampler(predictor).learn(Likelihood(data, NOISE))
    assert posterior.modes[0].attachments == predictor.unknowns.keys(POINT[None])[0]
    assert posterior.modes[0].probability > 0.9
    assert posterior.modes[0].found == (True, True)
    for column in predictor.unknowns.continuous:
        low, high = np.quantile(posterior.values[:, column], (0.005, 0.995))
        assert low - 0.002 < POINT[column] < high + 0.002
        assert high - low < 0.9  # the prior's is 0.99


def test_who_moves_the_chains_makes_no_difference(predictor: Predictor) -> None:
    data = draw(predictor, POINT, programs(2), np.random.default_rng(2))
    here = make_sampler(predictor, effort=QUICK)
    with WorkerProcesses(2) as workers:
        there = make_sampler(predictor, effort=QUICK, workers=workers)
        for interactions in (1, 2):
            so_far = Likelihood(data[:interactions], NOISE)
            expected, posterior = here.learn(so_far), there.learn(so_far)
    assert np.array_equal(posterior.values, expected.values)
    assert there.cost == here.cost
    assert json.dumps(there.state()) == json.dumps(here.state())


@pytest.mark.usefixtures("little")
@pytest.mark.parametrize(("interactions", "leads"), [(1, False), (6, True)])
def test_chains_go_on_to_other_attachments_until_one_set_leads(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch, interactions: int, leads: bool
) -> None:
    called = []

    def noted(*args: Any, **kwargs: Any) -> Any:
        called.append(True)
        return mixed(*args, **kwargs)

    monkeypatch.setattr(sampler, "mixed", noted)
    data = draw(predictor, POINT, programs(6), np.random.default_rng(2))[:interactions]
    posterior = make_sampler(predictor, effort=QUICK).learn(Likelihood(data, NOISE))
    assert (posterior.modes[0].probability > 0.9) == leads
    assert bool(called) != leads


def test_evidence_is_the_integral_over_the_lengths(narrow: Predictor) -> None:
    data = draw(narrow, POINT, programs(3, seed=3), np.random.default_rng(6))
    likelihood = Likelihood(data, WIDE)
    solver = GaussNewton(narrow, likelihood)
    values, _ = solver.polished(POINT[None])
    target = Target(
        peaks=values[None],
        free=Free.lengths(narrow.unknowns.continuous, 1),
        precision=solver.slopes(values).precision[None],
        by_care=np.zeros((1, 2), dtype=bool),
        predictor=narrow,
        likelihood=likelihood,
        rng=np.random.default_rng(1),
    )
    (mode,) = tempered(target, 2000)
    grid = (np.arange(20) + 0.5) / 20
    points = np.repeat(POINT[None], 400, axis=0)
    points[:, narrow.unknowns.continuous] = np.array(np.meshgrid(grid, grid)).reshape(2, -1).T
    misfits = likelihood.misfits_of(narrow, points)
    total = 0.0
    for one, share in zip(NODES, WEIGHTS, strict=True):
        for two, part in zip(NODES, WEIGHTS, strict=True):
            factors = np.tile([one, two], (400, 1))
            fits = likelihood.of(misfits, np.ones(400), factors).sum(axis=1)
            total += share * part * float(np.mean(np.exp(fits)))
    assert mode.log_evidence == pytest.approx(np.log(total), abs=0.1)
    assert mode.ess > 100


def test_how_carefully_a_robot_was_built_is_averaged_over() -> None:
    """An accelerometer that is tilted three times as far as usual tells something of the care."""
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    table = [row for row in problem.table if row.group == "accelerometer_deg"]
    genome = Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    predictor = Predictor(Unknowns(genome, table), StaticsPhysics())
    true = predictor.unknowns.points(POINT[None], {table[0].name: np.array([3 * table[0].narrow])})
    data = draw(predictor, true[0], programs(3, seed=3), np.random.default_rng(6))
    likelihood = Likelihood(data, NOISE)
    solver = GaussNewton(predictor, likelihood)

    def evidence(factor: float, *, known: bool) -> float:
        spreads = [{row: factor * one.narrow for row, one in enumerate(table)}]
        free = Free.with_parameters(predictor.unknowns, spreads)
        peaks, _ = solver.polished(true, free=free)
        target = Target(
            peaks=peaks[None],
            free=free,
            precision=solver.slopes(peaks, free=free).precision[None],
            by_care=free.normal[None] & (not known),
            predictor=predictor,
            likelihood=likelihood,
            rng=np.random.default_rng(1),
        )
        (mode,) = tempered(target, 4000)
        return mode.log_evidence

    nodes, weights = np.polynomial.hermite_e.hermegauss(7)
    each = [evidence(math.exp(CARE * node), known=True) for node in nodes]
    assert max(each) - min(each) > 1
    averaged = np.log(np.exp(each) @ weights / weights.sum())
    assert evidence(1.0, known=False) == pytest.approx(averaged, abs=0.1)


@pytest.mark.usefixtures("little")
def test_nothing_is_certain_while_one_of_two_interactions_is_explained_by_nobody(
    predictor: Predictor,
) -> None:
    data = draw(predictor, POINT, programs(2), np.random.default_rng(2))
    assert make_sampler(predictor, effort=QUICK).learn(Likelihood(data, NOISE)).adequate_fit
    data.observed["tilt"].values[1] += 0.6
    assert not make_sampler(predictor, effort=QUICK).learn(Likelihood(data, NOISE)).adequate_fit


class Watched(ThisProcess):
    """Remembers the searches that it has moved."""

    def map(self, fn: Callable[..., Any], *tasks: Iterable[Any], **options: Any) -> Iterator[Any]:
        results = list(super().map(fn, *tasks, **options))
        if results and isinstance(results[0], Discovery):
            self.searches = results
        return iter(results)


@pytest.mark.usefixtures("little")
def test_no_population_goes_on_from_what_only_another_has_met(predictor: Predictor) -> None:
    """Else both would agree on what one of them has looked for."""
    watched, unknowns = Watched(), predictor.unknowns
    posterior = make_sampler(predictor, effort=QUICK, workers=watched).learn(
        Likelihood(draw(predictor, POINT, programs(1), np.random.default_rng(2)), NOISE)
    )
    summarised = set(unknowns.keys(posterior.values))
    for search in watched.searches:
        found = set(unknowns.keys(search.best().values))
        assert summarised - found  # some only the other has found
        cold = search.population.values[: search.population.chains_per_level]
        assert set(unknowns.keys(cold)) <= found


def test_where_there_are_many_modes_those_that_are_drawn_stand_for_all() -> None:
    rng = np.random.default_rng(1)
    guesses = np.concatenate([[3.0, 2.0], rng.normal(-5.0, 2.0, 1500)])
    shares = np.exp(guesses)
    totals = []
    for _ in range(200):
        rows, log_chances = drawn(guesses, rng)
        assert len(rows) <= 120
        assert {0, 1} <= set(rows.tolist())  # worth more than their part
        totals.append(np.sum(shares[rows] / np.exp(log_chances)))
    assert np.mean(totals) == pytest.approx(shares.sum(), rel=1e-3)
    assert np.std(totals) < 0.02 * shares.sum()


def test_large_deviations_that_were_weighed_are_in_the_state() -> None:
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    genome = Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    predictor = Predictor(Unknowns(genome, problem.table), StaticsPhysics())
    (true,) = predictor.unknowns.points(POINT[None], {"travel of all servos": np.array([0.3])})
    likelihood = Likelihood(draw(predictor, true, programs(6), np.random.default_rng(2)), NOISE)
    here, there = (make_sampler(predictor, effort=QUICK) for _ in range(2))
    here.learn(likelihood[:5])
    state = json.loads(json.dumps(here.state()))
    assert state["causes"]
    there.restore(state)
    assert np.array_equal(there.learn(likelihood).values, here.learn(likelihood).values)


def test_the_state_of_another_version_is_refused_in_words(predictor: Predictor) -> None:
    state = make_sampler(predictor).state()
    del state["known"]
    with pytest.raises(SearchStateError, match="another version of the sampler: start a new run"):
        make_sampler(predictor).restore(state)


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[Discovery]:
    """Searches that would have restarted, and go on instead."""
    searches: list[Discovery] = []
    monkeypatch.setattr(Discovery, "restart", lambda search, steps: searches.append(search))
    return searches


@pytest.mark.usefixtures("little", "begun")
def test_nothing_is_certain_of_four_interactions_that_are_explained_poorly(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = draw(predictor, POINT, programs(5, seed=4), np.random.default_rng(2))
    for module in (populations, sampler):
        monkeypatch.setattr(module, "fit_of", lambda *body: Fit(unexplained=0, excess=1.5))
    believing = make_sampler(predictor, effort=QUICK)
    assert not believing.learn(Likelihood(data[:4], NOISE)).adequate_fit
    assert believing.learn(Likelihood(data, NOISE)).adequate_fit


@pytest.mark.usefixtures("little")
def test_a_body_that_fits_poorly_is_searched_for_anew_once(
    predictor: Predictor, begun: list[Discovery], monkeypatch: pytest.MonkeyPatch
) -> None:
    data = draw(predictor, POINT, programs(6), np.random.default_rng(2))
    monkeypatch.setattr(populations, "fit_of", lambda *body: Fit(unexplained=0, excess=1.5))
    poor = make_sampler(predictor, effort=QUICK)
    poor.learn(Likelihood(data, NOISE))
    assert begun
    begun.clear()
    poor.learn(Likelihood(data, NOISE))
    assert not begun


@pytest.mark.usefixtures("little")
@pytest.mark.parametrize(
    ("fit", "anew"),
    [(Fit(unexplained=2, excess=0.0), True), (Fit(unexplained=1, excess=1.5), False)],
)
def test_what_explains_too_little_is_searched_for_anew_though_much_explains_as_little(
    predictor: Predictor,
    begun: list[Discovery],
    monkeypatch: pytest.MonkeyPatch,
    fit: Fit,
    anew: bool,
) -> None:
    data = draw(predictor, POINT, programs(6), np.random.default_rng(2))
    monkeypatch.setattr(populations, "fit_of", lambda *body: fit)
    monkeypatch.setattr(populations.Agreement, "few", False)
    make_sampler(predictor, effort=QUICK).learn(Likelihood(data, NOISE))
    assert bool(begun) == anew


@pytest.mark.usefixtures("little")
def test_before_attachments_converge_one_population_begins_anew_and_no_more_for_the_same(
    predictor: Predictor, begun: list[Discovery]
) -> None:
    data = draw(predictor, POINT, programs(6), np.random.default_rng(2))
    certain = make_sampler(predictor, effort=QUICK)
    certain.learn(Likelihood(data, NOISE))
    assert certain.state()["converged"] == [predictor.unknowns.keys(POINT[None])[0]]
    assert len(begun) == 1
    certain.learn(Likelihood(data, NOISE))
    assert len(begun) == 1


@pytest.mark.usefixtures("little")
def test_what_led_before_readings_can_tell_is_put_to_the_test_again(
    predictor: Predictor, begun: list[Discovery], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(predictor.unknowns, "telling", 4)
    data = draw(predictor, POINT, programs(6)[::-1], np.random.default_rng(2))
    certain = make_sampler(predictor, effort=QUICK)
    early = certain.learn(Likelihood(data[:3], NOISE))
    assert early.modes[0].probability > 0.9
    before = len(begun)
    certain.learn(Likelihood(data, NOISE))
    assert len(begun) == before + 1


def test_given_attachments_are_searched_once_by_each_population(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    genome = Genome(Problem.load("parametric"), BODY)
    given = Predictor(Unknowns(genome), StaticsPhysics())
    searched: list[Discovery] = []
    search = Discovery.search

    def noted(own: Discovery, steps: int) -> Any:
        searched.append(own)
        return search(own, steps)

    monkeypatch.setattr(Discovery, "search", noted)
    point = np.full(given.unknowns.size, 0.5)
    data = draw(given, point, programs(4), np.random.default_rng(2))
    posterior = make_sampler(given, effort=replace(QUICK, rounds=6)).learn(Likelihood(data, NOISE))
    assert len(searched) == QUICK.populations
    low, high = np.quantile(posterior.values, (0.005, 0.995), axis=0)
    assert np.all((low < 0.5) & (high > 0.5))
