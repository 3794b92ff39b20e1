"""Parts whose mount alone is unknown, and main bodies with more mounts than parts have."""

from __future__ import annotations

import numpy as np

from estimator.body.morphology import Base
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, draw, make_sampler, programs

BOX = (0.14, 0.14, 0.085)
HEAD = """
name = "mounts"
description = "Which leg is plugged in where?"
density = 1000.0
share_mounts = false
motors = { driven = [1, 2, 3, 4], range_deg = [-30.0, 30.0], slew_deg_per_s = 60.0 }
search = { population = 8, generations = 2, interactions = 6 }
"""
LEG = """
[[parts]]
name = "leg {number}"
parent = {parent}
mount = "{mount}"
hinge = "up"
length = {length}
radius = 0.006
motor = {number}
sensor = {number}
"""
MOUNT = """
[[mounts]]
name = "{number}"
at = [{x:.4f}, {y:.4f}, 0.0]
yaw_deg = {yaw}
"""


def predictor_of(text: str) -> Predictor:
    problem = Problem.parse(text, "mounts.toml")
    base = Base(size=BOX, mass=1.0, mounts=problem.tables.base_mounts(BOX))
    return Predictor(Unknowns(Genome(problem, base)), StaticsPhysics())


def test_which_leg_is_plugged_in_where_is_learnt_from_many_interactions() -> None:
    legs = [
        LEG.format(number=number, parent=0, mount="unknown", length=[0.05, 0.30])
        for number in (1, 2, 3, 4)
    ]
    predictor, rng = predictor_of(HEAD + "".join(legs)), np.random.default_rng(1)
    point = predictor.unknowns.permitted(rng.random((1, predictor.unknowns.size)))[0]
    data = draw(predictor, point, programs(4), rng, outlier=0.0)
    posterior = make_sampler(predictor).learn(Likelihood(data, NOISE))
    assert posterior.modes[0].attachments == predictor.unknowns.keys(point[None])[0]
    assert posterior.modes[0].probability > 0.9


def test_where_nothing_was_felt_the_prior_is_believed() -> None:
    """Each of twelve mounts is as probable as a third of each of another leg's four."""
    mounts = [
        MOUNT.format(
            number=number,
            x=0.07 * np.cos(np.radians(30 * number)),
            y=0.07 * np.sin(np.radians(30 * number)),
            yaw=30 * number,
        )
        for number in range(12)
    ]
    legs = [LEG.format(number=1, parent=0, mount="0", length=0.2)]
    legs += [LEG.format(number=2, parent='"unknown"', mount="unknown", length=[0.05, 0.3])]
    legs += [LEG.format(number=n, parent=0, mount=str(3 * n - 3), length=0.2) for n in (3, 4)]
    text = HEAD.replace("share_mounts = false\n", "") + "".join(mounts + legs)
    predictor = predictor_of(text)
    no_prediction = Observation(angles=(0.0,) * 4, touch=(None,) * 4)
    posterior = make_sampler(predictor).learn(
        Likelihood(SensorData.of([no_prediction], MODALITIES, CAP), NOISE)
    )
    points = np.array([mode.point for mode in posterior.modes])
    shares = np.array([mode.probability for mode in posterior.modes])
    on_body = predictor.unknowns.bodies(points).parent[:, 1] == -1
    assert (on_body.sum(), (~on_body).sum()) == (12, 4)
    assert 0.4 < shares[on_body].sum() < 0.6  # 0.5 in the prior, 0.75 were all sets as probable
