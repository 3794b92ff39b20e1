"""Loads what worker processes need: the fork server imports this once, and then forks them.

To import the search and to load the statics kernel's machine code takes a second or two, which
every worker process would take by itself.
"""

from __future__ import annotations

from importlib import import_module

import numpy as np

from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.physics.base import WorldSettings
from estimator.physics.statics import StaticsPhysics

import_module("estimator.posterior.sampling.sampler")

_PART = Part(parent=BASE, mount=0, hinge=0, length=0.1, radius=0.01, motor=0)
_BODY = Morphology(base=Base(size=(0.1, 0.1, 0.1), mass=1.0), parts=(_PART,), density=1000.0)
with StaticsPhysics(WorldSettings()) as _physics:
    _physics.read([(_BODY, np.zeros(1))])
