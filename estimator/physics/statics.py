"""Where a body comes to rest, computed instead of simulated.

With servos that hold their angles a robot is one rigid shape at every moment. All its contacts lie
in one plane, so friction has no moment about any axis in that plane, and stable rest means that the
centre of mass projects inside the polygon of the contacts: its height is a minimum over
orientations. The body starts flat and each joint slews to its own target, so the minimum is
followed while the shape changes, a step at a time. This is the limit of small inertia, or of slow
slewing: momentum has no effect, and ``path_margins`` says how near a body is to landing elsewhere.

* A pose is *undecided* where the centre of mass is balanced on the rim of its support, to within a
  micrometre: a saddle. There the body is left balanced.
* The *path margin* is the angle by which gravity may be inclined, forward, backward, left and
  right, without the body landing elsewhere. Inclining gravity shifts the centre of mass by a share
  of its height, so this one figure takes in the smallest margin of support along the path, the
  energy barriers around the final pose and forks on the way down.

Agreement with simulation, and what it depends on, is in ``docs/how-it-works.md``.
"""

from __future__ import annotations

import importlib
import math
from typing import Any, Final

import numpy as np

from estimator.body.arrays import Bodies, Integers
from estimator.body.morphology import Array
from estimator.errors import PhysicsError
from estimator.executors import Threads
from estimator.physics.base import ArrayPhysics, WorldSettings
from estimator.readings.observation import PredictedReadings
from protocol.system.missing_library import install_command
from protocol.system.process import interrupts_deferred

PACE: Final = math.radians(1.5)
"""Turn of a joint in one step, rad: 20 steps to the end of the paper's range. Of 12,000 random
bodies, 7 land elsewhere than with steps thirty times smaller."""

COARSE_PACE: Final = math.radians(8.0)
"""Turn of a joint in one coarse step, rad: costs three quarters as much, and one body in several
hundred lands elsewhere. With finer steps, too, a body that lies flat is looked at only so often."""

_FEWEST_BODIES: Final = (
    100  # fewest bodies that are worth another thread: a quarter of a millisecond
)
_LARGEST_MARGIN: Final = math.atan(0.5)
_INCLINED_WAYS: Final = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
_SAME_POSE: Final = (
    1e-3  # rad; poses that differ by less count as one: far below what sensors resolve
)
_MOST_RUNGS: Final = (
    5  # inclinations tried from the steepest down, each a quarter of the one before; not tuned
)
_MARGIN_RATIO: Final = (
    1.2  # ratio of the two inclinations between which a margin is known to lie; not tuned
)
_UNKNOWN_STANCE: Final = np.full(1, -1)  # no known stance, for all bodies
_OF_THE_PROCESS: Final = {"_threads", "_kernel", "_compiling", "_compiled"}  # attributes
_FARTHEST_TURN: Final = 100 * 2 * math.pi  # rad; no joint turns as far


