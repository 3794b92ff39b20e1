"""Poses on demand: the motor program after which the robot reads as wanted, whatever body it has.

A posterior is many bodies. A program serves if nearly all of them read as wanted after it; among
those that serve, the one is taken whose bodies are farthest from falling elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.limbs import driven_limbs
from estimator.body.morphology import Array
from estimator.errors import EstimatorError
from estimator.exploration.best_programs import best_programs
from estimator.identification.loop import carry_out
from estimator.identification.method import Listener
from estimator.identification.robot_link import RobotLink
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.noise import Noise
from estimator.posterior.posterior import quantiles
from estimator.readings.modalities import ROUNDING
from estimator.readings.observation import Observation, PredictedReadings, Program
from estimator.storage.records import InteractionRecord

SAFE: Final = math.radians(2.0)
"""Path margin below which a body may fall elsewhere; see ``docs/how-it-works.md``."""

REACHABLE: Final = 0.5
"""Share of the samples in which a goal must hold for the robot to be asked for it."""

_SEARCHES: Final = 6  # at most, each from programs of its own, until one is as good as can be
_BEST_SCORE: Final = 1.0  # score at which all bodies read as wanted and fall nowhere else
_CANDIDATES: Final = 4000  # random programs
_FIRST_LOOK: Final = 4  # bodies by which random programs are compared
_BODIES: Final = 24  # bodies by which programs are compared that are no finalists
_SPREADS: Final = tuple(np.radians([6.0, 3.0, 1.5, 0.8, 0.4, 0.8, 0.4]))
_FOOT: Final = 2.0  # tolerances that a foot counts as off which does not stand as wanted
_FORGIVEN: Final = 3.0  # standard deviations of noise that are added to tolerances
_NOTHING: Final = 1e4  # squared tolerances that a body counts as off which predicts nothing
_RISE: Final = 0.01  # m of clearance that are worth a tolerance, where the highest pose is wanted
_WIDEST_MARGIN: Final = math.radians(15.0)


@dataclass(frozen=True, kw_only=True)
class Goal:
    """What the sensors are to read; ``None`` is any.

    Attributes:
        tilt_left: Tilt left/right, rad; left side up is positive.
        tilt_forward: Tilt forward/back, rad; nose up is positive.
        clearance: Clearance, m.
        stand_on: Numbers, from 0, of the touch sensors that are to meet the ground, all others not.
        highest: Whether the clearance is to be as large as the rest allows.
        tilt_within: How far off a tilt may be, rad.
        clearance_within: How far off the clearance may be, m.

    Raises:
        EstimatorError: Nothing is wanted, a number is not finite, ``stand_on`` holds no numbers of
            sensors, or the goal contradicts itself.
    """

    tilt_left: float | None = None
    tilt_forward: float | None = None
    clearance: float | None = None
    stand_on: frozenset[int] | None = None
    highest: bool = False
    tilt_within: float = math.radians(0.6)
    clearance_within: float = 0.002

    def __post_init__(self) -> None:
        for name in ("tilt_left", "tilt_forward", "clearance"):
            wanted = getattr(self, name)
            if wanted is not None and not math.isfinite(wanted):
                raise EstimatorError(f"{name} of a pose is a finite number, not {wanted}")
        if self.highest and self.clearance is not None:
            raise EstimatorError("a pose is either the highest one or has a clearance: give one")
        goals = (self.tilt_left, self.tilt_forward, self.clearance, self.stand_on)
        if not self.highest and all(goal is None for goal in goals):
            raise EstimatorError(
                "no pose is asked for: give a tilt, a clearance, what to stand on, or the highest"
            )
        if self.stand_on is not None:
            _check_numbers(self.stand_on)

    def misses(self, readings: PredictedReadings) -> Array:
        """How many tolerances each reading is off in each thing that is wanted.

        Returns:
            Numbers of tolerances, shape (things, ...), where ... is the shape of the readings; a
            foot is off by 0 or 2.
        """
        rows: list[Array] = []
        for column, tilt in enumerate((self.tilt_left, self.tilt_forward)):
            if tilt is not None:
                rows.append(np.abs(readings.tilt[..., column] - tilt) / self.tilt_within)
        if self.clearance is not None:
            rows.append(np.abs(readings.clearance - self.clearance) / self.clearance_within)
        if self.stand_on is not None:
            stands = np.isin(np.arange(readings.touch.shape[-1]), list(self.stand_on))
            rows += list(np.moveaxis(_FOOT * (readings.touch != stands), -1, 0))
        return np.array(rows).reshape(len(rows), *readings.clearance.shape)

    def is_met_by(self, observation: Observation, noise: Noise | None = None) -> bool:
        """Whether a robot that observed this stands as wanted; not if a wanted reading is missing.

        Args:
            observation: What the robot observed.
            noise: Noise of its sensors, three standard deviations of which are forgiven.
        """
        reading = PredictedReadings.empty(1, len(observation.touch))
        reading.tilt[:] = np.array(observation.tilt, dtype=float)
        reading.clearance[:] = np.array(observation.clearance, dtype=float)
        reading.touch[:] = np.array(observation.touch, dtype=bool)
        forgiving = self
        if noise is not None:
            forgiving = replace(
                self,
                tilt_within=self.tilt_within + _FORGIVEN * noise.tilt,
                clearance_within=self.clearance_within + _FORGIVEN * noise.clearance,
            )
        felt = self.stand_on is None or None not in observation.touch
        return felt and bool(np.all(forgiving.misses(reading) <= 1))


def _check_numbers(sensors: object) -> None:
    if not (isinstance(sensors, Collection) and all(map(_is_number_of_sensor, sensors))):
        raise EstimatorError(
            "stand_on of a pose holds numbers of touch sensors, counted from 0, such as "
            f"frozenset({{0, 3}}), not {sensors!r}"
        )
    if len(sensors) == 0:
        raise EstimatorError(
            "a robot stands on something: give the number of at least one touch sensor, such as "
            "frozenset({0})"
        )


def _is_number_of_sensor(value: object) -> bool:
    return not isinstance(value, bool) and isinstance(value, Integral) and int(value) >= 0


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A motor program, and what it does to the bodies that the robot may have.

    Attributes:
        program: Targets, rad, in motor order.
        share: Share of the posterior that reads as wanted.
        margin: Path margin, rad: by how much gravity may be inclined on the way without a body's
            falling elsewhere; that of the body at the lowest twentieth.
        tilt: Medians of tilt over the samples, rad, left side up and nose up positive.
        clearance: Median of clearance over the samples, m; at most the distance sensor's range.
        touch: Whether most samples touch the ground with each touch sensor.
    """

    program: Program
    share: float
    margin: float
    tilt: tuple[float, float]
    clearance: float
    touch: tuple[bool, ...]

    @property
    def reachable(self) -> bool:
        """Whether the pose is probable enough to be tried."""
        return self.share >= REACHABLE


