"""Density, centre of mass, accelerometer and joint zeros mean the same to every back-end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.physics.base import WorldSettings
from estimator.physics.mujoco import MuJoCoPhysics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics

FINE = WorldSettings(step=1 / 240, steps=1200)
LENGTHS = (0.15, 0.12, 0.18, 0.1)
BODY = Morphology(
    base=Base(size=(0.16, 0.1, 0.05), mass=0.5),
    parts=tuple(
        Part(parent=BASE, mount=side, hinge=2, length=length, radius=0.006, motor=side, sensor=side)
        for side, length in enumerate(LENGTHS)
    ),
    density=1000.0,
)
PROGRAMS = np.radians(
    [[-25, 10, -20, 5], [-10, -28, 12, -22], [20, -5, -30, -15], [-15, -15, -25, 28]]
)
TURNED = replace(BODY, base=replace(BODY.base, accelerometer=(0.05, -0.03)))
MOVED = replace(BODY, base=replace(BODY.base, centre=(0.02, 0.012, -0.005)))
OFF_ZERO = replace(
    BODY,
    parts=tuple(
        replace(part, zero=zero)
        for part, zero in zip(BODY.parts, (0.05, -0.03, 0.02, 0.04), strict=True)
    ),
)


@pytest.mark.parametrize("engine", [PyBulletPhysics, MuJoCoPhysics])
@pytest.mark.parametrize(
    "body",
    [TURNED, MOVED, OFF_ZERO, replace(BODY, density=3000.0)],
    ids=["accelerometer", "centre of mass", "zeros", "density"],
)
def test_a_simulation_reads_what_statics_reads(
    body: Morphology, engine: type[PyBulletPhysics | MuJoCoPhysics]
) -> None:
    pairs = [(body, program) for program in PROGRAMS]
    computed, simulated = StaticsPhysics(FINE).read(pairs), engine(FINE).read(pairs)
    assert simulated.valid.all()
    assert np.degrees(computed.tilt - simulated.tilt) == pytest.approx(np.zeros((4, 2)), abs=0.2)
    assert 1e3 * computed.clearance == pytest.approx(1e3 * simulated.clearance, abs=0.5)


def test_each_of_them_changes_some_reading() -> None:
    statics = StaticsPhysics(FINE)

    def tilts(body: Morphology) -> Array:
        return np.degrees(statics.read([(body, program) for program in PROGRAMS]).tilt)

    for other in (TURNED, MOVED, OFF_ZERO):
        assert np.max(np.abs(tilts(other) - tilts(BODY))) > 1


@pytest.mark.parametrize("make", [StaticsPhysics, PyBulletPhysics])
def test_a_flat_body_reads_the_accelerometers_own_tilt(
    make: type[StaticsPhysics | PyBulletPhysics],
) -> None:
    felt = make(FINE).read([(TURNED, np.zeros(4))])
    across, along = 0.05, -0.03
    expected = [across, math.asin(math.cos(across) * math.sin(along))]
    assert felt.tilt[0] == pytest.approx(expected, abs=1e-3)
