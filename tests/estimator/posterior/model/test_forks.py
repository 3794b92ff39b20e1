"""Where a trifle decides to which side a body falls, both sides are explained."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.arrays import Bodies
from estimator.body.morphology import BASE, Array, Morphology, Part
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import GRAVITY_TILTS, Likelihood, apart
from estimator.posterior.model.sensor_data import BRANCH, SensorData
from estimator.posterior.model.unknowns import Columns, Predictor, Unknowns
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.sampling.sampler import renormalised
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, PredictedReadings
from tests.estimator.conftest import BODY, DENSITY
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, TWO_UNKNOWN_ROWS

FORK = np.radians([14.0, -9.0, 11.0, -30.0])
EQUAL_LEGS = Morphology(
    base=BODY,
    parts=tuple(
        Part(parent=BASE, mount=leg, hinge=2, length=0.22, radius=0.006, motor=leg, sensor=leg)
        for leg in range(4)
    ),
    density=DENSITY,
)


def test_an_inclined_gravity_decides_at_a_fork_and_not_elsewhere(statics: StaticsPhysics) -> None:
    bodies = Bodies.of([EQUAL_LEGS] * len(GRAVITY_TILTS))
    fork = statics.read_bodies(bodies, FORK, GRAVITY_TILTS)
    assert {round(math.degrees(tilt)) for tilt in fork.tilt[:, 0]} == {20, -20}
    sure = statics.read_bodies(bodies, np.radians([30.0, -30.0, 7.0, 14.0]), GRAVITY_TILTS)
    for name in ("tilt", "clearance"):
        values = getattr(sure, name)
        assert values == pytest.approx(np.broadcast_to(values[0], values.shape), abs=1e-9)


@pytest.mark.parametrize(("low", "high", "lean"), [(1.0, 1.4, 1.6), (3.0, 4.8, 5.2)])
def test_inclined_gravity_comes_to_all_sides_of_narrow_paths(
    statics: StaticsPhysics, low: float, high: float, lean: float
) -> None:
    lengths = (0.22, 0.15, 0.3, 0.1)
    parts = zip(EQUAL_LEGS.parts, lengths, strict=True)
    unequal = replace(EQUAL_LEGS, parts=tuple(replace(one, length=each) for one, each in parts))
    programs = np.random.default_rng(0).uniform(-0.5, 0.5, (1500, 4))
    bodies = Bodies.of([unequal] * len(programs))
    margins = np.degrees(statics.path_margins_of_bodies(bodies, programs))
    programs = programs[(margins > low) & (margins < high)]
    sides = math.tan(math.radians(lean)) * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    reached = []
    for program in programs:
        ends = statics.read_bodies(bodies[: len(sides)], program, sides)
        leaning = statics.read_bodies(bodies[: len(GRAVITY_TILTS)], program, GRAVITY_TILTS)
        for end in range(len(sides)):
            to_compare = ends[np.full(len(GRAVITY_TILTS), end)]
            reached.append(not apart(to_compare, leaning, NOISE).all())
    assert len(programs) > 10
    assert np.mean(reached) > 0.95


def equal_legs() -> tuple[Predictor, Array]:
    """Predicts for a problem, of which one point is the body with equal legs."""
    problem = Problem.parse(TWO_UNKNOWN_ROWS.replace("length = 0.2\n", "length = 0.22\n"), "rows")
    genome = Genome(problem, BODY)
    point = np.full((1, genome.size), 0.1)
    named = {gene.name: column for column, gene in enumerate(genome.genes)}
    for leg in (1, 2):
        point[0, named[f"mount of leg {leg}"]] = (leg - 1 + 0.5) / 4
        point[0, named[f"hinge of leg {leg}"]] = 2.5 / 6
        point[0, named[f"length of leg {leg}"]] = (0.22 - 0.02) / 0.38
    return Predictor(Unknowns(genome), StaticsPhysics()), point


def at_fork(sides: PredictedReadings, row: int) -> Observation:
    """What a robot feels that has fallen to one of several sides."""
    return Observation(
        angles=tuple(FORK.tolist()),
        touch=tuple(bool(bit) for bit in sides.touch[row]),
        tilt=(float(sides.tilt[row, 0]), float(sides.tilt[row, 1])),
        clearance=float(sides.clearance[row]),
    )


def all_sides(predictor: Predictor, point: Array) -> tuple[PredictedReadings, Columns]:
    """Readings on all sides of the fork, and which are not those on a plumb way."""
    every = np.repeat(point, len(GRAVITY_TILTS), axis=0)
    sides = predictor.read_all(every, FORK[None], GRAVITY_TILTS)
    plumb = sides[np.zeros(len(GRAVITY_TILTS), dtype=np.intp)]
    return sides, np.flatnonzero(apart(plumb, sides, NOISE))


def test_only_sides_that_are_asked_for_are_tried() -> None:
    predictor, point = equal_legs()
    sides, others = all_sides(predictor, point)
    data = SensorData.of([at_fork(sides, int(others[0]))] * 2, MODALITIES, CAP)
    likelihood = Likelihood(data, NOISE)
    asked = np.zeros((1, 2, len(GRAVITY_TILTS)), dtype=bool)
    asked[0, 1, others[1:]] = True
    all_asked = likelihood.misfits_of(predictor, point, sides=~(asked & False))
    assert np.array_equal(all_asked, likelihood.misfits_of(predictor, point))
    assert all_asked[0, :, BRANCH].tolist() == [others[0]] * 2
    some = likelihood.misfits_of(predictor, point, sides=asked)
    assert some[0, :, BRANCH].tolist() == [0, others[1]]


def test_a_body_at_a_fork_explains_both_sides_the_other_half_as_well() -> None:
    predictor, point = equal_legs()
    sides, others = all_sides(predictor, point)
    fits = []
    for row in (0, int(others[0])):
        data = SensorData.of([at_fork(sides, row)], MODALITIES, CAP)
        likelihood = Likelihood(data, NOISE)
        misfits = likelihood.misfits_of(predictor, point)
        assert (misfits[0, 0, BRANCH] > 0) == (row > 0)
        fits.append(likelihood.of(misfits)[0, 0])
        surely = likelihood.misfits_of(predictor, point, branches=0)
        alone = likelihood.of(surely)[0, 0]
        assert (fits[-1] > alone + 5) == (row > 0)
    assert fits[1] - fits[0] == pytest.approx(math.log(0.5), abs=1e-3)


@pytest.mark.parametrize("program", [FORK, np.radians([30.0, -30.0, 7.0, 14.0])])
def test_the_density_of_all_readings_adds_up_to_one_also_where_there_are_two_sides(
    program: Array,
) -> None:
    predictor, point = equal_legs()
    noise, step = NOISE._replace(tilt=0.03), 0.02
    grid = np.arange(-0.7, 0.7, step)
    seen = [
        Observation(angles=tuple(program.tolist()), touch=(None,) * 4, tilt=(x, y))
        for x in grid.tolist()
        for y in grid.tolist()
    ]
    likelihood = Likelihood(SensorData.of(seen, ("tilt",), CAP), noise)
    densities = np.exp(likelihood.normalised(predictor, point))
    anywhere = noise.outlier * (1 - noise.nearby)
    total = anywhere + np.sum(densities - anywhere / math.pi**2) * step**2
    assert total == pytest.approx(1.0, abs=0.02)


def test_a_body_is_no_more_probable_for_falling_to_several_sides() -> None:
    predictor, point = equal_legs()
    points = np.repeat(point, 32, axis=0)
    names = [gene.name for gene in predictor.unknowns.genes]
    hinge = names.index("hinge of leg 2")
    points[16:, hinge] = 0.5 / 6  # the second leg swings level, and the body falls to one side
    sides = predictor.read_all(points[[0, -1]], FORK[None])
    keys = predictor.unknowns.keys(points[[0, -1]])
    modes = [
        Mode(key, 0.5, one, 100.0, (True, True))
        for key, one in zip(keys, points[[0, -1]], strict=True)
    ]
    before = replace(Posterior.equally_likely(points), modes=tuple(modes))
    for row, (own, other) in enumerate(((1 / 1.5, 1.0), (1.0, 1.0))):
        observed = Observation(
            angles=tuple(FORK.tolist()),
            touch=tuple(map(bool, sides.touch[row])),
            tilt=(float(sides.tilt[row, 0]), float(sides.tilt[row, 1])),
            clearance=float(sides.clearance[row]),
        )
        likelihood = Likelihood(SensorData.of([observed], MODALITIES, CAP), NOISE)
        after = renormalised(before, predictor, likelihood)
        shares = {mode.attachments: mode.probability for mode in after.modes}
        torn, sure = shares[keys[0]], shares[keys[1]]
        assert torn / sure == pytest.approx(own / other, rel=0.01)
        stay = sum(key == keys[0] for key in predictor.unknowns.keys(after.values))
        assert stay == round(32 * torn)
        assert np.all(after.weights == 1 / 32)