class StaticsPhysics(ArrayPhysics):
    """Computes the resting pose of each body.

    Of the settings, steps and time step only limit how far joints turn; friction has no effect.

    Args:
        settings: Settings of the world.
        jobs: Number of threads; results do not depend on it.
        pace: Turn of a joint in one step, rad; finer steps cost more and see narrower forks.

    Raises:
        PhysicsError: ``jobs`` is less than 1, ``pace`` is out of range, or Numba is not installed.
    """

    def __init__(
        self, settings: WorldSettings | None = None, *, jobs: int = 1, pace: float = PACE
    ) -> None:
        super().__init__()
        if jobs < 1:
            raise PhysicsError(f"there must be at least one thread, not {jobs}")
        if not 0 < pace <= PACE:
            raise PhysicsError(f"a joint's step must be above 0 and at most {PACE:.3f} rad")
        self._settings = settings or WorldSettings()
        self._pace = pace
        self._threads = Threads(jobs)
        self._compiled: set[Any] = set()  # functions of the kernel
        try:
            with interrupts_deferred():
                self._kernel: Any = importlib.import_module("estimator.physics.kernel.batch")
                self._compiling: Any = importlib.import_module("estimator.physics.kernel.compiling")
        except ImportError as error:
            raise PhysicsError(
                f"Numba cannot be imported ({error}): {install_command('estimator')}"
            ) from error

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles all but threads and kernel, also of a derived class; a copy has one core."""
        state = {name: value for name, value in vars(self).items() if name not in _OF_THE_PROCESS}
        return type(self), (self._settings,), state

    def close(self) -> None:
        """Ends the threads; may be called twice. The next batch starts new ones."""
        self._threads.close()

    def read_bodies(
        self,
        bodies: Bodies,
        programs: Array,
        gravity_tilts: Array | None = None,
        *,
        coarse_step: bool = False,
        stances: Integers | None = None,
    ) -> PredictedReadings:
        """Computes one interaction per body; see ``ArrayPhysics.read_bodies``.

        With a coarse step joints turn by ``COARSE_PACE`` at a time.
        """
        pace = max(self._pace, COARSE_PACE) if coarse_step else self._pace
        readings, _ = self._at_rest(bodies, programs, gravity_tilts, pace, stances, plumb=True)
        self.simulations += len(bodies)
        return readings

    def path_margins_of_bodies(
        self, bodies: Bodies, programs: Array, most: float = math.inf
    ) -> Array:
        """Path margins, at most the arc tangent of 0.5; see ``ArrayPhysics``.

        A margin costs as much as 4 readings where it is the largest wanted, else as 10 to 20.
        """
        most = min(most, _LARGEST_MARGIN)
        steepest = math.tan(most)
        programs = np.atleast_2d(np.asarray(programs, dtype=float))
        safe, unsafe = np.zeros(len(bodies)), np.full(len(bodies), steepest)
        tried, rungs = unsafe.copy(), 0
        _, plumb = self._at_rest(bodies, programs, None, self._pace, plumb=False)
        searched = np.arange(len(bodies))
        while len(searched):
            rows = searched.repeat(len(_INCLINED_WAYS))
            row_programs = programs if len(programs) == 1 else programs[rows]
            inclined = tried[rows, None] * np.tile(_INCLINED_WAYS, (len(searched), 1))
            _, up = self._at_rest(bodies[rows], row_programs, inclined, self._pace, plumb=False)
            differences = np.abs(up - plumb[rows]).reshape(len(searched), -1).max(axis=1)
            lands_alike = differences <= _SAME_POSE  # False where it is NaN
            safe[searched[lands_alike]] = tried[searched[lands_alike]]
            unsafe[searched[~lands_alike]] = tried[searched[~lands_alike]]
            rungs += 1
            is_lost = (safe == 0) & (rungs == _MOST_RUNGS)
            searched = searched[((unsafe > _MARGIN_RATIO * safe) & ~is_lost)[searched]]
            tried = np.where(safe > 0, np.sqrt(safe * unsafe), 0.25 * tried)
        return np.where(safe == steepest, most, np.arctan(safe))

    def _at_rest(
        self,
        bodies: Bodies,
        programs: Array,
        gravity_tilts: Array | None,
        pace: float,
        stances: Integers | None = None,
        *,
        plumb: bool,
    ) -> tuple[PredictedReadings, Array]:
        """Readings, and up in the body frame, shape (n, 3): NaN where the body did not rest.

        Without ``plumb`` gravity stays inclined, and the readings are not filled in.
        """
        settings, count, trees = self._settings, len(bodies), self._kernel.Trees
        program_rows, farthest = _checked_programs(bodies, programs)
        source, rows = bodies.origin
        readings, up = PredictedReadings.empty(count, bodies.sensors), np.empty((count, 3))
        self.steps += self._share_out(
            self._kernel.rest,
            count,
            (
                trees(source.count, *(getattr(source, name) for name in trees._fields[1:])),
                rows,
                program_rows,
                _checked_tilts(bodies, gravity_tilts),
                _checked_stances(bodies, stances),
                self._slew(farthest, pace),
                self._kernel.Limits(
                    settings.clearance_cap,
                    settings.touch_gap,
                    settings.doubtful_gap,
                    settings.joint_tolerance,
                ),
                plumb,
                self._kernel.Readings(
                    readings.touch,
                    readings.touch_doubtful,
                    readings.tilt,
                    readings.clearance,
                    readings.saturated,
                    readings.joint_miss,
                    readings.valid,
                    readings.undecided,
                    readings.stance,
                    up,
                ),
            ),
        )
        return readings, up

    def _slew(self, farthest: float, pace: float) -> Any:
        """How joints turn that turn by at most ``farthest``, rad: the kernel's ``Slew``."""
        settings = self._settings
        reach = min(settings.slew * settings.step * settings.steps, _FARTHEST_TURN)
        angles = pace * np.arange(math.ceil(min(farthest, reach) / pace) + 2)
        stride = max(1, int(COARSE_PACE / pace))
        return self._kernel.Slew(pace, stride, reach, np.cos(angles), np.sin(angles))

    def _share_out(self, function: Any, count: int, arguments: tuple[Any, ...]) -> int:
        """Computes all rows, each in one thread, so that sums have one order; returns the steps."""
        if function not in self._compiled:
            if not function.signatures:
                with interrupts_deferred(), self._compiling.announced():
                    function(0, 0, *arguments)
            self._compiled.add(function)  # asking Numba costs a tenth of a small batch
        steps = self._threads.share_out(
            lambda start, end: int(function(start, end, *arguments)), count, fewest=_FEWEST_BODIES
        )
        return sum(steps)


