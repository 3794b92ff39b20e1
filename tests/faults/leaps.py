"""Does the daemon ever command a leap? ``python -m tests.faults.leaps --faults 1000``.

A robot on still electronics performs random motor programs, of all joints or of some, and while it
moves its board is reset, its cable pulled, its answers spoilt, its process stopped or its clock
set, up to three of these at once. The emulated board itself records every move that a command
makes. None may be longer than one update: what a joint moves at top speed until it is its turn
again.

Damaged lines are counted apart: where a digit of a position is lost on its way the board moves to
another one, and back with the next line. That was not commanded, but it leaps.
"""

from __future__ import annotations

import argparse
import logging
import math
import random
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from bench.still_robot import StillRobot, still_robot
from protocol.errors import RobotError
from protocol.wire.messages import Clear, ErrorReply, ObservationReply
from robot.control.interaction import LATENESS
from sim_robot.electronics.clock import Follower
from sim_robot.faults.fault_panel import FaultSpec
from tests.robot.stepped import Bench, SteppedClock, program, request

LONGEST: Final = 3.0  # s; a motion of ±60° from ±60° takes 1 s to zero, 0.3 s there, and 1 s on
REACH: Final = 60.0  # degrees
ONE_QUERY: Final = 0.02  # s; a reset after the last one's answer left the board comes too late
RESET: Final = "brown_out"
STALL: Final = "stall"
SOUND: Final = (RESET, STALL, "unplugged", "mute", "garbage", "jump")
DAMAGING: Final = ("drop", "corrupt")


@dataclass
class Tally:
    """What came of some faults.

    Attributes:
        faults: How many were injected, by kind.
        ends: How the motions ended: error codes, or ``observation``.
        longest: The longest move that a command made, in updates.
        unnoticed: Observations of a robot whose board was reset before they were taken.
    """

    faults: Counter[str] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    longest: float = 0.0
    unnoticed: int = 0

    def lines(self) -> Iterator[str]:
        """The figures, for a person."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.faults.items()))
        yield f"{self.faults.total()} faults in {self.ends.total()} motions: {kinds}"
        yield f"ends: {', '.join(f'{count} {end}' for end, count in self.ends.most_common())}"
        yield f"longest move: {self.longest:.2f} times what one update may move"
        yield f"resets that went unnoticed: {self.unnoticed}"


class FatefulClock(SteppedClock):
    """Virtual time in which things happen.

    Attributes:
        fate: What happens, and when, s.
        before: Called before each sleep.
    """

    def __init__(self) -> None:
        super().__init__()
        self.fate: list[tuple[float, Callable[[], object]]] = []
        self.before: Callable[[], object] = lambda: None

    def sleep(self, seconds: float) -> None:
        self.before()
        super().sleep(seconds)
        for event in [event for event in self.fate if event[0] <= self.now()]:
            self.fate.remove(event)
            event[1]()


class Study:
    """A robot, and the faults that it has to bear, one motion after another."""

    def __init__(self, robot: StillRobot, clock: FatefulClock, seed: int):
        self.bench = Bench(robot, clock)
        self._robot = robot
        self._clock = clock
        self._random = random.Random(seed)
        joints = robot.config.joints
        self._scales = {joint.output: joint.scale for joint in joints}
        period = LATENESS * robot.servos.seconds_for(len(joints))
        self._update = robot.config.speed * period
        self._longest = 0.0
        self._resets: list[float] = []
        robot.servo_board.watch_moves(self._moved)
        robot.controller.set_notify(self.bench.notify)

    def _moved(self, servo: int, before: int, after: int) -> None:
        scale = self._scales[servo]
        way = abs(scale.angle(after) - scale.angle(before))
        self._longest = max(self._longest, way / self._update)

    def motion(self, tally: Tally, kinds: tuple[str, ...]) -> None:
        """One motion with one to three faults; whatever came of it is cleared and mended."""
        self._longest = 0.0
        self.bench.events.clear()
        self._resets.clear()
        for kind in self._pick(kinds):
            self._order(kind, tally)
        end = self.bench.end_of(self.bench.submit(program(self._robot, **self._targets())))
        if isinstance(end, ObservationReply):
            tally.ends["observation"] += 1
            checked = self._clock.now() - ONE_QUERY
            tally.unnoticed += any(reset < checked for reset in self._resets)
        elif isinstance(end, ErrorReply):
            tally.ends[end.code] += 1
        self._clock.fate.clear()
        self._robot.panel.mend()
        self._recover()
        tally.longest = max(tally.longest, self._longest)

    def _pick(self, kinds: tuple[str, ...]) -> list[str]:
        return self._random.choices(kinds, k=self._random.choice((1, 1, 2, 3)))

    def _order(self, kind: str, tally: Tally) -> None:
        """Has a fault happen at a random moment."""
        at = self._clock.now() + self._random.uniform(0.0, LONGEST)
        lasts = self._random.uniform(0.01, 1)
        stall = self._random.uniform(0.05, 1.95)
        number = {
            "garbage": self._random.randint(1, 4),
            "jump": self._random.choice((-10, -1, 1, 10)),
            "drop": self._random.randint(5, 200),
            "corrupt": self._random.randint(5, 200),
        }.get(kind, 0)
        name = f"{'clock' if kind == 'jump' else 'servo_board'}.{kind}"

        def begin() -> None:
            tally.faults[kind] += 1
            if kind == STALL:
                self._clock.charge(stall)
                return
            if kind == RESET:
                self._resets.append(self._clock.now())
            self._robot.panel.order(FaultSpec.parse(f"{name}={number}"))

        self._clock.fate.append((at, begin))
        if kind not in (STALL, RESET, "jump"):
            self._clock.fate.append((at + lasts, partial(self._robot.panel.mend, name)))

    def _targets(self) -> dict[str, float]:
        names = [joint.name for joint in self._robot.config.joints]
        some = self._random.sample(names, self._random.choice((1, 3, len(names), len(names))))
        return {name: self._random.uniform(-REACH, REACH) for name in some}

    def _recover(self) -> None:
        """Clears as a person would, again where another fault was only found by clearing."""
        for _ in range(4):
            if self.bench.state() != "fault":
                return
            self.bench.end_of(self.bench.submit(request(Clear)))
        raise RobotError("fault", self._robot.controller.snapshot().reason or "")


@contextmanager
def study(seed: int) -> Iterator[Study]:
    """A robot to be tormented."""
    clock = FatefulClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("leaps")) as robot:
        clock.before = Follower(robot.servo_board, robot.servos)
        found = Study(robot, clock, seed)
        robot.controller.start()
        try:
            yield found
        finally:
            robot.controller.shut_down()


def main() -> int:
    """Prints the figures; 1 when the daemon commanded a leap or took no notice of a reset."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=1000, help="of each of the two groups")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    tallies = {}
    for title, kinds in (("sound lines", SOUND), ("damaged lines", DAMAGING)):
        tally = tallies[title] = Tally()
        with study(options.seed) as found:
            while tally.faults.total() < options.faults:
                found.motion(tally, kinds)
        print(f"{title}\n  " + "\n  ".join(tally.lines()), flush=True)
    sound = tallies["sound lines"]
    return int(sound.longest > 1 + math.ulp(1) * 8 or sound.unnoticed > 0)


if __name__ == "__main__":
    logging.disable()
    raise SystemExit(main())