def find_pose(
    known: FittedPosterior, goal: Goal, rng: np.random.Generator, *, least_margin: float = SAFE
) -> Pose:
    """The motor program after which nearly all bodies read as wanted.

    Programs are tried in steps of what the servos resolve. Where no program serves, the one that
    comes nearest is returned.

    Args:
        known: The bodies that the robot may have.
        goal: What is wanted.
        rng: Draws programs and samples.
        least_margin: Bodies with a smaller path margin, rad, do not count as reading as wanted
            while programs are compared.

    Raises:
        EstimatorError: The robot lacks a sensor that the goal names, or its distance sensor cannot
            tell the clearance.
    """
    _check(known, goal)
    samples = known.sample(_BODIES, rng)
    few_samples = known.sample(_FIRST_LOOK, rng)
    low, high = known.program_range.T

    def nearness(posterior: FittedPosterior, programs: Array) -> Array:
        readings = posterior.predict(attainable(known, programs))
        return _nearness(goal, readings) @ posterior.weights

    def sure(programs: Array) -> Array:
        return np.array([_score(known, goal, program, least_margin) for program in programs])

    best = (-math.inf, np.zeros(len(low)))
    for _ in range(_SEARCHES):
        programs, scores = best_programs(
            lambda programs: nearness(samples, programs),
            known.program_range,
            rng,
            candidates=rng.uniform(low, high, (_CANDIDATES, len(low))),
            rough=lambda programs: nearness(few_samples, programs),
            sure=sure,
            spreads=_SPREADS,
        )
        if scores[0] > best[0]:
            best = float(scores[0]), attainable(known, programs[0])
        if best[0] >= _BEST_SCORE:
            break
    return _pose(known, goal, best[1])


def _check(known: FittedPosterior, goal: Goal) -> None:
    wanted = {
        "tilt": goal.tilt_left is not None or goal.tilt_forward is not None,
        "clearance": goal.clearance is not None or goal.highest,
        "touch": goal.stand_on is not None,
    }
    for modality, needed in wanted.items():
        if needed and known.capabilities.sensor(modality) is None:
            raise EstimatorError(
                f"robot {known.capabilities.robot!r} does not sense {modality}, so nobody could "
                "say whether it stands so"
            )
    highest_told = known.clearance_cap - goal.clearance_within
    if goal.clearance is not None and goal.clearance > highest_told + ROUNDING:
        raise EstimatorError(
            f"the distance sensor of robot {known.capabilities.robot!r} ends at "
            f"{1000 * known.clearance_cap:.4g} mm and cannot tell a clearance of "
            f"{1000 * goal.clearance:.4g} mm: ask for at most {1000 * highest_told:.4g} mm"
        )
    touch = known.capabilities.sensor("touch")
    if touch is None or goal.stand_on is None:
        return
    lacking = [str(sensor) for sensor in sorted(goal.stand_on) if sensor >= touch.count]
    if lacking:
        raise EstimatorError(
            f"robot {known.capabilities.robot!r} has {touch.count} touch sensors, numbered from 0 "
            f"to {touch.count - 1}: stand_on of a pose cannot be {', '.join(lacking)}"
        )


