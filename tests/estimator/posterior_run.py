"""A finished run of the method posterior, without the hours of one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from estimator.readings.observation import Observation
from estimator.storage.posteriors import Cause, NextMovement, StoredMode, StoredPosterior
from estimator.storage.records import Counters
from estimator.storage.store import RunStore
from protocol.wire.capabilities import Capabilities
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import PROBLEM, TRUE_LENGTHS, make_capabilities


def make_posterior_run(
    folder: Path,
    lengths: Sequence[tuple[float, ...]],
    *,
    hinge: float | None = None,
    mount: float | None = None,
    askew: float | None = None,
    radius: float = 0.006,
    rivals: Sequence[StoredMode] = (),
    next_movement: NextMovement | None = None,
    causes: Sequence[Cause] = (),
    misspecified: float = 0.0,
    hinges: Sequence[float] | None = None,
    robot: Capabilities | None = None,
    lean: float = 0.0,
    uncertain: str = "",
) -> RunStore:
    """A run whose best body is the first of some, the others being its samples.

    Args:
        folder: Where it is to be, as ``posterior``.
        lengths: Of the four legs of each body, m.
        hinge: Gene of the back leg's hinge, where that is to be found.
        mount: The same of its mount.
        askew: Tilt of the accelerometer, left/right, of all samples, rad.
        radius: Of the left leg, as the problem has it, m.
        rivals: Modes after the first.
        next_movement: The most informative one.
        causes: What may make the robot otherwise than stated.
        misspecified: Probability that the problem does not describe the robot.
        hinges: Genes of the back legs' hinges of the samples, where they differ from ``hinge``.
        robot: The robot; default: that of ``make_capabilities``.
        lean: Forward/back tilt in the zero pose of the first interaction, rad.
        uncertain: What the problem says in ``[uncertain]``.
    """
    text = PROBLEM.replace("radius = 0.006", f"radius = {radius}", 1)
    if mount is not None:
        text = text.replace('mount = "back"', 'mount = "unknown"')
    if hinge is not None:
        text = 'hinge = "unknown"'.join(text.rsplit('hinge = "up"', 1))
    text += f"[uncertain]\n{uncertain}\n"
    choices = [gene for gene in (mount, hinge) if gene is not None]
    differing = [hinge, *hinges] if hinges is not None else [hinge] * len(lengths)
    with make_run(folder, TRUE_LENGTHS, text, tuple(choices)) as model:
        settings = model.settings.model_copy(update={"method": "posterior", "physics": "statics"})
    bodies = []
    for row, own_hinge in zip(lengths, differing, strict=True):
        genes = ((np.array(row) - 0.05) / 0.2).tolist()
        chosen = [gene for gene in (mount, own_hinge) if gene is not None]
        bodies.append((*genes[:-1], *chosen, genes[-1]))
    best, *samples = bodies
    first = StoredMode(
        probability=0.75, ess=50.0, genes=best, indistinguishable=True, found=(True, True)
    )
    stored = StoredPosterior(
        genes=tuple(samples),
        amounts=(
            {}
            if askew is None
            else {"accelerometer's own tilt, left/right": (askew,) * len(samples)}
        ),
        scales=((0.0, 0.0),) * len(samples),
        weights=(1 / len(samples),) * len(samples),
        best=best,
        modes=(first, *rivals),
        probability_within_problem=0.75,
        predicted=(),
        unexplained=(),
        noisy=(),
        next_movement=next_movement,
        causes=tuple(causes),
        misspecification_probability=misspecified,
    )
    store = RunStore.create(folder / "posterior", settings, robot or make_capabilities(), "me")
    store.plan(0, (0.0,) * 4)
    store.observe(0, Observation(angles=(0.0,) * 4, zero_tilt=(0.0, lean)))
    store.save_posterior(0, stored, Counters(), None)
    return store
