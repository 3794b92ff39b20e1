"""The clients of the robot in a soak: what they do, and the invariants that are checked."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack

from bench.daemons import Sample, Simulator, take_sample
from bench.network_proxy import MessageProxy, TcpProxy, Weather
from protocol.errors import RobotError, RobotUnreachableError
from protocol.transport.client import RobotClient
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.messages import ObservationReply
from sim_robot.faults.control_socket import FaultClient
from sim_robot.simulator.electronics_sets import SETS
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

VIEWERS = 4
WEATHER = Weather(loss=0.05, duplication=0.2, jitter=0.02)


def _of(device: str, faults: str) -> list[str]:
    return [f"{device}.{fault}" for fault in faults.split()]


EVERYWHERE = (
    *_of("servos", "dead=3 swapped=2"),
    *_of("distance", "nak hang busy frozen reset rescaled unheard=20"),
    "i2c.unplugged",
    *_of("clock", "jump=10 jump=-10"),
)
ON_THE_BUS = (
    *_of("adc", "nak busy railed_channel=2 reset comparing nak=20"),
    *_of("accelerometer", "nak stuck_axis=1 railed_axis=2 reset sleep reranged nak=20"),
)
OF_SERVOS = """
unplugged drop=43 corrupt=47 garbage=5 lost=5 silent=2 twin=3 hot=5 dip wheel_mode=6 reboot
reboot=4 overload=4 moved=3
"""
OF_PWM = """
nak nak=3 unheard=3 hang lost=5 reset sleep doze prescale=60 mode2=20 moved=3 full_on=2 all_off
"""
OF_DAQ = "absent stuck_wait stuck_busy overflow lost_sample stuck_channel=1 railed_channel=4"
FAULTS = {
    "pc104": (
        *EVERYWHERE,
        *_of("servo_board", "unplugged drop=43 corrupt=47 garbage=5 mute brown_out moved=3"),
        *_of("daq", OF_DAQ),
    ),
    "pi": (*EVERYWHERE, *_of("pwm", OF_PWM), *ON_THE_BUS),
    **{
        family: (*EVERYWHERE, *ON_THE_BUS, *_of(family, OF_SERVOS))
        for family in ("feetech", "dynamixel")
    },
}
ALTERING = frozenset(
    fault
    for faults in FAULTS.values()
    for fault in faults
    if fault.startswith(
        ("servo_board.brown", "servo_board.moved", "pwm.", "feetech.", "dynamixel.")
    )
    and not fault.startswith(("pwm.nak", "pwm.hang", "pwm.lost"))
)
"""Faults that give servos other pulses than they were commanded to have."""


class InvariantBroken(Exception):  # noqa: N818 - a finding
    """Something happened that must never happen."""


class Crowd:
    """All clients of one robot.

    Args:
        robot: The daemon.
        seed: Seed that decides what is tried.
        electronics: Name of the robot's set of electronics.
    """

    def __init__(self, robot: Simulator, seed: int, electronics: str):
        self.counts: Counter[str] = Counter()
        self.samples: list[Sample] = []
        self._robot = robot
        self._random = random.Random(seed)
        body = load_body(default_body_path())
        joints = SETS[electronics].configure(body, NoiseLevels()).joints
        self._breaks = FAULTS[electronics]
        self._scales = {joint.name: joint.scale for joint in joints}
        self._last: ObservationReply | None = None
        self._generation = 0

    def run(
        self, hours: float, *, every: float, deaths: int, tell: Callable[[Sample], None]
    ) -> None:
        """Does random things for a while, and checks each.

        Args:
            hours: Duration, virtual hours.
            every: Virtual hours from one sample to the next.
            deaths: How often a controller is lost, which takes 30 s of real time each.
            tell: Called with each sample.

        Raises:
            InvariantBroken: A check failed.
        """
        with ExitStack() as stack:
            self._faults = FaultClient(self._robot.control)
            self._viewers = [
                stack.enter_context(RobotClient(self._robot.uri)) for _ in range(VIEWERS)
            ]
            telemetry = self._viewers[0].telemetry_endpoint
            for _ in range(VIEWERS):
                stack.enter_context(TelemetrySubscriber(telemetry))
            self._enter()
            stack.push(lambda *_: self._client.close())  # whichever client it is by then
            due = 0.0
            death = hours / (deaths + 1)
            while (now := self._hours()) < hours:
                if now >= due:
                    self.samples.append(take_sample(self._robot.process, self._viewers[0], now))
                    tell(self.samples[-1])
                    due = now + every
                if now >= death:
                    death += hours / (deaths + 1)
                    self._die()
                self._act()
            self.samples.append(take_sample(self._robot.process, self._viewers[0], now))
            tell(self.samples[-1])

    # --- actions ----------------------------------------------------------------------------------

    def _act(self) -> None:
        actions = {
            self._perform: 70.0,
            self._perform_again: 4,
            self._read: 4,
            self._stop: 4,
            self._interrupt: 4,
            self._relax: 3,
            self._nonsense: 4,
            self._fail: 4,
            self._change: 2,
            self._bad_network: 0.2,
        }
        (action,) = self._random.choices(list(actions), list(actions.values()))
        self.counts[action.__name__.lstrip("_")] += 1
        action()

    def _targets(self) -> dict[str, float]:
        joints = self._client.capabilities.joints
        return {
            joint.name: self._random.uniform(max(-0.6, joint.lower), min(0.6, joint.upper))
            for joint in joints
        }

    def _perform(self) -> None:
        self._take(self._once(self._targets(), self._client.reserve_id()))

    def _perform_again(self) -> None:
        """Repeats a request under its id: the first answer comes again, and nothing moves."""
        number, targets = self._client.reserve_id(), self._targets()
        reply = self._once(targets, number)
        self._take(reply)
        interactions = self._faults.report()["interactions"]
        self._demand(self._client.perform(targets, request_id=number) == reply, "not the first")
        self._demand(self._faults.report()["interactions"] == interactions, "carried out twice")

    def _read(self) -> None:
        self._take(self._random.choice([self._client, *self._viewers]).read())

    def _stop(self) -> None:
        self._random.choice(self._viewers).stop()
        self._refused("stopped", lambda: self._client.perform(self._targets()))
        self._client.clear()

    def _interrupt(self) -> None:
        """A stop, a hold or a relax meets a motion somewhere."""
        ends: list[ObservationReply | RobotError] = []
        targets = self._targets()

        def move() -> None:
            try:
                ends.append(self._client.perform(targets))
            except RobotError as error:
                ends.append(error)

        kind = self._random.choice(("stop", "hold", "relax"))
        thread = threading.Thread(target=move)
        thread.start()
        time.sleep(self._random.uniform(0, 0.05))
        getattr(self._client, kind)()
        thread.join()
        (end,) = ends
        if isinstance(end, ObservationReply):
            self._take(end, stiff=kind != "relax")
        else:
            expected = (f"aborted_{kind}", "stopped", "wrong_state")
            self._demand(end.code in expected, f"{kind} ended a motion with {end}")
            self.counts["interrupted"] += 1
        self._client.clear()
        self._client.hold()

    def _relax(self) -> None:
        self._client.relax()
        self._demand(set(self._faults.report()["pulses"]) == {0}, "not limp")
        self._take(self._client.read(), stiff=False)
        self._refused("wrong_state", lambda: self._client.perform(self._targets()))
        self._client.hold()

    def _nonsense(self) -> None:
        targets = self._targets()
        self._refused("bad_targets", lambda: self._client.perform({"wing": 0.0}))
        self._refused("out_of_range", lambda: self._client.perform(targets | {"hip_left": 9.0}))
        viewer = self._random.choice(self._viewers)
        self._refused("not_controller", lambda: viewer.perform(targets))
        self._refused("held", viewer.acquire)

    def _fail(self) -> None:
        """Something breaks, at once or within the next motion, and is mended."""
        fault = self._random.choice(self._breaks)
        start = self._faults.report()["robot_time"] + self._random.uniform(0, 3)
        self._faults.inject(f"{fault}@{start:.3f}s" if self._random.random() < 0.7 else fault)
        altered = False
        for _ in range(2):
            try:
                reply = self._client.perform(self._targets())
            except RobotError as error:
                self._demand(error.code == "fault", f"{fault} ended with {error}")
                self.counts["faults noticed"] += 1
                self._refused("fault", self._client.read)
                altered = False
                break
            self._demand(not altered, "a board that was altered is not noticed")
            # What is altered after a board's last answer in a motion shows in the next one only.
            pulses = self._faults.report()["pulses"]
            altered = fault in ALTERING and pulses != self._commanded(reply)
            self._take(reply, stiff=not altered)
        if altered:
            self._refused("fault", lambda: self._client.perform(self._targets()))
        self._faults.mend()
        for viewer in self._viewers:
            viewer.status()
        while self._client.status().state == "fault":
            try:
                self._client.clear()
            except RobotError as error:  # for instance a sample that was still stuck
                self._demand(error.code == "fault", f"clear ended with {error}")
        self._perform()

    def _change(self) -> None:
        """Another controller takes over, under another name."""
        self._client.close()
        self._enter()

    def _bad_network(self) -> None:
        self._client.close()
        with MessageProxy(self._robot.uri, seed=self._random.randrange(2**32)) as proxy:
            self._enter(proxy.endpoint, timeout=1.5)
            proxy.weather = WEATHER
            for _ in range(3):
                self._perform()
            proxy.weather = Weather()
            self._client.close()
            self.counts["messages lost"] += proxy.fates.lost
            self.counts["messages doubled"] += proxy.fates.doubled
        self._enter()

    def _die(self) -> None:
        """The controller's network goes down for good; another takes over when it may."""
        self.counts["controllers lost"] += 1
        self._client.close()
        with TcpProxy(self._robot.uri) as proxy:
            self._enter(proxy.endpoint, timeout=1.0)
            proxy.cut()
            self._client.close()
        with RobotClient(self._robot.uri) as heir:
            deadline = time.monotonic() + 60
            while True:
                try:
                    heir.acquire()
                    break
                except RobotError as error:
                    self._demand(error.code == "held", str(error))
                self._demand(time.monotonic() < deadline, "a dead controller is not let go")
                time.sleep(0.5)
        self._enter()

    # --- checks -----------------------------------------------------------------------------------

    def _enter(self, uri: str | None = None, timeout: float = 10.0) -> None:
        self._generation += 1
        self._client = RobotClient(
            uri or self._robot.uri, client_id=f"controller-{self._generation}", timeout=timeout
        )
        self._client.acquire()

    def _once(self, targets: Mapping[str, float], number: int) -> ObservationReply:
        """Performs one motion, and not more, however often it must be asked for."""
        before = self._faults.report()["interactions"]
        while True:
            try:
                reply = self._client.perform(targets, request_id=number)
                break
            except RobotUnreachableError:  # only on a bad network: ask again, under the same id
                self.counts["asked again"] += 1
        after = self._faults.report()["interactions"]
        self._demand(after == before + 1, f"{after - before} interactions for one request")
        return reply

    def _take(self, seen: ObservationReply, *, stiff: bool = True) -> None:
        last = self._last
        self._last = seen
        self.counts["observations"] += 1
        pulses = self._faults.report()["pulses"]
        if stiff:
            commanded = self._commanded(seen)
            self._demand(pulses == commanded, f"commanded {commanded}, but the board has {pulses}")
        if last is not None:
            self._demand(seen.sequence == last.sequence + 1, "an observation lost or repeated")
            self._demand(seen.robot_time > last.robot_time, "robot time does not grow")
            self._demand(seen.monotonic > last.monotonic, "an observation is old")
            repeated = (seen.tilt, seen.clearance) == (last.tilt, last.clearance)
            self._demand(not repeated, "a reading repeated")

    def _commanded(self, seen: ObservationReply) -> list[int]:
        """The counts of an observation's angles."""
        return [self._scales[name].count(angle) for name, angle in seen.angles.items()]

    def _refused(self, code: str, ask: Callable[[], object]) -> None:
        try:
            ask()
        except RobotError as error:
            self._demand(error.code == code, f"{code} was expected, not {error}")
        else:
            raise InvariantBroken(f"{code} was expected, and nothing was refused")

    def _demand(self, holds: bool, sentence: str) -> None:
        if not holds:
            log = "".join(self._robot.log[-5:])
            raise InvariantBroken(f"{sentence}; at {self._last}; log: {log}")

    def _hours(self) -> float:
        return float(self._faults.report()["robot_time"]) / 3600
