from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from estimator.body.morphology import Array, Base
from estimator.exploration.information import Chooser, InformativeProgram
from estimator.exploration.information_gain import InformationGain
from estimator.parameters.table import prior_probabilities
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood, apart
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Posterior
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from estimator.storage.run_config import Learn
from tests.estimator.model_robot import PROBLEM, TRUE_LENGTHS, make_capabilities
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, POINT

ENDS = np.radians([[-30.0, 30.0]] * 4)


def chooser(predictor: Predictor) -> Chooser:
    return Chooser(predictor, InformationGain(NOISE, CAP, MODALITIES), ENDS)


def test_the_program_tells_apart_what_is_uncertain(predictor: Predictor) -> None:
    points = np.tile(POINT, (40, 1))
    points[::2, 5] = 0.1  # hinge of the second leg: yaw instead of up
    choice = chooser(predictor).choose(
        Posterior.equally_likely(points), 0, np.random.default_rng(1)
    )
    assert np.all((choice.program >= ENDS[:, 0]) & (choice.program <= ENDS[:, 1]))
    names = {column: float(bits) for column, bits in enumerate(choice.about)}
    hinge = int(predictor.unknowns.choices[-1])
    assert choice.bits > 0.8
    assert max(names, key=names.__getitem__) == hinge
    assert names[hinge] == pytest.approx(choice.bits, abs=0.1)


def test_a_body_that_is_known_leaves_nothing_to_be_told(predictor: Predictor) -> None:
    choice = chooser(predictor).choose(
        Posterior.equally_likely(np.tile(POINT, (20, 1))), 0, np.random.default_rng(1)
    )
    assert choice.bits == pytest.approx(0.0, abs=1e-6)
    assert choice.about == pytest.approx(np.zeros(7), abs=1e-6)


