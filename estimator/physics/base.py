"""The interface of physics back-ends: bodies and motor programs in, readings out.

An interaction starts planar: the body upright, all angles 0, its lowest point on the ground. A body
that does not lie on its main body there comes to rest first, as a robot does. Each joint then turns
at the slew speed to its own target, the body comes to rest, and is read.

What tilt, clearance and touch are is defined in ``protocol.wire.readings``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Final, Protocol, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray

from estimator.body.accelerometer import up_as_felt
from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array, Morphology
from estimator.errors import PhysicsError
from protocol.system.process import Closable
from protocol.wire.readings import (
    DOUBTFUL_GAP,
    TOUCH_GAP,
    Direction,
    belly_ray,
    clearance_of,
    tilt_of,
    touch_is_doubtful,
    touches,
)

GRAVITY: Final = 9.81  # m/s²

Pair: TypeAlias = tuple[Morphology, Array]
"""A body and a motor program: the angle of each motor, rad."""


@dataclass(frozen=True, kw_only=True)
class WorldSettings:
    """The world that bodies are simulated in; the same for robot and models where it can be.

    Attributes:
        steps: Steps of one simulation; the paper's 300.
        step: Time step, s. The paper gives 300 steps and 5-second interactions, so 1/60 s is our
            inference.
        friction: Coefficient between body and ground. The paper is silent.
        slew: Speed of the joints, rad/s; the paper's servos reach 60°/s.
        clearance_cap: Range of the distance sensor, m.
        touch_gap: A part touches when its gap to the ground is smaller, m.
        doubtful_gap: A touch is doubtful when the gap lies between 0 and this, m.
        joint_tolerance: A reading counts only if every joint is this close to its target, rad.
        full_steps: Simulate all steps of every body, also of one that came to rest long before.
        rest_window: A body rests that has kept tilt and height for so long, s; 0: one that hardly
            moves at a few looks, which is enough with coarse steps.
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

        A joint under load lags by what gravity, with the body's weight at the end of its longest
        limb, turns a link in one step. So light links miss their targets, heavy ones have more
        momentum than they should, and what is just enough grows with the body.
        """
        return self.least_inertia * GRAVITY * body.mass * body.reach * self.step**2


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Sensor readings of n bodies at rest.

    Attributes:
        touch: Shape (n, s): whether each touch sensor's part, or one rigidly joined to it, meets
            the ground.
        touch_doubtful: Shape (n, s): the gap is so small that a real gauge might say otherwise.
        tilt: Shape (n, 2): left/right and forward/back, rad.
        clearance: Shape (n,), m.
        saturated: Shape (n,): the ground lies beyond the sensor's range.
        speed: Shape (n,): speed of the main body at the last step, m/s.
        joint_miss: Shape (n,): largest distance of a joint from its target, rad.
        valid: Shape (n,): the simulation can be believed. False where a joint missed its target,
            the simulation diverged, or the engine refused the body; such a body loses against any
            other, and the search counts it.
        undecided: Shape (n,): the body is balanced on the rim of its support and might as well
            lie elsewhere, so the reading says nothing. Only a back-end that computes the pose can
            tell; one that simulates never says so.
    """

    touch: Flags
    touch_doubtful: Flags
    tilt: Array
    clearance: Array
    saturated: Flags
    speed: Array
    joint_miss: Array
    valid: Flags
    undecided: Flags

    def __len__(self) -> int:
        return len(self.clearance)

    def __getitem__(self, rows: int | slice | NDArray[np.intp]) -> Readings:
        """Selects the readings of some of the bodies."""
        return Readings(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})

    def reshaped(self, *shape: int) -> Readings:
        """The same readings, in arrays that begin with this shape in the place of (n,)."""
        arrays = {item.name: getattr(self, item.name) for item in fields(self)}
        return Readings(
            **{name: array.reshape(*shape, *array.shape[1:]) for name, array in arrays.items()}
        )

    @classmethod
    def empty(cls, count: int, sensors: int) -> Readings:
        """Invalid readings of ``count`` bodies, to be filled in."""
        return cls(
            touch=np.zeros((count, sensors), dtype=bool),
            touch_doubtful=np.zeros((count, sensors), dtype=bool),
            tilt=np.zeros((count, 2)),
            clearance=np.zeros(count),
            saturated=np.zeros(count, dtype=bool),
            speed=np.zeros(count),
            joint_miss=np.zeros(count),
            valid=np.zeros(count, dtype=bool),
            undecided=np.zeros(count, dtype=bool),
        )

    def fill_row(
        self,
        row: int,
        body: Morphology,
        settings: WorldSettings,
        *,
        height: float,
        up: Direction,
        gaps: Sequence[float],
    ) -> None:
        """Fills in what one body feels in a pose that was simulated.

        Args:
            row: Of the body.
            body: The body.
            settings: Its world.
            height: Of the main body's middle above the ground, m.
            up: The world's up in the body's frame.
            gaps: Distance of each part from the ground, m; negative where it sinks in.
        """
        self.tilt[row] = tilt_of(up_as_felt(up, *body.base.accelerometer))
        ray = belly_ray(height - up[2] * body.base.size[2] / 2, up)
        self.clearance[row], self.saturated[row] = clearance_of(ray, settings.clearance_cap)
        for sensor in range(body.sensors):
            gap = min((gaps[part] for part in body.sensor_parts(sensor)), default=math.inf)
            self.touch[row, sensor] = touches(gap, settings.touch_gap)
            self.touch_doubtful[row, sensor] = touch_is_doubtful(gap, settings.doubtful_gap)

    @classmethod
    def concatenate(cls, pieces: Iterable[Readings]) -> Readings:
        """Joins readings of bodies with equally many touch sensors, in the order given."""
        rows = list(pieces)
        if not rows:
            return cls.empty(0, 0)
        return cls(
            **{
                item.name: np.concatenate([getattr(piece, item.name) for piece in rows])
                for item in fields(cls)
            }
        )


