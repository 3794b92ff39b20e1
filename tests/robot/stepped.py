"""A robot on still electronics, with a clock that the test steps by hand."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field
from typing import Any

from bench.still_robot import StillRobot
from protocol.rules.robot_interface import FinalReply, Finished, RobotEvent
from protocol.wire.messages import Clear, Hold, ObservationReply, Ok, Perform, Read, Relax, Stop


class SteppedClock:
    """Sleepers wait until the test has moved the clock far enough; ``free`` lets it run."""

    def __init__(self) -> None:
        self._now = 0.0
        self._free = True
        self._deadline: float | None = None
        self._changed = threading.Condition()

    def now(self) -> float:
        return self._now

    def charge(self, seconds: float) -> None:
        self._now += seconds

    def sleep(self, seconds: float) -> None:
        with self._changed:
            deadline = self._now + max(seconds, 0.0)
            self._deadline = deadline
            self._changed.notify_all()
            arrived = self._changed.wait_for(lambda: self._free or self._now >= deadline, 120)
            assert arrived, "nobody moved the clock"
            self._deadline = None
            self._now = max(self._now, deadline)

    def freeze(self) -> None:
        with self._changed:
            self._free = False

    def free(self) -> None:
        with self._changed:
            self._free = True
            self._changed.notify_all()

    def advance_to(self, time: float) -> None:
        """Moves on to ``time``, one sleeper after another, and waits until one sleeps beyond."""
        with self._changed:
            while True:
                slept = self._changed.wait_for(lambda: self._deadline is not None, 120)
                assert slept, "the control loop does not sleep"
                assert self._deadline is not None
                if self._deadline > time:
                    self._now = max(self._now, time)
                    return
                self._now = max(self._now, self._deadline)
                self._deadline = None
                self._changed.notify_all()


@dataclass
class Bench:
    """Submits requests and waits for their ends."""

    robot: StillRobot
    clock: SteppedClock
    events: list[RobotEvent] = field(default_factory=list)
    _arrived: threading.Condition = field(default_factory=threading.Condition)
    _ticket: int = 0

    def notify(self) -> None:
        with self._arrived:
            self.events += self.robot.controller.events()
            self._arrived.notify_all()

    def submit(self, request: Perform | Read | Hold | Relax | Stop | Clear) -> int:
        self._ticket += 1
        self.robot.controller.submit(self._ticket, request)
        return self._ticket

    def end_of(self, ticket: int) -> FinalReply:
        def replies() -> list[FinalReply]:
            return [e.reply for e in self.events if isinstance(e, Finished) and e.ticket == ticket]

        with self._arrived:
            assert self._arrived.wait_for(replies, 120), "the request did not end"
            assert len(replies()) == 1
            return replies()[0]

    def perform(self, **degrees: float) -> ObservationReply:
        reply = self.end_of(self.submit(program(self.robot, **degrees)))
        assert isinstance(reply, ObservationReply), reply
        return reply

    def pulses(self) -> tuple[int, ...]:
        """The board's counts, once it has read everything that was written."""
        robot = self.robot
        assert robot.servo_board.wait_until_read(robot.servos.bytes_written, 10)
        return robot.servo_board.pulses()

    def state(self) -> str:
        return self.robot.controller.snapshot().state

    def ok(self, request: Hold | Relax | Stop | Clear) -> Ok:
        reply = self.end_of(self.submit(request))
        assert isinstance(reply, Ok), reply
        return reply


def program(robot: StillRobot, **degrees: float) -> Perform:
    angles = {joint.name: 0.0 for joint in robot.config.joints}
    angles |= {name: value * 3.141592653589793 / 180 for name, value in degrees.items()}
    return Perform(id=1, client="test", session="s", targets=angles)


def request(kind: type[Hold | Relax | Stop | Clear | Read]) -> Hold | Relax | Stop | Clear | Read:
    return kind(id=1, client="test", session="s")


def hip(bench: Bench) -> float:
    """The commanded angle of the first joint, degrees, from the board's own counts."""
    joint = bench.robot.config.joints[0]
    return math.degrees(joint.scale.angle(bench.pulses()[joint.output - 1]))


def shake(bench: Bench, *, at_zero: bool) -> None:
    """Makes the tilt swing: always, or only while the first joint is not at zero."""

    class Shaking(list[float]):
        def __getitem__(self, channel: Any) -> Any:
            angle = bench.robot.controller.snapshot().angles["hip_left"]
            shakes = channel == 0 and (at_zero or abs(angle) > math.radians(1))
            swing = 0.05 if shakes and int(bench.clock.now() * 25) % 2 else 0.0
            return super().__getitem__(channel) + swing

    bench.robot.world.volts = Shaking(bench.robot.world.volts)
