"""Which bodies a run's page shows: the best, its rivals, and, once scored, the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.evaluation.truth.urdf import Urdf
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation
from estimator.report.bodies.jointed_body import Link, model_links, robot_links
from estimator.report.bodies.predictions import foretold, predict
from estimator.report.bodies.scene import (
    Solid,
    at_rest,
    solids_of,
    turn_at_rest,
)
from estimator.report.result import Result
from estimator.report.tables.posterior import percent
from estimator.storage.store import RunStore

SAMPLES: Final = 16
"""How many samples of a posterior are drawn, translucent, around the best body."""

_DIGITS: Final = 6


@dataclass(frozen=True, kw_only=True)
class ShownBody:
    """One body.

    Attributes:
        title: What it is.
        note: What differs from the best body, or how probable it is.
        links: The body.
        samples: Others that stand for how uncertain it is.
        stands: For each interaction its rotation at rest, nine numbers row by row; ``None`` where
            that is not known.
        standing: What it looks like in the last interaction.
        true: Whether it is the robot's.
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
    """The bodies of a run, and what the best one foretells of each interaction.

    Attributes:
        bodies: The best first; empty before anything was learnt.
        predicted: By the best body, one per interaction that it was fitted to; ``None`` where its
            simulation cannot be believed.
    """

    bodies: tuple[ShownBody, ...] = ()
    predicted: tuple[Observation | None, ...] = ()


def shown_bodies(store: RunStore, result: Result, true_body: Urdf | None) -> ShownBodies:
    """Collects the bodies of a run.

    Args:
        store: The run.
        result: The same in numbers.
        true_body: The robot's, where it is known.
    """
    if not result.best_models:
        return ShownBodies()
    fitted, seen = FittedPosterior.of(store), store.observations()
    assert fitted is not None
    assert fitted.best is not None
    belief = fitted.belief
    names = [rule.name for rule in store.problem.parts]
    if belief is not None and result.posterior is not None:
        rivals = result.posterior.rivals
        genes = [belief.best, *(mode.genes for mode in belief.modes[1 : 1 + len(rivals)])]
        texts = [
            ("Best body", _sureness(result.posterior.probability)),
            *(
                (
                    f"Rival {number}",
                    f"{percent(rival.probability)}; "
                    + ("cannot be told apart; " if rival.alike else "")
                    + "; ".join(rival.differs),
                )
                for number, rival in enumerate(rivals, 1)
            ),
        ]
        samples = fitted.bodies(SAMPLES)
    else:
        genes = [tuple(fitted.best.tolist())]
        error = result.sensor_error
        texts = [
            ("Best model", "subjective error " + ("unknown" if error is None else f"{error:.3f}"))
        ]
        samples = []
    bodies = fitted.genome.decode_all(np.array(genes))
    predicted = predict(store, bodies)
    if belief is not None:
        told = belief.foretold
        predicted[0][: len(told)] = [
            foretold(observation, item) for observation, item in zip(seen, told, strict=False)
        ]
    certainties = [part.agreement or 0.0 for part in result.best_models[0].parts] if belief else []
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
    limbs = {joints[motor]: limb for limb, motor in enumerate(sorted(store.problem.motors.driven))}

    links = robot_links(true_body, joints, limbs)
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
    told: Sequence[Observation | None],
) -> tuple[tuple[tuple[float, ...] | None, ...], tuple[Solid, ...]]:
    """How a body stands in each interaction, and what it looks like in the last one.

    Where nothing tells how it stands, the picture shows it level.
    """
    stands: list[tuple[float, ...] | None] = []
    standing: list[Solid] = []
    for item, felt in zip(seen, told, strict=False):
        solids = solids_of(links, item.angles)
        standing = at_rest(solids, felt)
        turn = None if felt is None or None in felt.tilt else turn_at_rest(solids, felt)
        stands.append(None if turn is None else tuple(np.round(turn, _DIGITS).ravel().tolist()))
    return tuple(stands), tuple(standing)


def _sureness(probability: float | None) -> str:
    if probability is None:
        return "how probable it is, is not known"
    return f"attachments {percent(probability)} probable"
