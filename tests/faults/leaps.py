"""Does the daemon ever command a leap? ``python -m tests.faults.leaps --faults 1000``.

A robot on still electronics performs random motor programs, of all joints or of some, and while it
moves its board is reset, its cable pulled, its answers spoilt, its process stopped or its clock
set, up to three of these at once. The emulated board itself records every move that a command
makes. None may be longer than one update: what a joint moves at top speed until it is its turn
again.

A robot on the chips of an I²C bus bears the same, as far as there is such a thing: a hanging bus,
transfers that nobody acknowledges, a board that is reset; and another program that puts the board
to sleep, wakes it, changes the length of its ticks, inverts, opens, moves or switches its outputs.
Every pulse that a command makes must be one that a servo knows, 500 to 2,500 µs, and the first one
after a reset counts as a move from the last one before.

Serial bus servos are reset or switch their torque off one by one, are moved by another program, do
not answer, and lose bytes, packets and answers: their packets have a checksum, so that what is
damaged is not followed. What another program moves between the last reading of a servo and the goal
that follows it, which is within one update, is not counted.

Damaged lines of an SV203 are counted apart: where a digit of a position is lost on its way the
board moves to another one, and back with the next line. That was not commanded, but it leaps. So
does a servo that another program on the line has moved, for that board cannot be asked in
mid-motion.
"""

from __future__ import annotations

import argparse
import logging
import math
import random
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Final, cast

from bench.still_robot import StillPi, StillRobot, still_pi, still_robot
from protocol.errors import RobotError
from protocol.wire.messages import Clear, ErrorReply, ObservationReply
from robot.control.interaction import LATENESS
from robot.drivers.servos.pca9685 import OSCILLATOR_MHZ
from robot.drivers.servos.pca9685_board import TICKS
from robot.drivers.servos.sv203 import NEUTRAL, SERVOS, SV203Settings
from sim_robot.electronics.serial_device import Follower
from sim_robot.faults.fault_panel import FaultSpec
from tests.faults.still_on_servos import StillOnServos, still_on_servos
from tests.robot.stepped import Bench, SteppedClock, program, request

LONGEST: Final = 3.0  # s; a motion of ±60° from ±60° takes 1 s to zero, 0.3 s there, and 1 s on
REACH: Final = 60.0  # degrees
ONE_QUERY: Final = 0.02  # s; a reset after the last one's answer left the board comes too late
OTHERS: Final = ("sleep", "doze", "prescale", "mode2", "moved", "full_on", "all_off")
ALTERATIONS: Final = ("brown_out", "reset", *OTHERS)
STALL: Final = "stall"
SOUND: Final = ("brown_out", STALL, "unplugged", "mute", "garbage", "jump")
DAMAGING: Final = ("drop", "corrupt", "moved")
ON_SERVOS: Final = (
    *("reboot", "overload", "hot", "dip", "silent", "moved", STALL, "unplugged", "garbage", "lost"),
    *("drop", "corrupt", "jump"),
)
ON_I2C: Final = ("reset", *OTHERS, STALL, "hang", "nak", "unheard", "adapter", "jump")
ELSEWHERE: Final = {"jump": "clock.jump", "adapter": "i2c.unplugged"}  # not at the board
WIDTHS: Final = (500.0, 2500.0)  # µs
PRESCALE: Final = 121
USUAL_TICK_US: Final = (PRESCALE + 1) / OSCILLATOR_MHZ


