"""Many bodies, one after another; what the back-end calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from estimator.body import accelerometer, part_shapes
from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.physics.kernel.compiling import compiled, entrance, stamp
from estimator.physics.kernel.contact import depth
from estimator.physics.kernel.links import GROUP, STEPS, Slew, Trees, assemble, work_space
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


def _make_rest(sources: int) -> Any:
    @entrance
    def rest(
        start: int,
        end: int,
        trees: Trees,
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

        ``programs`` and ``leans`` have one row for all bodies or one for each.

        Returns:
            How many steps that took.
        """
        work = work_space(trees.parent.shape[1])
        steps = 0 * sources  # named here, so that the cache's key knows it
        for row in range(start, end):
            own = trees.base[row]
            program = programs[row if len(programs) > 1 else 0]
            links, points = assemble(trees, row, program, slew, work)
            lean = leans[row if len(leans) > 1 else 0]
            rested = settle(work, links, points, own, slew, lean[0], lean[1])
            if lean[0] != 0 or lean[1] != 0:
                rested = right_itself(work, links, points) and rested
            balances[row] = undecided(work, links, points)
            deep = depth(work.points, points, vector(work.up))
            felt = _up_as_felt(work.up, own[8], own[9])
            tilt[row, 0], tilt[row, 1] = _tilt_of(felt)
            ray = _belly_ray(deep - 0.5 * own[2] * work.up[2], work.up)
            clearance[row], saturated[row] = _clearance_of(ray, cap)
            largest, longest = 0.0, 0
            for part in range(trees.parts[row]):
                longest = max(longest, work.tree[work.place[part], STEPS])
                if trees.motor[row, part] >= 0:
                    largest = max(largest, abs(program[trees.motor[row, part]]) - slew.reach)
                if trees.sensor[row, part] >= 0:
                    group = work.tree[work.place[part], GROUP]
                    above = gap(work, group, deep)
                    for link in range(group + 1, links):
                        if work.tree[link, GROUP] == group:
                            above = min(above, gap(work, link, deep))
                    touch[row, trees.sensor[row, part]] = _touches(above, touch_gap)
                    doubtful[row, trees.sensor[row, part]] = _touch_is_doubtful(above, doubtful_gap)
            miss[row] = largest
            valid[row] = rested and largest <= joint_tolerance
            steps += longest
        return steps

    return rest


def _make_margins(sources: int) -> Any:
    @entrance
    def margins(
        start: int,
        end: int,
        trees: Trees,
        programs: Array,
        slew: Slew,
        most: float,
        path_margins: Array,
    ) -> int:
        """Fills rows ``start`` to ``end`` of the path margins; see ``rest``."""
        work = work_space(trees.parent.shape[1])
        for row in range(start, end):
            own = trees.base[row]
            program = programs[row if len(programs) > 1 else 0]
            links, points = assemble(trees, row, program, slew, work)
            settle(work, links, points, own, slew, 0.0, 0.0)
            path_margins[row] = margin(work, links, points, own, slew, most)
        return 0 * sources

    return margins


rest: Final = _make_rest(_SOURCES)
margins: Final = _make_margins(_SOURCES)
