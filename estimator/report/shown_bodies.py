"""Which bodies a run's page shows: the best, its rivals, and, once scored, the truth."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.morphology import Morphology
from estimator.evaluation.truth.urdf import Urdf
from estimator.physics.backends import in_this_process
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation, PredictedReadings
from estimator.report.result import Result
from estimator.report.scene import (
    Link,
    Solid,
    at_rest,
    model_links,
    robot_links,
    solids_of,
    turn_at_rest,
)
from estimator.report.tables import percent
from estimator.storage.posteriors import PredictedInteraction
from estimator.storage.store import RunStore


def predict(store: RunStore, bodies: Sequence[Morphology]) -> list[list[Observation | None]]:
    """Simulates bodies in a run's interactions, by the physics whose numbers its tables show.

    Args:
        store: The run.
        bodies: The bodies.

    Returns:
        For each body one prediction per interaction; ``None`` where its simulation is
        invalid.
    """
    seen = store.observations()
    if not bodies or not seen:
        return [[] for _ in bodies]
    posterior = store.settings.keeps_samples
    name = store.settings.physics if posterior else store.settings.reference
    pairs = [(body, np.array(observation.taken)) for body in bodies for observation in seen]
    with closing(in_this_process(name, store.world)) as physics:
        readings = physics.read(pairs)
    rows = [observation_of(readings, row, pair[1].tolist()) for row, pair in enumerate(pairs)]
    return [rows[start : start + len(seen)] for start in range(0, len(rows), len(seen))]


def _predicted(observation: Observation, item: PredictedInteraction) -> Observation:
    """Observation that a posterior's best body predicts for an interaction."""
    return Observation(
        angles=observation.taken, touch=item.touch, tilt=item.tilt, clearance=item.clearance
    )


def observation_of(
    readings: PredictedReadings, row: int, angles: Sequence[float]
) -> Observation | None:
    """A row of predicted readings as an observation; ``None`` where the simulation is invalid."""
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


SAMPLES: Final = 16
"""Number of samples of a posterior that are drawn, translucent, around the best body."""

_DIGITS: Final = 6


@dataclass(frozen=True, kw_only=True)
class ShownBody:
    """One body that the page shows.

    Attributes:
        title: What it is, such as ``Best body``.
        note: What differs from the best body, or how probable it is.
        links: Links of the body.
        samples: Links of other bodies, which show how uncertain this one is.
        stands: Rotation of the body at rest in each interaction, nine numbers row by row; ``None``
            where that is not known.
        standing: Solids of the body, placed as in the last interaction.
        true: Whether it is the robot's true body.
    """

    title: str
    note: str
    links: tuple[Link, ...]
    samples: tuple[tuple[Link, ...], ...] = ()
    stands: tuple[tuple[float, ...] | None, ...]
    standing: tuple[Solid, ...]
    true: bool = False


@dataclass(frozen=True, kw_only=True)
class ShownBodies:
    """The bodies of a run, and what the best one predicts of each interaction.

    Attributes:
        bodies: The bodies, the best first; empty before anything was learnt.
        predicted: Readings that the best body predicts, one per interaction that was performed;
            ``None`` where its simulation is invalid.
    """

    bodies: tuple[ShownBody, ...] = ()
    predicted: tuple[Observation | None, ...] = ()


def shown_bodies(store: RunStore, result: Result, true_body: Urdf | None) -> ShownBodies:
    """Collects the bodies of a run.

    Args:
        store: The run.
        result: The run in numbers.
        true_body: The robot's true body; ``None`` where it is not known.
    """
    if not result.best_models:
        return ShownBodies()
    fitted, seen = FittedPosterior.of(store), store.observations()
    assert fitted is not None
    assert fitted.best_body is not None
    summary = fitted.summary
    names = [rule.name for rule in store.problem.parts]
    if summary is not None and result.posterior is not None:
        rivals = result.posterior.rivals
        rival_genes = [mode.genes for mode in summary.modes[1 : 1 + len(rivals)]]
        texts = [
            ("Best body", _sureness(result.posterior.probability)),
            *(
                (
                    f"Rival {number}",
                    f"{percent(rival.probability)}; "
                    + ("indistinguishable; " if rival.indistinguishable else "")
                    + "; ".join(rival.differs),
                )
                for number, rival in enumerate(rivals, 1)
            ),
        ]
        samples = fitted.bodies(SAMPLES)
    else:
        rival_genes = []
        error = result.sensor_error
        texts = [
            ("Best model", "subjective error " + ("unknown" if error is None else f"{error:.3f}"))
        ]
        samples = []
    bodies = [fitted.best_body, *map(fitted.genome.decode, np.array(rival_genes))]
    predicted = predict(store, bodies)
    if summary is not None:
        predicted[0][: len(summary.predicted)] = [
            _predicted(observation, prediction)
            for observation, prediction in zip(seen, summary.predicted, strict=False)
        ]
    certainties = [part.agreement or 0.0 for part in result.best_models[0].parts] if summary else []
    shown = []
    for row, (body, (title, note)) in enumerate(zip(bodies, texts, strict=True)):
        links = model_links(body, names, () if row else certainties)
        stands, standing = _stands(links, seen, predicted[row])
        shown.append(
            ShownBody(
                title=title,
                note=note,
                links=links,
                samples=() if row else tuple(model_links(sample, names) for sample in samples),
                stands=stands,
                standing=standing,
            )
        )
    if true_body is not None:
        shown.append(_truth(store, true_body, seen))
    return ShownBodies(bodies=tuple(shown), predicted=tuple(predicted[0]))


def _truth(store: RunStore, true_body: Urdf, seen: Sequence[Observation]) -> ShownBody:
    joints = [joint.name for joint in store.capabilities.joints]
    links = robot_links(true_body, joints, store.problem.motors.driven)
    stands, standing = _stands(links, seen, seen)
    return ShownBody(
        title="True body",
        note="as the robot stood",
        links=links,
        stands=stands,
        standing=standing,
        true=True,
    )


def _stands(
    links: Sequence[Link],
    seen: Sequence[Observation],
    readings: Sequence[Observation | None],
) -> tuple[tuple[tuple[float, ...] | None, ...], tuple[Solid, ...]]:
    """Rotation of a body at rest in each interaction, and its solids as placed in the last one.

    Where nothing tells how the body is rotated, its solids lie level.
    """
    stands: list[tuple[float, ...] | None] = []
    standing: list[Solid] = []
    for observation, reading in zip(seen, readings, strict=False):
        solids = solids_of(links, observation.angles)
        standing = at_rest(solids, reading)
        turn = None if reading is None or None in reading.tilt else turn_at_rest(solids, reading)
        stands.append(None if turn is None else tuple(np.round(turn, _DIGITS).ravel().tolist()))
    return tuple(stands), tuple(standing)


def _sureness(probability: float | None) -> str:
    if probability is None:
        return "how probable it is, is not known"
    return f"attachments {percent(probability)} probable"