@dataclass
class Tally:
    """What came of some faults.

    Attributes:
        faults: How many were injected, by kind.
        ends: How the motions ended: error codes, or ``observation``.
        longest: The longest move that a command made, in updates.
        unnoticed: Observations of a robot whose board was reset, or altered by another program,
            before they were taken.
        outside: Pulses that no servo knows.
    """

    faults: Counter[str] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    longest: float = 0.0
    unnoticed: int = 0
    outside: int = 0

    def lines(self) -> Iterator[str]:
        """The figures, for a person."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.faults.items()))
        yield f"{self.faults.total()} faults in {self.ends.total()} motions: {kinds}"
        yield f"ends: {', '.join(f'{count} {end}' for end, count in self.ends.most_common())}"
        yield f"longest move: {self.longest:.2f} times what one update may move"
        yield f"resets and other programs that went unnoticed: {self.unnoticed}"
        yield f"pulses outside 500 to 2,500 µs: {self.outside}"

    @property
    def sound(self) -> bool:
        """Whether nothing of this must not be."""
        leapt = self.longest > 1 + math.ulp(1) * 8
        return not (leapt or self.unnoticed or self.outside)


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

    def __init__(self, robot: StillRobot | StillPi | StillOnServos, clock: FatefulClock, seed: int):
        self.bench = Bench(cast(StillRobot, robot), clock)  # what is used here, both have
        self._robot = robot
        self._clock = clock
        self._random = random.Random(seed)
        joints = robot.config.joints
        self._scales = {joint.output: joint.scale for joint in joints}
        self._period = LATENESS * robot.servos.seconds_for(len(joints))
        self._update = robot.config.speed * self._period
        self._others = -math.inf
        self._longest = 0.0
        self._altered: list[float] = []
        self._last: dict[int, float] = {}
        self._outside = 0
        servos = robot.config.servos
        self._boards = servos.boards if isinstance(servos, SV203Settings) else ()
        if isinstance(robot, StillPi):
            self._board = "pwm"
            robot.pwm.on_pulse = self._pulsed
        elif isinstance(robot, StillOnServos):
            self._board = robot.config.servos.name.lower()
            robot.line.watch_moves(self._moved)
        else:
            self._board = "servo_board"
            robot.servo_board.watch_moves(self._moved)
        robot.controller.set_notify(self.bench.notify)

    def _moved(self, servo: int, before: float, after: float) -> None:
        if self._clock.now() - self._others < self._period:
            return  # another program moved it between the last reading and this goal
        scale = self._scales[servo]
        way = abs(scale.angle(after) - scale.angle(before))
        self._longest = max(self._longest, way / self._update)

    def _pulsed(self, output: int, before: int, after: int) -> None:
        """A move, unless the output was switched off; one that is switched on comes from before."""
        robot = self._robot
        assert isinstance(robot, StillPi)
        tick = robot.pwm.tick_us
        usual = tick / USUAL_TICK_US  # counts of the configured length to one of these
        if after % TICKS:  # else it is a level
            self._outside += not WIDTHS[0] <= after * tick <= WIDTHS[1]
            count = after * usual
            self._moved(output, before % TICKS * usual or self._last.get(output, count), count)
            self._last[output] = count

    def motion(self, tally: Tally, kinds: tuple[str, ...]) -> None:
        """One motion with one to three faults; whatever came of it is cleared and mended."""
        self._longest = 0.0
        self.bench.events.clear()
        self._altered.clear()
        for kind in self._pick(kinds):
            self._order(kind, tally)
        end = self.bench.end_of(self.bench.submit(program(self.bench.robot, **self._targets())))
        if isinstance(end, ObservationReply):
            tally.ends["observation"] += 1
            # One that was asked may be reset while the others still are: the reading is older.
            others = max(0, len(self._boards) - 1) * SERVOS
            checked = self._clock.now() - ONE_QUERY * (1 + others)
            tally.unnoticed += any(at < checked for at in self._altered)
        elif isinstance(end, ErrorReply):
            tally.ends[end.code] += 1
        self._clock.fate.clear()
        self._robot.panel.mend()
        self._recover()
        tally.longest = max(tally.longest, self._longest)
        tally.outside += self._outside
        self._outside = 0

    def _pick(self, kinds: tuple[str, ...]) -> list[str]:
        return self._random.choices(kinds, k=self._random.choice((1, 1, 2, 3)))

    def _order(self, kind: str, tally: Tally) -> None:
        """Has a fault happen at a random moment."""
        at = self._clock.now() + self._random.uniform(0.0, LONGEST)
        lasts = self._random.uniform(0.01, 1)
        stall = self._random.uniform(0.05, 1.95)
        number = {
            "garbage": self._random.randint(1, 4),
            "nak": self._random.choice((0, 2, 3, 5)),
            "unheard": self._random.choice((0, 2, 3, 5)),
            "jump": self._random.choice((-10, -1, 1, 10)),
            "drop": self._random.randint(5, 200),
            "corrupt": self._random.randint(5, 200),
            "brown_out": self._random.choice((0, *self._boards)) if self._boards[1:] else 0,
            "prescale": self._random.choice([n for n in range(3, 256) if n != PRESCALE]),
            "mode2": self._random.choice((0x00, 0x0C, 0x10, 0x14)),  # 0x04 is as it should be
            "moved": self._random.choice(list(self._scales)),
            "full_on": self._random.choice(list(self._scales)),
            "reboot": self._random.choice((0, *self._scales)),
            "lost": self._random.randint(2, 6),
        }.get(kind, 0)
        if kind in ("overload", "hot", "silent"):
            number = self._random.choice(list(self._scales))
        name = ELSEWHERE.get(kind, f"{self._board}.{kind}")

        def begin() -> None:
            tally.faults[kind] += 1
            if kind == STALL:
                self._clock.charge(stall)
                return
            if self._alters(kind, number, FaultSpec.parse(f"{name}={number}")):
                self._altered.append(self._clock.now())

        self._clock.fate.append((at, begin))
        if kind not in (STALL, *ALTERATIONS, "jump", "reboot", "overload"):
            self._clock.fate.append((at + lasts, partial(self._robot.panel.mend, name)))

    def _alters(self, kind: str, number: int, spec: FaultSpec) -> bool:
        """Injects a fault; whether it changes what servos get, which must not go unnoticed.

        One of several SV203s whose servos all stand at neutral has nothing to throw or to notice.
        """
        robot = self._robot
        if isinstance(robot, StillPi):
            before = robot.pwm.pulses(), robot.pwm.tick_us
            robot.panel.order(spec)
            return kind in ALTERATIONS and before != (robot.pwm.pulses(), robot.pwm.tick_us)
        if isinstance(robot, StillOnServos):
            goals = robot.line.pulses()
            robot.panel.order(spec)
            self._others = self._clock.now() if kind == "moved" else self._others
            return kind in ("reboot", "overload") and goals != robot.line.pulses()
        pulses = robot.servo_board.pulses()
        hit = [row for row, board in enumerate(self._boards) if number in (0, board)]
        robot.panel.order(spec)
        return kind == "brown_out" and (
            not self._boards[1:]
            or any(pulses[SERVOS * row + n] != NEUTRAL for row in hit for n in range(SERVOS))
        )

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
def study(
    seed: int,
    kinds: tuple[str, ...] = SOUND,
    *,
    boards: Sequence[int] = (1,),
    family: str = "",
) -> Iterator[Study]:
    """A robot to be tormented, with the electronics that can fail in these ways.

    Args:
        seed: Of what happens when.
        kinds: What happens.
        boards: The numbers of its servo boards, eight joints each, where these are SV203.
        family: That of its serial bus servos, if it has such.
    """
    clock = FatefulClock()
    log = logging.getLogger("leaps")
    with ExitStack() as stack:
        if family:
            servos = stack.enter_context(still_on_servos(family, clock, housekeeping=None, log=log))
            clock.before = Follower(servos.line, servos.servos)
            found = Study(servos, clock, seed)
        elif kinds == ON_I2C:
            found = Study(
                stack.enter_context(still_pi(clock, housekeeping=None, log=log)), clock, seed
            )
        else:
            robot = stack.enter_context(
                still_robot(clock, housekeeping=None, log=log, boards=boards)
            )
            clock.before = Follower(robot.servo_board, robot.servos)
            found = Study(robot, clock, seed)
        controller = found.bench.robot.controller
        controller.start()
        try:
            yield found
        finally:
            controller.shut_down()


def main() -> int:
    """Prints the figures; 1 when the daemon commanded a leap or took no notice of a reset."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=1000, help="of each group")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    sound = True
    for title, kinds, boards, family in (
        ("sound lines", SOUND, (1,), ""),
        ("two boards on a sound line", SOUND, (1, 2), ""),
        ("chips on I²C", ON_I2C, (), ""),
        ("Feetech servos", ON_SERVOS, (), "feetech"),
        ("DYNAMIXEL servos", ON_SERVOS, (), "dynamixel"),
        ("damaged lines", DAMAGING, (1,), ""),
    ):
        tally = Tally()
        with study(options.seed, kinds, boards=boards, family=family) as found:
            while tally.faults.total() < options.faults:
                found.motion(tally, kinds)
        print(f"{title}\n  " + "\n  ".join(tally.lines()), flush=True)
        sound = sound and (tally.sound or kinds == DAMAGING)
    return int(not sound)


if __name__ == "__main__":
    logging.disable()
    raise SystemExit(main())
