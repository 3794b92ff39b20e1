from __future__ import annotations

import numpy as np
import pytest

from estimator.body.arrays import TOO_HIGH, Bodies
from estimator.posterior.model.deviations import (
    Limp,
    Thickness,
    TiltGain,
    TooHigh,
    Travel,
    TurnedMount,
    possible_deviations,
)
from estimator.posterior.model.unknowns import Predictor, deviating_points
from estimator.problem.problem import Problem
from tests.estimator.two_unknown_rows import programs

ON_LEG_1 = np.array([0.1, 0.4, 0.5, 0.6, 0.6, 0.4, 0.5])
BESIDE_IT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
LIMP = Limp(text="the servo of leg 1 dead", part=0)
THICK = Thickness(text="thick parts", amount=2.0)
ASIDE = TurnedMount(text="a leg that points aside", part=0, amount=0.5)


def both(predictor: Predictor) -> Bodies:
    bodies = predictor.unknowns.bodies(np.vstack([ON_LEG_1, BESIDE_IT]))
    assert bodies.parent[:, 1].tolist() == [0, -1]
    return bodies


def test_what_a_limp_part_carries_hangs_with_it(predictor: Predictor) -> None:
    bodies = both(predictor)
    limp = LIMP.of(bodies)
    assert limp.limp.tolist() == [[True, True, False, False], [True, False, False, False]]
    shorter = limp.length < 0.1 * bodies.length
    assert shorter.tolist() == limp.limp.tolist()
    assert np.array_equal(limp.radius, bodies.radius)


def test_its_foot_feels_the_ground_in_every_pose(predictor: Predictor) -> None:
    values, moved = np.vstack([ON_LEG_1, BESIDE_IT]), programs(16, seed=3)
    observed = predictor.deviating([LIMP]).read_all(deviating_points(values, 0), moved)
    assert observed.touch[:, 0].all()
    assert not observed.touch_doubtful[:, 0].any()
    assert not observed.touch[:, 2].all()
    assert not predictor.read_all(values, moved).touch[:, 0].all()


def test_servos_that_turn_too_far_do_what_a_wider_program_asks(predictor: Predictor) -> None:
    values, moved = BESIDE_IT[None], programs(16, seed=3)
    wide = Travel(text="all too far", amount=1.25)
    one = Travel(text="one not far enough", amount=0.8, part=1)
    for deviation, factors in ((wide, 1.25), (one, [1.0, 0.8, 1.0, 1.0])):
        observed = predictor.deviating([deviation]).read_all(deviating_points(values, 0), moved)
        present = predictor.read_all(values, moved * factors)
        assert np.array_equal(observed.tilt, present.tilt)
        assert np.array_equal(observed.clearance, present.clearance)


def test_wrongly_calibrated_sensors_make_something_else_of_the_pose(predictor: Predictor) -> None:
    values, moved = BESIDE_IT[None], programs(16, seed=3)
    sound = predictor.read_all(values, moved)
    gain, higher, lower = (
        predictor.deviating([deviation]).read_all(deviating_points(values, 0), moved)
        for deviation in (
            TiltGain(text="steeper", amount=1.25),
            TooHigh(text="too high", column=TOO_HIGH, amount=0.01),
            TooHigh(text="too low", column=TOO_HIGH, amount=-1.0),
        )
    )
    assert np.allclose(np.sin(gain.tilt), np.clip(1.25 * np.sin(sound.tilt), -1, 1))
    assert np.array_equal(gain.clearance, sound.clearance)
    assert np.allclose(higher.clearance, sound.clearance + np.where(sound.saturated, 0, 0.01))
    assert np.all(lower.clearance >= 0)
    assert np.array_equal(higher.tilt, sound.tilt)


def test_bodies_are_built_each_by_its_own_departure(predictor: Predictor) -> None:
    branches, values = (LIMP, THICK, ASIDE), np.vstack([ON_LEG_1, BESIDE_IT] * 3)
    which = np.array([2, 0, 1, 1, 0, 2])
    built = predictor.unknowns.deviating(branches).bodies(deviating_points(values, which))
    moved = programs(6, seed=4)
    for row, number in enumerate(which.tolist()):
        alone = branches[number].of(predictor.unknowns.bodies(values[[row]]))
        rows = np.zeros(6, dtype=np.intp)
        observed, expected = (
            predictor.read(bodies, rows, moved) for bodies in (built[row : row + 1], alone)
        )
        assert np.array_equal(observed.tilt, expected.tilt)
        assert np.array_equal(observed.touch, expected.touch)


def test_every_part_with_a_servo_may_have_a_dead_one() -> None:
    limp = [one for one in possible_deviations(Problem.load("parametric")) if type(one) is Limp]
    driven = [part.name for part in Problem.load("parametric").parts if part.motor is not None]
    assert [one.name for one in limp] == [f"the servo of {name} dead" for name in driven]


@pytest.mark.parametrize(
    ("left_open", "word", "fewer"),
    [
        ("density = [500.0, 2000.0]", "heavy", 3),
        ("joint_zero_deg = 1.0", "zero of", 4 * 6),
        ("accelerometer_deg = 2.0", "accelerometer turned", 2 * 4),
        ("centre_of_mass_mm = 10.0", "centre of mass", 2 * 4),
    ],
)
def test_what_a_problem_leaves_open_is_no_departure(left_open: str, word: str, fewer: int) -> None:
    source = Problem.load("parametric").source
    known = possible_deviations(Problem.parse(source, "known.toml"))
    problem = Problem.parse(f"{source}\n[nuisance]\n{left_open}\n", "open.toml")
    gone = set(known) - set(possible_deviations(problem))
    assert len(gone) == fewer
    assert all(word in one.text for one in gone)