def attainable(known: FittedPosterior, programs: Array) -> Array:
    """Programs rounded to what each servo resolves, in steps from the lower end of its range."""
    joints = known.capabilities.joints
    lower = np.array([joint.lower for joint in joints])
    step = np.array([joint.resolution for joint in joints])
    steps = np.round((programs - lower) / np.where(step > 0, step, 1.0))
    low, high = known.program_range.T
    rounded = np.where((step > 0) & (programs != 0), lower + step * steps, programs)
    return np.clip(rounded, low, high)


def _believable(readings: PredictedReadings) -> Flags:
    flags: Flags = readings.valid & ~readings.undecided
    return flags


def _nearness(goal: Goal, readings: PredictedReadings) -> Array:
    """How near readings come to a goal: a smooth score, the higher the better."""
    off = np.sum(goal.misses(readings) ** 2, axis=0)
    off = np.where(_believable(readings), off, _NOTHING)
    rise = readings.clearance / _RISE if goal.highest else 0.0
    score: Array = np.minimum(rise, _NOTHING) - np.log1p(off)
    return score


def _holds(goal: Goal, readings: PredictedReadings) -> Flags:
    held: Flags = _believable(readings) & np.all(goal.misses(readings) <= 1, axis=0)
    return held


def _score(known: FittedPosterior, goal: Goal, program: Array, least_margin: float) -> float:
    """Share of bodies in which a goal holds surely; nearness and margin decide between equals."""
    attained = attainable(known, program)
    readings = known.predict(attained)
    margins = np.minimum(known.margins(attained), _WIDEST_MARGIN)
    holds = _holds(goal, readings) & (margins >= least_margin)
    nearness = float(known.weights @ _nearness(goal, readings))
    return float(known.weights @ holds) + 0.02 * nearness + 0.5 * _low(known, margins)


def _low(known: FittedPosterior, margins: Array) -> float:
    """The margin of the body at the lowest twentieth of the posterior, rad."""
    return float(quantiles(margins, known.weights, (0.05,))[0])


def _pose(known: FittedPosterior, goal: Goal, program: Array) -> Pose:
    readings, weights = known.predict(program), known.weights
    return Pose(
        program=tuple(program.tolist()),
        share=float(weights @ _holds(goal, readings)),
        margin=_low(known, known.margins(program)),
        tilt=(_median(readings.tilt[:, 0], weights), _median(readings.tilt[:, 1], weights)),
        clearance=_median(readings.clearance, weights),
        touch=tuple((weights @ readings.touch > 0.5).tolist()),
    )


def _median(values: Array, weights: Array) -> float:
    return float(np.quantile(values, 0.5, weights=weights, method="inverted_cdf"))


def perform(link: RobotLink, program: Program, number: int, listener: Listener) -> Observation:
    """Has the robot perform a motor program that no run remembers.

    Args:
        link: The robot.
        program: Targets, rad, in motor order.
        number: Number of the movement, from 0, for errors and ``listener``.
        listener: Hears how far the movement is, and is asked before a retry.

    Raises:
        InteractionError: The robot did not perform the program; the message says what happened and
            what to do.
    """
    planned = InteractionRecord(program=program)
    return carry_out(link, number, planned, lambda _: None, listener)


def feet(known: FittedPosterior) -> dict[str, tuple[int, ...]]:
    """Touch sensors that each joint's leg carries, by the joint's name, in motor order."""
    assert known.best_body is not None
    joints = known.capabilities.joints
    return {
        joints[limb.motor].name: limb.sensors
        for limb in driven_limbs(known.best_body)
        if limb.motor is not None and limb.sensors
    }


def standing_on(known: FittedPosterior, names: Sequence[str]) -> frozenset[int]:
    """The touch sensors of some legs.

    Args:
        known: The bodies that the robot may have.
        names: Names of the legs' joints, or parts of them that one leg alone has: ``front`` for
            ``hip_front``.

    Raises:
        EstimatorError: No joint, or more than one, is named so.
    """
    legs, sensors = feet(known), set[int]()
    for name in names:
        matches = [leg for leg in legs if leg == name] or [leg for leg in legs if name in leg]
        if len(matches) != 1 or not name:
            raise EstimatorError(
                f"{name!r} names {'several legs' if matches and name else 'no leg'} that the robot "
                f"could stand on: write {', '.join(legs)}"
            )
        sensors.update(legs[matches[0]])
    return frozenset(sensors)
