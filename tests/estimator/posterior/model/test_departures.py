from __future__ import annotations

import numpy as np

from estimator.body.arrays import Bodies
from estimator.posterior.model.departures import Limp, lying_down, possible_departures
from estimator.posterior.model.unknowns import Predictor
from estimator.problem.problem import Problem
from tests.estimator.two_unknown_rows import programs

ON_LEG_1 = np.array([0.1, 0.4, 0.5, 0.6, 0.6, 0.4, 0.5])
BESIDE_IT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
LIMP = Limp(name="the servo of leg 1 dead", part=0)


def both(predictor: Predictor) -> Bodies:
    bodies = predictor.unknowns.bodies(np.vstack([ON_LEG_1, BESIDE_IT]))
    assert bodies.parent[:, 1].tolist() == [0, -1]
    return bodies


def test_what_a_limp_part_carries_hangs_with_it(predictor: Predictor) -> None:
    bodies = both(predictor)
    assert LIMP.lying(bodies).tolist() == [[True, True, False, False], [True, False, False, False]]
    limp = LIMP.of(bodies)
    shorter = limp.length < 0.1 * bodies.length
    assert shorter.tolist() == LIMP.lying(bodies).tolist()
    assert np.array_equal(limp.radius, bodies.radius)


def test_its_foot_feels_the_ground_in_every_pose(predictor: Predictor) -> None:
    values, moved = np.vstack([ON_LEG_1, BESIDE_IT]), programs(16, seed=3)
    felt = predictor.departing(LIMP).read_all(values, moved)
    assert felt.touch[:, 0].all()
    assert not felt.touch_doubtful[:, 0].any()
    assert not felt.touch[:, 2].all()
    sound = predictor.read_all(values, moved)
    assert not sound.touch[:, 0].all()
    assert np.array_equal(
        lying_down(sound, np.zeros_like(sound.touch)).touch, sound.touch
    )  # nothing lies


def test_every_part_with_a_servo_may_have_a_dead_one() -> None:
    limp = [one for one in possible_departures(Problem.load("parametric")) if type(one) is Limp]
    driven = [part.name for part in Problem.load("parametric").parts if part.motor is not None]
    assert [one.name for one in limp] == [f"the servo of {name} dead" for name in driven]
