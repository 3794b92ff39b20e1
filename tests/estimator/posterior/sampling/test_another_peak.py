"""A body whose best lengths of before are far from its best ones now is not lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.morphology import Base
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation
from tests.estimator.little_effort import little_search
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, QUICK, make_sampler

HEAD: Final = """
name = "second leg"
description = "Lengths of four legs, and how the second is attached."
density = 1000.0
motors = { driven = [1, 2, 3, 4], range_deg = [-30.0, 30.0], slew_deg_per_s = 60.0 }
search = { population = 8, generations = 2, interactions = 7 }
"""
LEG: Final = """
[[parts]]
name = "leg {number}"
parent = {parent}
mount = "{mount}"
hinge = "{hinge}"
length = [0.02, 0.40]
radius = 0.006
motor = {number}
sensor = {number}
"""
LEGS: Final = (
    (0, "left", "up"),
    ('"unknown"', "unknown", "unknown"),
    (0, "right", "up"),
    (0, "back", "up"),
)

# Readings of a robot with legs of 22, 18, 25 and 15.5 cm, the second one at its front: angles (°),
# touch, tilt (°), clearance (mm). In four of them it lies on an edge where a trifle decides.
FELT: Final = (
    ((29.80, 23.00, -19.84, 27.08), (0, 0, 1, 0), (-7.4822, 0.3077), 8.3),
    ((-23.92, -25.28, -30.04, -30.04), (1, 0, 1, 1), (-3.6411, 8.5620), 69.0),
    ((-30.04, 23.00, -30.04, -21.88), (1, 0, 1, 1), (-1.6036, 15.9544), 79.2),
    ((-22.56, -26.64, -16.44, 18.24), (1, 0, 1, 0), (0.9539, 28.8915), 40.2),
    ((-22.56, 27.08, -29.36, 29.80), (1, 0, 1, 1), (-3.1761, 41.0431), 65.7),
    ((4.64, -30.04, -30.04, 13.48), (0, 1, 1, 0), (-12.3488, 6.7697), 25.1),
    ((10.08, -24.60, -30.04, -13.04), (0, 1, 1, 0), (-12.7389, 3.3758), 21.6),
)
RIGHT: Final = (0, 1, 2)
"""On the main body, at the front, hinge up."""


def test_a_body_that_was_probable_is_held_against_the_next_reading_at_all_its_lengths() -> None:
    """With its best lengths of before alone it was lost: 0.999 was stated of a wrong body."""
    legs = "".join(
        LEG.format(number=number, parent=parent, mount=mount, hinge=hinge)
        for number, (parent, mount, hinge) in enumerate(LEGS, start=1)
    )
    genome = Genome(Problem.parse(HEAD + legs, "legs"), Base(size=(0.14, 0.14, 0.085), mass=0.6))
    predictor = Predictor(Unknowns(genome), StaticsPhysics())
    sampler = make_sampler(predictor, effort=replace(QUICK, particles=512))
    observations = [
        Observation(
            angles=tuple(np.radians(angles).tolist()),
            touch=tuple(map(bool, touch)),
            tilt=(float(np.radians(tilt[0])), float(np.radians(tilt[1]))),
            clearance=height / 1000,
            clearance_saturated=False,
        )
        for angles, touch, tilt, height in FELT
    ]
    with little_search():
        for count in (3, 6, 7):
            posterior = sampler.learn(
                Likelihood(SensorData.of(observations[:count], MODALITIES, CAP), NOISE)
            )
    shares = {mode.attachments: mode.probability for mode in posterior.modes}
    assert 0.05 < shares[RIGHT] < 0.2  # 0.10 with 4,096 particles
