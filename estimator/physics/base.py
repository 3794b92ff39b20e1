"""What a physics back-end is: bodies and motor programs in, predicted readings out.

An interaction starts planar: the body upright, all angles 0, its lowest point on the ground. A body
that does not lie on its main body there comes to rest first, as a robot does. Each joint then turns
at the slew speed to its own target, the body comes to rest, and is read.

What tilt, clearance and touch are is defined in ``protocol.wire.readings``.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from estimator.body.arrays import Bodies, Integers
from estimator.body.morphology import Array, Morphology
from estimator.errors import PhysicsError
from estimator.readings.observation import PredictedReadings
from protocol.system.process import Closable
from protocol.wire.readings import DOUBTFUL_GAP, TOUCH_GAP

GRAVITY: Final = 9.81  # m/s²

Pair: TypeAlias = tuple[Morphology, Array]
"""A body and a motor program: the angle of each motor, rad."""


@dataclass(frozen=True, kw_only=True)
class WorldSettings:
    """The world that bodies are simulated in; the same for robot and models where it can be.

    Attributes:
        steps: Number of steps of one simulation; the paper's 300.
        step: Time step, s. The paper gives 300 steps and 5-second interactions, so 1/60 s is our
            inference.
        friction: Coefficient of friction between body and ground. The paper gives none.
        slew: Speed of the joints, rad/s; the paper's servos reach 60°/s.
        clearance_cap: Range of the distance sensor, m.
        touch_gap: A part touches when its gap to the ground is smaller, m.
        doubtful_gap: A touch is doubtful when the gap lies between 0 and this, m.
        joint_tolerance: A reading counts only if every joint is this close to its target, rad.
        full_steps: Whether to simulate all steps of every body, also of one that rests already.
        rest_window: Time after which a body rests that has kept tilt and height, s; 0: one rests
            that hardly moves at a few looks, which is enough with coarse steps.
        least_inertia: Every link of a body in PyBullet gets at least this local inertia, in units
            of the body's weight times its reach times the square of the time step; see
            ``inertia_floor``. 0 leaves the links as they are.
    """

    steps: int = 300
    step: float = 1 / 60
    friction: float = 0.7
    slew: float = math.radians(60)
    clearance_cap: float = 0.2
    touch_gap: float = TOUCH_GAP
    doubtful_gap: float = DOUBTFUL_GAP
    joint_tolerance: float = math.radians(0.1)
    full_steps: bool = False
    rest_window: float = 0.0
    least_inertia: float = 6.0

    def inertia_floor(self, body: Morphology) -> float:
        """The least inertia that the links of a body are simulated with, kg·m².

        A joint under load lags by the angle that gravity, with the body's weight at the end of its
        longest limb, turns a link in one step. So links with little inertia miss their targets,
        those with much have too much momentum, and what is just enough grows with the body.
        """
        return self.least_inertia * GRAVITY * body.mass * body.reach * self.step**2


class Physics(Closable):
    """A back-end: predicts what the sensors of bodies read after motor programs.

    A reading depends on its own pair only, never on the others in the batch, their order, earlier
    batches or the number of processes.

    A back-end derives from this class, defines ``read``, and adds what it did to both counts below.
    ``backends`` loads the class by name and calls it with the ``WorldSettings``, in this process or
    in others; so it has to be picklable, a class at the top level of its module.

    Attributes:
        simulations: How many interactions were simulated so far.
        steps: How many time steps were computed so far.
    """

    def __init__(self) -> None:
        self.simulations = 0
        self.steps = 0

    @abstractmethod
    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        """Simulates one interaction per pair.

        Args:
            pairs: Bodies that all have equally many touch sensors, each with the angle of each
                motor, rad.

        Returns:
            Readings, one row per pair, in order.

        Raises:
            PhysicsError: A motor program is too short or not finite, or the engine failed.
        """

    def close(self) -> None:
        """Gives processes and engine memory back, where there are any; may be called twice."""


class ArrayPhysics(Physics):
    """A back-end that takes bodies as arrays, and knows how stable its readings are.

    It runs in this process where others are run in worker processes: its constructor takes
    ``jobs``, the number of threads that it may use. With it the posterior can be sampled, for which
    it must be picklable with its counts.
    """

    @abstractmethod
    def read_bodies(
        self,
        bodies: Bodies,
        programs: Array,
        gravity_tilts: Array | None = None,
        *,
        coarse_step: bool = False,
        stances: Integers | None = None,
    ) -> PredictedReadings:
        """Simulates one interaction per body, without an object per body.

        Args:
            bodies: n bodies.
            programs: Angle that each motor is told, rad: shape (motors,) for all bodies, or
                (n, motors). Hinges go to that times the part's ``travel``, less its
                ``short``, plus its ``zero``.
            gravity_tilts: How far gravity is inclined on the way to the pose, not at its end, as
                tangents towards x and y in the body frame: shape (2,) for all bodies, or (n, 2);
                plumb by default. Where a body lands under small inclinations says where it might
                have landed.
            coarse_step: Whether a few bodies may land elsewhere than they should, if that costs
                less: for a first look, after which what is found is computed again.
            stances: ``stance`` of readings of nearly the same bodies, shape (n,). A body that can
                rest so, too, is taken to, however it would fall; for others they change nothing.

        Returns:
            Readings, one row per body.

        Raises:
            PhysicsError: The programs or inclinations have a wrong shape or are not finite, or the
                engine failed.
        """

    @abstractmethod
    def path_margins_of_bodies(
        self, bodies: Bodies, programs: Array, most: float = math.inf
    ) -> Array:
        """Angle by which gravity may be inclined without each body landing elsewhere.

        Args:
            bodies: n bodies.
            programs: As for ``read_bodies``.
            most: Largest margin that is wanted, rad: whether margins are above an angle is found
                faster than how large they are.

        Returns:
            Path margins, rad, shape (n,), at least 0.

        Raises:
            PhysicsError: The programs have a wrong shape or are not finite, or the engine failed.
        """

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        """Simulates one interaction per pair, by ``read_bodies``; see ``Physics.read``."""
        sensor_count(pairs)
        return self.read_bodies(*as_arrays(pairs)) if pairs else PredictedReadings.empty(0, 0)

    def path_margins(self, pairs: Sequence[Pair]) -> Array:
        """The path margin of each pair, rad, shape (n,); see ``path_margins_of_bodies``."""
        return self.path_margins_of_bodies(*as_arrays(pairs)) if pairs else np.zeros(0)


def as_arrays(pairs: Sequence[Pair]) -> tuple[Bodies, Array]:
    """Bodies and motor programs as arrays; shorter programs are filled up with zeros.

    Raises:
        PhysicsError: A motor program is too short for its body.
    """
    bodies = Bodies.of([morphology for morphology, _ in pairs])
    programs = np.zeros((len(pairs), max(len(program) for _, program in pairs)))
    for row, (morphology, program) in enumerate(pairs):
        morphology.part_angles(program)  # refuses one that is too short for this very body
        programs[row, : len(program)] = program
    return bodies, programs


def sensor_count(pairs: Sequence[Pair]) -> int:
    """Returns how many touch sensors each body of a batch has.

    Raises:
        PhysicsError: The bodies have different numbers of touch sensors.
    """
    counts = {morphology.sensors for morphology, _ in pairs}
    if len(counts) > 1:
        raise PhysicsError(
            f"the bodies of one batch must have equally many touch sensors, not {sorted(counts)}"
        )
    return counts.pop() if counts else 0