def test_a_program_tells_whether_a_robot_is_otherwise_than_stated() -> None:
    genome = Genome(Problem.load("parametric"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    unknowns = Unknowns(genome, Problem.load("parametric").table)
    predictor = Predictor(unknowns, StaticsPhysics())
    points = unknowns.as_stated(np.full((20, len(genome.genes)), 0.5))
    names = [row.name for row in unknowns.table]
    points[::2, unknowns.genes_size + names.index("servo of left upper dead")] = 1.0
    ends = np.radians([[-30.0, 30.0]] * 4 + [[0.0, 0.0]] * 4)
    choice = Chooser(predictor, InformationGain(NOISE, CAP, MODALITIES), ends).choose(
        Posterior.equally_likely(points), 0, np.random.default_rng(1)
    )
    assert choice.bits > 0.8
    stated, dead = (predictor.read_all(points[[row]], choice.program[None]) for row in (1, 0))
    assert apart(stated, dead, NOISE).all() or np.any(stated.touch != dead.touch)


def test_what_is_improbable_but_would_bend_a_length_is_told_apart() -> None:
    """A leg that never touched the ground may be short, or its servo may turn the other way."""
    genome = Genome(Problem.load("parametric"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    unknowns = Unknowns(genome, Problem.load("parametric").table)
    predictor = Predictor(unknowns, StaticsPhysics())
    rng, of_left = np.random.default_rng(0), [0, 4]
    assert [genome.genes[column].name for column in of_left] == [
        "length of left upper",
        "length of left lower",
    ]
    genes = 0.5 + rng.uniform(-0.05, 0.05, (100, len(genome.genes)))
    genes[:95, of_left] = 0.0
    points = unknowns.as_stated(genes)
    row = [one.name for one in unknowns.table].index("servo of left upper reversed")
    points[95:, unknowns.genes_size + row] = 1.0
    ends = np.radians([[-30.0, 30.0]] * 4 + [[0.0, 0.0]] * 4)
    choice = Chooser(predictor, InformationGain(NOISE, CAP, MODALITIES), ends).choose(
        Posterior.equally_likely(points), 3, rng
    )
    assert choice.causes == (-1, row)
    assert choice.about_causes > 0.5  # of 0.69 bits, as even as they are weighed
    short, reversed_ = (predictor.read_all(points[[at]], choice.program[None]) for at in (0, -1))
    assert apart(short, reversed_, NOISE).all() or np.any(short.touch != reversed_.touch)


def test_what_is_as_likely_by_the_readings_is_told_apart_if_it_makes_another_body() -> None:
    """However improbable it was before any reading."""
    genome = Genome(Problem.load("parametric"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    unknowns = Unknowns(genome, Problem.load("parametric").table)
    predictor, rng = Predictor(unknowns, StaticsPhysics()), np.random.default_rng(0)
    genes = 0.5 + rng.uniform(-0.02, 0.02, (100, len(genome.genes)))
    genes[90:, 0] += 0.3
    genes[85:90] = genes[:5]
    points, names = unknowns.as_stated(genes), [one.name for one in unknowns.table]
    likely, contradicted, alike = (
        names.index(f"servo of {leg} upper dead") for leg in ("left", "front", "right")
    )
    points[95:, unknowns.genes_size + likely] = 1.0
    points[90:95, unknowns.genes_size + contradicted] = 1.0
    points[85:90, unknowns.genes_size + alike] = 1.0
    before = prior_probabilities(unknowns.table)[likely]
    shares = np.full(100, 1 / 85)
    shares[85:90], shares[90:95], shares[95:] = before / 5, 1e-12, before / 5
    posterior = replace(Posterior.equally_likely(points), weights=shares / shares.sum())
    ends = np.radians([[-30.0, 30.0]] * 4 + [[0.0, 0.0]] * 4)
    choice = Chooser(predictor, InformationGain(NOISE, CAP, MODALITIES), ends).choose(
        posterior, 3, rng
    )
    assert before < 0.001
    assert choice.causes == (-1, likely)
    assert choice.about_causes > 0.8  # of 1 bit, as even as they are weighed


def test_where_a_trifle_decides_how_a_body_falls_nothing_is_told() -> None:
    rng = np.random.default_rng(1)
    genome = Genome(Problem.load("parametric"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    predictor = Predictor(Unknowns(genome), StaticsPhysics())
    points = 0.26 + rng.uniform(-0.03, 0.03, (40, predictor.unknowns.size))  # of the range
    ends = np.radians([[-30.0, 30.0]] * 8)
    gain = InformationGain(NOISE, CAP, MODALITIES)
    choice = Chooser(predictor, gain, ends).choose(Posterior.equally_likely(points), 0, rng)
    rows = np.arange(len(points))
    programs = np.tile(choice.program, (len(points), 1))
    margins = predictor.margins(predictor.unknowns.bodies(points), rows, programs)
    assert np.mean(margins < np.radians(2.0)) < 0.1


@pytest.mark.parametrize("seed", [1, 3])
def test_of_many_parts_those_are_moved_whose_thickness_hardly_matters(seed: int) -> None:
    rng, size = np.random.default_rng(seed), (0.14, 0.14, 0.085)
    shipped = files("estimator") / "problem" / "library" / "topological-24.toml"
    rods = shipped.read_text(encoding="utf-8").replace('shape = "box"', "")
    problem = Problem.parse(rods, "rods")
    genome = Genome(problem, Base(size=size, mass=0.6, mounts=problem.tables.base_mounts(size)))
    unknowns = Unknowns(genome)
    predictor = Predictor(unknowns, StaticsPhysics())
    points = np.tile(unknowns.permitted(rng.random((1, unknowns.size))), (40, 1))
    points[:, unknowns.continuous] += rng.uniform(-0.03, 0.03, (40, 8))
    points = np.clip(points, 0, 1)
    ends = np.radians([[-30.0, 30.0]] * 8)
    choice = Chooser(predictor, InformationGain(NOISE, CAP, MODALITIES), ends).choose(
        Posterior.equally_likely(points), 9, rng
    )
    bodies, rows = unknowns.bodies(points), np.arange(40)
    programs = np.tile(choice.program, (40, 1))
    as_thick = predictor.read(bodies, rows, programs)
    thicker = bodies.changed(radius=1.4 * bodies.radius)
    assert np.mean(apart(as_thick, predictor.read(thicker, rows, programs), NOISE)) < 0.1
    assert choice.bits > 0.5  # which is not for want of anything to tell


def test_the_same_generator_chooses_the_same_program(predictor: Predictor) -> None:
    points = np.random.default_rng(2).random((50, 7))
    one, two = (
        chooser(predictor).choose(Posterior.equally_likely(points), 0, np.random.default_rng(3))
        for _ in range(2)
    )
    assert np.array_equal(one.program, two.program)
    assert one.bits == two.bits


def test_a_movement_for_masses_leaves_them_narrower_than_one_for_lengths() -> None:
    problem = Problem.parse(PROBLEM.replace("density = 1000", "density = 4000"), "heavy legs")
    (mass,) = (row for row in problem.table if row.group == "mass")
    unknowns = Unknowns(Genome(problem, problem.base(make_capabilities())), [mass])
    predictor, rng = Predictor(unknowns, StaticsPhysics()), np.random.default_rng(1)

    def drawn(count: int) -> Array:
        lengths = rng.normal((np.array(TRUE_LENGTHS) - 0.05) / 0.2, 0.005, (count, 4))
        return np.column_stack([lengths, rng.normal(0, 0.7, count)])

    samples, many, robots = Posterior.equally_likely(drawn(200)), drawn(2000), drawn(12)

    def chosen(learn: Learn) -> InformativeProgram:
        own = np.random.default_rng(1)
        return chooser(predictor).choose(samples, 4, own, learn=learn)

    def width(program: Array) -> float:
        """Of the masses' 90 % interval, on average over robots that perform the program."""
        felt, widths = predictor.read_all(robots, np.tile(program, (len(robots), 1))), []
        for robot in range(len(robots)):
            observed = Observation(
                angles=tuple(program.tolist()),
                touch=tuple(felt.touch[robot].tolist()),
                tilt=tuple((felt.tilt[robot] + rng.normal(0, NOISE.tilt, 2)).tolist()),
                clearance=float(felt.clearance[robot] + rng.normal(0, NOISE.clearance)),
            )
            likelihood = Likelihood(SensorData.of([observed], MODALITIES, CAP), NOISE)
            fits = likelihood.normalised(predictor, many, np.zeros((len(many), 2)))[:, 0]
            low, high = np.quantile(
                many[:, 4], (0.05, 0.95), weights=softmax(fits), method="inverted_cdf"
            )
            widths.append(high - low)
        return float(np.mean(widths))

    of_mass, of_lengths = chosen("mass"), chosen("lengths")
    one, other = width(of_mass.program), width(of_lengths.program)
    assert of_mass.narrowed is not None
    assert of_lengths.narrowed is not None
    assert one < 0.95 * other


def test_lengths_are_narrowed_in_metres_whatever_the_range_of_each() -> None:
    lengths = np.random.default_rng(1).normal(TRUE_LENGTHS, (0.001, 0.01, 0.01, 0.01), (200, 4))
    of_range = {}
    for half in (0.1, 0.01):  # of the first leg's range, m
        own = f"length = [{TRUE_LENGTHS[0] - half}, {TRUE_LENGTHS[0] + half}]"
        problem = Problem.parse(PROBLEM.replace("length = [0.05, 0.25]", own, 1), "legs")
        genome = Genome(problem, problem.base(make_capabilities()))
        predictor = Predictor(Unknowns(genome), StaticsPhysics())
        genes = (lengths - 0.05) / 0.2
        genes[:, 0] = (lengths[:, 0] - TRUE_LENGTHS[0] + half) / (2 * half)
        of_range[half] = chooser(predictor).choose(
            Posterior.equally_likely(genes), 4, np.random.default_rng(1), learn="lengths"
        )
    one, other = of_range.values()
    assert one.narrowed == pytest.approx(other.narrowed, abs=1e-6)
    assert one.program == pytest.approx(other.program)


def test_what_is_asked_waits_until_attachments_are_settled(predictor: Predictor) -> None:
    points = np.tile(POINT, (40, 1))
    points[::2, 5] = 0.1  # hinge of the second leg: yaw instead of up
    samples = Posterior.equally_likely(points)
    one, two = (
        chooser(predictor).choose(samples, 0, np.random.default_rng(1), learn=learn)
        for learn in ("all", "lengths")
    )
    assert np.array_equal(one.program, two.program)
    assert two.narrowed is None