def _checked_programs(bodies: Bodies, programs: Array) -> tuple[Array, float]:
    """One motor program for all bodies, or one for each; and an angle that no hinge exceeds, rad.

    Raises:
        PhysicsError: The programs have a wrong shape or are not finite.
    """
    rows = np.ascontiguousarray(np.atleast_2d(np.asarray(programs, dtype=float)))
    if rows.ndim != 2 or len(rows) not in (1, len(bodies)) or rows.shape[1] < bodies.motors:
        raise PhysicsError(
            f"{len(bodies)} bodies of {bodies.motors} motors need a motor program of at least so "
            f"many angles, or one for each body, not an array of shape {np.shape(programs)}"
        )
    travel, zero, short = bodies.strays
    farthest = travel * _largest_magnitude(rows) + zero + short
    if not math.isfinite(farthest):
        row = int(np.argmin(np.all(np.isfinite(rows), axis=1)))
        raise PhysicsError(f"a motor program must be finite, not {rows[row].tolist()}")
    return rows, farthest


def _checked_tilts(bodies: Bodies, gravity_tilts: Array | None) -> Array:
    if gravity_tilts is None:
        return np.zeros((1, 2))
    rows = np.ascontiguousarray(np.atleast_2d(np.asarray(gravity_tilts, dtype=float)))
    if rows.ndim != 2 or len(rows) not in (1, len(bodies)) or rows.shape[1] != 2:
        raise PhysicsError(
            f"{len(bodies)} bodies need an inclination of gravity as two tangents, or two for each "
            f"body, not an array of shape {np.shape(gravity_tilts)}"
        )
    if not math.isfinite(_largest_magnitude(rows)):
        raise PhysicsError("inclinations of gravity must be finite")
    return rows


def _checked_stances(bodies: Bodies, stances: Integers | None) -> Integers:
    if stances is None:
        return _UNKNOWN_STANCE
    rows = np.ascontiguousarray(stances)
    if rows.shape != (len(bodies),) or rows.dtype != np.int64:
        raise PhysicsError(
            f"{len(bodies)} bodies need as many stances of earlier readings, not {rows.dtype} of "
            f"shape {rows.shape}"
        )
    return rows


def _largest_magnitude(rows: Array) -> float:
    """Largest absolute value, found from the least and the largest number; NaN where one is NaN."""
    least, largest = float(rows.min(initial=0.0)), float(rows.max(initial=0.0))
    return largest if math.isnan(largest) else max(largest, -least)
