"""What bodies would have felt in the poses that the robot took."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

import numpy as np

from estimator.body.morphology import Morphology
from estimator.physics.backends import in_this_process
from estimator.readings.observation import Observation, PredictedReadings
from estimator.storage.beliefs import Foretold
from estimator.storage.store import RunStore


def predict(store: RunStore, bodies: Sequence[Morphology]) -> list[list[Observation | None]]:
    """Simulates bodies in a run's interactions, by the physics whose word the run's tables give.

    Args:
        store: The run.
        bodies: The bodies.

    Returns:
        For each body one prediction per interaction; ``None`` where its simulation cannot be
        believed.
    """
    seen = store.observations()
    if not bodies or not seen:
        return [[] for _ in bodies]
    posterior = store.settings.method == "posterior"
    name = store.settings.physics if posterior else store.settings.reference
    pairs = [(body, np.array(item.angles)) for body in bodies for item in seen]
    with closing(in_this_process(name, store.world)) as physics:
        readings = physics.read(pairs)
    rows = [observation_of(readings, row, pair[1].tolist()) for row, pair in enumerate(pairs)]
    return [rows[start : start + len(seen)] for start in range(0, len(rows), len(seen))]


def foretold(observation: Observation, item: Foretold) -> Observation:
    """An interaction as a posterior's best body foretells it."""
    return Observation(
        angles=observation.angles, touch=item.touch, tilt=item.tilt, clearance=item.clearance
    )


def observation_of(
    readings: PredictedReadings, row: int, angles: Sequence[float]
) -> Observation | None:
    """A body's readings as an interaction; ``None`` where the simulation cannot be believed."""
    if not readings.valid[row] or not np.isfinite(readings.tilt[row]).all():
        return None
    left, ahead = readings.tilt[row].tolist()
    return Observation(
        angles=tuple(angles),
        touch=tuple(readings.touch[row].tolist()),
        tilt=(left, ahead),
        clearance=float(readings.clearance[row]),
        clearance_saturated=bool(readings.saturated[row]),
    )
