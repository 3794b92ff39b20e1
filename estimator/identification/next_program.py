"""The next motor program of a run, by an exploration rule."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from estimator.errors import EstimatorError
from estimator.exploration.rules import RULES, Choice, Situation
from estimator.physics.base import ArrayPhysics
from estimator.posterior.fitted import FittedPosterior
from estimator.randomness import Stream, generator
from estimator.storage.store import RunStore

_ROUNDING: Final = 1e-9  # rad


def next_program(
    store: RunStore, rule: str, posterior: FittedPosterior, *, physics: ArrayPhysics, jobs: int = 1
) -> Choice:
    """Motor program that a rule chooses after the interactions so far; the same in a resumed run.

    Args:
        store: The run's memory.
        rule: Name of the exploration rule.
        posterior: Posterior after the interactions so far.
        physics: Predicts what models feel.
        jobs: Number of threads that the rule may use, apart from those of ``physics``.

    Raises:
        EstimatorError: What the rule gives is no motor program of this robot, its reason is no
            text, or its bits are no number.
    """
    settings = store.settings
    situation = Situation(
        posterior=posterior.computed_by(physics),
        rng=generator(settings.seed, Stream.PROGRAMS, len(posterior.observations)),
        learn=settings.learn,
        jobs=jobs,
    )
    return _checked(RULES.load(rule)(situation), f"exploration rule {rule!r}", store)


def _checked(chosen: object, rule: str, store: RunStore) -> Choice:
    """Checks a rule's choice before it is kept or performed; returns it with floats."""
    if not isinstance(chosen, Choice):
        raise EstimatorError(f"the {rule} gave {chosen!r}: it must give a Choice")
    joints, driven = store.capabilities.joints, store.problem.motors.driven
    try:
        program = tuple(map(float, chosen.program))
    except (TypeError, ValueError):
        program = ()
    if len(program) != len(joints):
        raise EstimatorError(
            f"the {rule} gave the program {chosen.program!r}: it must hold {len(joints)} targets, "
            "one for each joint of the robot, driven or not"
        )
    for number, (target, joint) in enumerate(zip(program, joints, strict=True)):
        low, high = (joint.lower, joint.upper) if number in driven else (0.0, 0.0)
        if not low - _ROUNDING <= target <= high + _ROUNDING:
            raise EstimatorError(
                f"the {rule} gave {target:.6g} for joint {joint.name!r}: targets are rad, and that "
                f"joint's must lie in {low:.4f} to {high:.4f}"
                + ("" if number in driven else ", since the problem does not drive it")
            )
    reason: object = chosen.reason
    if not isinstance(reason, str):
        raise EstimatorError(f"the {rule} gave the reason {reason!r}: it must be text, or empty")
    try:
        bits = None if chosen.bits is None else float(chosen.bits)
    except (TypeError, ValueError):
        bits = math.nan
    if bits is not None and not math.isfinite(bits):
        raise EstimatorError(
            f"the {rule} gave {chosen.bits!r} bits: it must give a finite number of them, or None"
        )
    return replace(chosen, program=program, bits=bits)