@dataclass(frozen=True, kw_only=True)
class Abilities:
    """What a back-end can do beyond ``Physics.read``. A class of back-ends declares it.

    Attributes:
        arrays: It computes a whole population as arrays: it is an ``ArrayPhysics``. Arrays are used
            where it runs in this process, so with ``threads``; worker processes are sent pairs.
        path_margins: It knows how sure its readings are: it is a ``MarginPhysics``, and an
            ``ArrayMarginPhysics`` where it also takes arrays.
        undecided: It tells poses that might as well be others; see ``Readings.undecided``.
        threads: It uses several cores by itself: its constructor takes ``jobs``, their number.
            Any other is run in worker processes, each with an object of its own.
    """

    arrays: bool = False
    path_margins: bool = False
    undecided: bool = False
    threads: bool = False


class Physics(Protocol):
    """A back-end: computes what bodies feel after motor programs.

    A reading depends on its own pair only, never on the others in the batch, their order, earlier
    batches or the number of processes.

    ``backends`` loads the class of a back-end by name and calls it with the ``WorldSettings``, in
    this process or in others; so it has to be picklable, a class at the top level of its module.
    """

    @property
    def abilities(self) -> Abilities:
        """What it can do beyond ``read``."""

    @property
    def simulations(self) -> int:
        """How many interactions were simulated so far."""

    @property
    def steps(self) -> int:
        """How many time steps were computed so far."""

    def read(self, pairs: Sequence[Pair]) -> Readings:
        """Simulates one interaction per pair.

        Args:
            pairs: Bodies that all have equally many touch sensors, each with the angle of each
                motor, rad.

        Returns:
            One row per pair, in order.

        Raises:
            PhysicsError: A motor program is too short or not finite, or the engine failed.
        """

    def close(self) -> None:
        """Gives processes and engine memory back; may be called twice."""


class ArrayPhysics(Physics, Protocol):
    """A back-end that takes bodies as arrays, which saves making an object of each."""

    def read_bodies(self, bodies: Bodies, programs: Array) -> Readings:
        """Simulates one interaction per body.

        Args:
            bodies: n bodies.
            programs: Angle of each motor, rad: shape (motors,) for all bodies, or (n, motors).

        Returns:
            One row per body.

        Raises:
            PhysicsError: The programs have a wrong shape or are not finite, or the engine failed.
        """


class MarginPhysics(Physics, Protocol):
    """A back-end that knows how sure its readings are."""

    def path_margins(self, pairs: Sequence[Pair]) -> Array:
        """By which angle gravity may be inclined without the body landing elsewhere.

        Args:
            pairs: As for ``read``.

        Returns:
            Of each pair, rad, shape (n,).

        Raises:
            PhysicsError: A motor program is too short or not finite, or the engine failed.
        """


class ArrayMarginPhysics(ArrayPhysics, MarginPhysics, Protocol):
    """A back-end that takes arrays and knows how sure its readings are."""

    def read_bodies(
        self,
        bodies: Bodies,
        programs: Array,
        leans: Array | None = None,
        *,
        quickly: bool = False,
    ) -> Readings:
        """Simulates one interaction per body.

        Args:
            bodies: As for ``ArrayPhysics.read_bodies``, like ``programs``.
            programs: Angle of each motor, rad.
            leans: How far gravity is inclined on the way to the pose, not at its end, as tangents
                towards x and y in the body frame: shape (2,) for all bodies, or (n, 2); plumb by
                default. Where a body lands under small inclinations says where it might have
                landed.
            quickly: Few bodies may land elsewhere than they should, if that costs less: what a
                search looks at first, and again before it is believed.

        Returns:
            One row per body.

        Raises:
            PhysicsError: The programs or leans have a wrong shape or are not finite, or the engine
                failed.
        """

    def path_margins_of_bodies(
        self, bodies: Bodies, programs: Array, most: float = math.inf
    ) -> Array:
        """Path margins; errors are those of ``read_bodies``.

        Args:
            bodies: As for ``read_bodies``, like ``programs``.
            programs: Angle of each motor, rad.
            most: The largest margin told, rad: who only asks whether margins are above an angle
                need not wait for more.

        Returns:
            rad, shape (n,).
        """


def takes_arrays(physics: Physics) -> TypeGuard[ArrayPhysics]:
    """Whether a back-end takes bodies as arrays, by what it declares."""
    return physics.abilities.arrays


class BackEnd(Closable):
    """Base class of back-ends, which counts their work and makes them context managers.

    Attributes:
        abilities: What the back-end can do beyond ``read``; nothing, unless a subclass declares it.
        simulations: How many interactions were simulated so far.
        steps: How many time steps were computed so far.
    """

    abilities: Abilities = Abilities()

    def __init__(self) -> None:
        self.simulations = 0
        self.steps = 0


def sensor_count(pairs: Sequence[Pair]) -> int:
    """Returns how many touch sensors each body of a batch has.

    Raises:
        PhysicsError: They have different numbers of touch sensors.
    """
    counts = {morphology.sensors for morphology, _ in pairs}
    if len(counts) > 1:
        raise PhysicsError(
            f"the bodies of one batch must have equally many touch sensors, not {sorted(counts)}"
        )
    return counts.pop() if counts else 0
