"""What decides what is named as otherwise is weighed most thoroughly."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

import numpy as np
import pytest

from estimator.body.morphology import Array, Base
from estimator.executors import ThisProcess
from estimator.parameters.table import deviating
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.gauss_newton import Free, GaussNewton
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling import integrals, weighing
from estimator.posterior.sampling.integrals import Hypothesis, Integrals
from estimator.posterior.sampling.weighing import Weigher
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.two_unknown_rows import NOISE, TWO_UNKNOWN_ROWS, draw, programs

CAUSE = "travel of all servos"
PARTICLES = 96


class Heard(ThisProcess):
    """Notes which hypotheses were weighed, and how many without a wide component."""

    def __init__(self) -> None:
        super().__init__()
        self.as_built = 0
        self.starts: list[Array] = []
        self.known: list[Mapping[int, Array]] = []
        self.roughly: list[Hypothesis] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if fn.__name__ == Integrals.with_cost.__name__:
            hypotheses, particles, *_ = args[0]
            self.as_built += sum(one.wide < 0 and not one.as_stated for one in hypotheses)
            if particles < PARTICLES:
                self.roughly += [one for one in hypotheses if one.wide >= 0]
        if fn.__name__ == Integrals.fitted_with_cost.__name__:
            self.starts.append(args[0][1])
            self.known.append(args[0][2])
        return super().submit(fn, *args, **kwargs)


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    """Of a body whose attachments are known; servos and thicknesses may be otherwise."""
    problem = Problem.load("parametric")
    table = [row for row in problem.table if row.group in ("travel", "zero_deg", "thickness")]
    genome = Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    return Predictor(Unknowns(genome, table), StaticsPhysics())


def observed(predictor: Predictor, travel: float) -> tuple[Array, Likelihood]:
    """A body as stated, and readings of one whose servos turn so many times as far."""
    unknowns, rng = predictor.unknowns, np.random.default_rng(3)
    genes = np.full((1, unknowns.genes_size), 0.5)
    (true,) = unknowns.points(genes, {CAUSE: np.array([math.log(travel)])})
    data = draw(predictor, true, programs(6, seed=3), rng, outlier=0.0)
    return unknowns.as_stated(genes)[0], Likelihood(data, NOISE)


@pytest.mark.parametrize(("travel", "named"), [(1.0, False), (1.3, True)])
def test_a_cause_is_named_where_there_is_one(
    predictor: Predictor, travel: float, named: bool
) -> None:
    point, likelihood = observed(predictor, travel)
    rng, workers = np.random.default_rng(1), Heard()
    weigher = Weigher(predictor, likelihood, rng, workers=workers, particles=PARTICLES, causes={})
    weigher.weigh(point[None], np.zeros(1))
    causes = {
        predictor.unknowns.table[one.row].name: one.probability for one in weigher.summed(16).causes
    }
    assert (causes.get(CAUSE, 0.0) > 0.5) == named
    deviations = np.array(workers.starts)[..., predictor.unknowns.genes_size :]
    assert np.all(deviations[:, 0] == 0)  # small deviations may stand in for a large one
    assert np.all(np.any(deviations[:, 1:] != 0, axis=-1))


@pytest.mark.parametrize(("interactions", "tried"), [(1, False), (2, True)])
def test_what_is_improbable_has_points_if_the_body_would_be_another(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch, interactions: int, tried: bool
) -> None:
    """A movement may be chosen to test it; after one interaction any lengths may be the body's."""
    monkeypatch.setattr(weighing, "_PROBABLE", 0.0)
    point, likelihood = observed(predictor, 1.0)
    rng, workers, some = np.random.default_rng(1), Heard(), likelihood[:interactions]
    weigher = Weigher(predictor, some, rng, workers=workers, particles=PARTICLES, causes={})
    weigher.weigh(point[None], np.zeros(1))
    modes = weigher.summed(16)
    table, first = predictor.unknowns.table, predictor.unknowns.genes_size
    with_points = set(deviating(table, modes.rare[:, first:]).tolist()) - {-1}
    assert bool(with_points) == bool(workers.roughly) == tried
    assert with_points <= {one.wide for one in workers.roughly}
    assert modes.rare_shares.sum() < 0.2
    assert np.all(deviating(table, modes.values[:, first:]) == -1)


