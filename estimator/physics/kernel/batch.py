"""Many bodies, one after another; what the back-end calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from estimator.body import accelerometer, part_shapes
from estimator.body.arrays import Flags, Integers
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled, entrance, stamp
from estimator.physics.kernel.contact import depth
from estimator.physics.kernel.links import (
    GROUP,
    STEPS,
    TOGETHER,
    Slew,
    Trees,
    Work,
    assemble,
    list_points,
    work_space,
)
from estimator.physics.kernel.path import gap, margin, right_itself, settle, undecided
from estimator.physics.kernel.vectors import vector
from protocol.wire import readings as definitions

_SOURCES: Final = stamp(
    Path(__file__).parent,
    Path(definitions.__file__),
    Path(accelerometer.__file__),
    Path(part_shapes.__file__),
)

_up_as_felt: Final = compiled(accelerometer.up_as_felt)
_tilt_of: Final = compiled(definitions.tilt_of)
_belly_ray: Final = compiled(definitions.belly_ray)
_clearance_of: Final = compiled(definitions.clearance_of)
_touches: Final = compiled(definitions.touches)
_touch_is_doubtful: Final = compiled(definitions.touch_is_doubtful)


@compiled
def _rows_together(
    work: Work, first: int, end: int, which: Integers, programs: Array, leans: Array
) -> int:
    """How many rows from one on are of the same body in the same program: at most ``TOGETHER``.

    Fills in how gravity is inclined for each.
    """
    row = first
    while row < end and row < first + TOGETHER and which[row] == which[first]:
        if len(programs) > 1:
            for motor in range(programs.shape[1]):
                if programs[row, motor] != programs[first, motor]:
                    return row - first
        lean = leans[row if len(leans) > 1 else 0]
        work.lean[row - first, 0], work.lean[row - first, 1] = lean[0], lean[1]
        row += 1
    return row - first


def _make_rest(sources: int) -> Any:
    @entrance
    def rest(
        start: int,
        end: int,
        trees: Trees,
        which: Integers,
        programs: Array,
        leans: Array,
        slew: Slew,
        cap: float,
        touch_gap: float,
        doubtful_gap: float,
        joint_tolerance: float,
        touch: Flags,
        doubtful: Flags,
        tilt: Array,
        clearance: Array,
        saturated: Flags,
        miss: Array,
        valid: Flags,
        balances: Flags,
    ) -> int:
        """Fills rows ``start`` to ``end`` of the readings.

        ``which`` says of each row which of the trees it is of. ``programs`` and ``leans`` have one
        row for all or one for each.

        Returns:
            How many steps that took.
        """
        work = work_space(trees.parent.shape[1])
        steps = 0 * sources  # named here, so that the cache's key knows it
        row = start
        while row < end:
            body = which[row]
            own = trees.base[body]
            program = programs[row if len(programs) > 1 else 0]
            links = assemble(trees, body, program, slew, work)
            points = list_points(trees, body, links, work)
            several = _rows_together(work, row, end, which, programs, leans)
            settle(work, links, points, own, slew, several)
            for each in range(several):
                if work.lean[each, 0] != 0 or work.lean[each, 1] != 0:
                    right_itself(work, links, points, each)
                balances[row] = undecided(work, links, points, each)
                up = vector(work.up[each])
                deep = depth(work.points, points, up)
                felt = _up_as_felt(up, own[8], own[9])
                tilt[row, 0], tilt[row, 1] = _tilt_of(felt)
                ray = _belly_ray(deep - 0.5 * own[2] * up[2], up)
                clearance[row], saturated[row] = _clearance_of(ray, cap)
                largest, longest = 0.0, 0
                for part in range(trees.parts[body]):
                    longest = max(longest, work.tree[work.place[part], STEPS])
                    motor, sensor = trees.motor[body, part], trees.sensor[body, part]
                    if motor >= 0:
                        largest = max(largest, abs(program[motor]) - slew.reach)
                    if sensor >= 0:
                        group = work.tree[work.place[part], GROUP]
                        above = gap(work, group, up, deep)
                        for link in range(group + 1, links):
                            if work.tree[link, GROUP] == group:
                                above = min(above, gap(work, link, up, deep))
                        touch[row, sensor] = _touches(above, touch_gap)
                        doubtful[row, sensor] = _touch_is_doubtful(above, doubtful_gap)
                miss[row] = largest
                valid[row] = work.rested[each] and largest <= joint_tolerance
                steps += longest
                row += 1
        return steps

    return rest


def _make_margins(sources: int) -> Any:
    @entrance
    def margins(
        start: int,
        end: int,
        trees: Trees,
        which: Integers,
        programs: Array,
        slew: Slew,
        most: float,
        path_margins: Array,
    ) -> int:
        """Fills rows ``start`` to ``end`` of the path margins; see ``rest``."""
        work = work_space(trees.parent.shape[1])
        for row in range(start, end):
            body = which[row]
            own = trees.base[body]
            program = programs[row if len(programs) > 1 else 0]
            links = assemble(trees, body, program, slew, work)
            points = list_points(trees, body, links, work)
            work.lean[0, 0] = work.lean[0, 1] = 0.0
            settle(work, links, points, own, slew, np.int64(1))  # a plain 1 is a type of its own
            path_margins[row] = margin(work, links, points, own, slew, most)
        return 0 * sources

    return margins


rest: Final = _make_rest(_SOURCES)
margins: Final = _make_margins(_SOURCES)