@pytest.mark.parametrize("sets", [1, 2])
def test_one_set_alone_is_weighed_once_and_several_twice(predictor: Predictor, sets: int) -> None:
    point, likelihood = observed(predictor, 1.0)
    rng, workers = np.random.default_rng(1), Heard()
    weigher = Weigher(predictor, likelihood, rng, workers=workers, particles=PARTICLES, causes={})
    weigher.weigh(point[None].repeat(sets, axis=0), np.zeros(sets))
    modes = weigher.summed(16)
    assert workers.as_built == (1 if sets == 1 else 4)
    assert modes.shares.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(("interactions", "telling"), [(4, 5), (4, 4)])
def test_of_many_sets_causes_are_asked_once_readings_should_tell_them(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch, interactions: int, telling: int
) -> None:
    """Of fewer, that no set explains them says how well was searched."""
    monkeypatch.setattr(predictor.unknowns, "telling", telling)
    point, likelihood = observed(predictor, 1.3)
    rng, workers = np.random.default_rng(1), Heard()
    some = likelihood[:interactions]
    weigher = Weigher(predictor, some, rng, workers=workers, particles=PARTICLES, causes={})
    weigher.weigh(point[None].repeat(24, axis=0), np.zeros(24))
    assert bool(workers.starts) == (interactions >= telling)


@pytest.mark.parametrize("travel", [1.0, 1.2])
def test_what_may_be_otherwise_is_fitted_as_well_as_from_each_known_point(
    predictor: Predictor, travel: float
) -> None:
    """Wide noise does not tell from which of several starts a fit ends best."""
    point, likelihood = observed(predictor, travel)
    unknowns, solver = predictor.unknowns, GaussNewton(predictor, likelihood)
    narrow = np.array([row.narrow for row in unknowns.table])
    rows = [number for number, row in enumerate(unknowns.table) if row.wide and not row.switch]
    starts, first = point[None].repeat(2, axis=0), unknowns.genes_size
    starts[:, first:] += narrow * np.random.default_rng(5).standard_normal((2, len(narrow)))
    found, _ = Integrals(predictor, likelihood).fitted_with_cost((rows[:12], starts, {}, 4))
    for _, row, fitted in found:
        several = np.vstack([fitted, starts.repeat(2, axis=0)])
        wide, which = unknowns.table[row].wide, np.full(len(several), row)
        several[1:, first + row] = wide * np.tile([-1.5, 1.5], 2)
        free = Free.with_parameters(unknowns, [{row: wide}] * len(several))
        polished, fits = solver.polished(several, free=free)
        polished[0], fits[0] = fitted, (solver.fits(several) + free.log_prior(several))[0]
        fits += unknowns.log_narrow(polished, which)
        assert fits[0] >= fits.max() - 1e-6


def test_what_was_weighed_before_is_tried_again(
    predictor: Predictor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another movement may hide from all other starts what was probable before it."""
    monkeypatch.setattr(integrals, "_ANYWHERE", 1)
    point, likelihood = observed(predictor, 1.3)
    unknowns = predictor.unknowns
    row = [one.name for one in unknowns.table].index(CAUSE)
    (true,) = unknowns.points(
        np.full((1, unknowns.genes_size), 0.5), {CAUSE: np.array([math.log(1.3)])}
    )
    far = point.copy()
    far[unknowns.continuous] = 0.02
    fitted_with = Integrals(predictor, likelihood).fitted_with_cost
    (missed, _, _), *_ = fitted_with(([row], far[None], {}, 4))[0]
    (reached, _, again), *_ = fitted_with(([row], far[None], {row: true}, 4))[0]
    assert reached > missed + 10.0
    assert again[unknowns.genes_size + row] == pytest.approx(math.log(1.3), abs=0.05)


def test_weighers_hand_on_what_they_have_weighed(predictor: Predictor) -> None:
    point, likelihood = observed(predictor, 1.3)
    known: dict[int, Array] = {}
    for interactions in (3, 6):
        workers = Heard()
        weigher = Weigher(
            predictor,
            likelihood[:interactions],
            np.random.default_rng(1),
            workers=workers,
            particles=PARTICLES,
            causes=known,
        )
        weigher.weigh(point[None], np.zeros(1))
        assert all(one is known for one in workers.known)
        known = weigher.causes
        table, first = predictor.unknowns.table, predictor.unknowns.genes_size
        assert CAUSE in {table[row].name for row in known}
        assert all(one[first + row] != 0 for row, one in known.items())


@pytest.fixture(scope="module")
def jammed() -> tuple[Array, Likelihood, Predictor, int, int]:
    """A body of which leg 1 stands still, its readings, and columns of that angle and its hinge."""
    problem = Problem.parse(TWO_UNKNOWN_ROWS, "two rows")
    genome = Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    unknowns = Unknowns(genome, problem.table)
    predictor, cause = Predictor(unknowns, StaticsPhysics()), "servo of leg 1 jammed"
    (hinge,) = (at for at, gene in enumerate(genome.genes) if gene.name == "hinge of leg 1")
    genes = np.full((1, unknowns.genes_size), 0.5)
    genes[0, [0, hinge]] = 0.1, 0.75  # another mount than leg 2 has
    (true,) = unknowns.points(genes, {cause: np.array([-0.2])})
    data = draw(predictor, true, programs(6, seed=3), np.random.default_rng(3), outlier=0.0)
    angle = unknowns.genes_size + [one.name for one in problem.table].index(cause)
    return true, Likelihood(data, NOISE), predictor, angle, hinge


def on_other_hinges(true: Array, angle: int, hinge: int) -> Array:
    """The body as stated, with two other hinges."""
    several = true[None].repeat(2, axis=0)
    several[:, hinge] = 0.1, 0.25
    several[:, angle] = 0.0
    return several


def test_a_leg_that_stands_still_is_tried_on_every_hinge(
    jammed: tuple[Array, Likelihood, Predictor, int, int],
) -> None:
    """As stated, readings speak for a hinge about which it need not turn."""
    true, likelihood, predictor, angle, hinge = jammed
    unknowns = predictor.unknowns
    starts, row = on_other_hinges(true, angle, hinge)[:1], angle - unknowns.genes_size
    found, _ = Integrals(predictor, likelihood).fitted_with_cost(([row], starts, {}, 4))
    points = np.array([point for _, _, point in found])
    assert len(set(unknowns.keys(points))) == len(points) == unknowns.genes[hinge].choices
    fits = GaussNewton(predictor, likelihood).fits(np.vstack([points, true]))
    assert fits[:-1].max() > fits[-1] - 1.0
    best = points[np.argmax(fits[:-1])]
    assert abs(best[angle]) == pytest.approx(0.2, abs=0.03)


def test_an_amount_that_the_prior_led_back_to_nothing_is_no_fit(
    jammed: tuple[Array, Likelihood, Predictor, int, int],
) -> None:
    """Where a cause contradicts all readings none tells its amount, and 0 would be as stated."""
    true, likelihood, predictor, _, _ = jammed
    unknowns = predictor.unknowns
    row = [one.name for one in unknowns.table].index("servo of leg 2 jammed")
    found, _ = Integrals(predictor, likelihood).fitted_with_cost(([row], true[None], {}, 4))
    fits = GaussNewton(predictor, likelihood).fits(true[None])
    assert max(guess for guess, _, _ in found) < fits[0] - 10.0


def test_what_two_sets_lead_to_is_weighed_once(
    jammed: tuple[Array, Likelihood, Predictor, int, int],
) -> None:
    true, likelihood, predictor, angle, hinge = jammed
    rng, workers = np.random.default_rng(1), Heard()
    weigher = Weigher(predictor, likelihood, rng, workers=workers, particles=PARTICLES, causes={})
    weigher.weigh(on_other_hinges(true, angle, hinge), np.array([0.0, 0.1]))
    points = np.array([one.point for one in workers.roughly])
    rows = [one.wide for one in workers.roughly]
    keys = list(zip(rows, predictor.unknowns.keys(points), strict=True))
    assert angle - predictor.unknowns.genes_size in rows
    assert len(keys) == len(set(keys))
