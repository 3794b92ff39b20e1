"""Real processes, really killed: what the robot does, and what the controller is told."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
import time

import pytest

from bench.daemons import simulator
from bench.network_proxy import lasting_port
from protocol.errors import RobotError, RobotRestartedError, RobotUnreachableError
from protocol.transport.client import RobotClient
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.messages import ObservationReply, Progress
from sim_robot.world.simulation import ENGINES


def program(client: RobotClient, **degrees: float) -> dict[str, float]:
    angles = {joint.name: 0.0 for joint in client.capabilities.joints}
    return angles | {name: math.radians(value) for name, value in degrees.items()}


def felt(seen: ObservationReply) -> tuple[object, ...]:
    return seen.angles, seen.touch, seen.tilt, seen.clearance


def test_the_same_seed_feels_the_same_and_another_does_not() -> None:
    readings = []
    for seed in ("5", "5", "6"):
        with simulator("--seed", seed) as robot, RobotClient(robot.uri) as client:
            client.acquire()
            client.perform(program(client, hip_left=20))
            readings.append(felt(client.perform(program(client, hip_left=-20, hip_back=-10))))
    assert readings[0] == readings[1]
    assert readings[0] != readings[2]


@pytest.mark.parametrize("engine", ENGINES)
def test_an_observation_is_what_the_world_is_within_noise(engine: str) -> None:
    pytest.importorskip(engine)
    options = ("--noise", "none", "--engine", engine)
    with simulator(*options) as robot, RobotClient(robot.uri) as client:
        client.acquire()
        seen = client.perform(
            program(client, hip_left=-30, hip_front=-30, hip_right=-30, hip_back=-30)
        )
    assert seen.touch == (True,) * 4
    assert seen.tilt == pytest.approx((0, 0), abs=math.radians(0.5))
    # Hips at 42.5 mm, feet of 6 mm at 214 mm from the hips; half a count is 0.34°.
    expected = 0.214 * math.sin(-seen.angles["hip_left"]) + 0.006 - 0.0425
    assert seen.clearance == pytest.approx(expected, abs=0.002)
    assert seen.settled
    assert not seen.saturated_joints


def test_a_second_controller_is_told_who_holds_it() -> None:
    with (
        simulator() as robot,
        RobotClient(robot.uri, client_id="first") as first,
        RobotClient(robot.uri, client_id="second") as second,
    ):
        first.acquire()
        with pytest.raises(RobotError, match="first") as refused:
            second.acquire()
        assert refused.value.code == "held"
        with pytest.raises(RobotError) as refused:
            second.perform(program(second))
        assert refused.value.code == "not_controller"
        second.stop()  # is for everybody
        with pytest.raises(RobotError) as refused:
            first.perform(program(first))
        assert refused.value.code == "stopped"
        first.clear()
        first.perform(program(first))


def test_wrong_targets_are_refused() -> None:
    with simulator() as robot, RobotClient(robot.uri) as client:
        client.acquire()
        for targets, code in (
            (program(client) | {"hip_left": 2.0}, "out_of_range"),
            (program(client) | {"wing": 0.0}, "bad_targets"),
            ({"hip_left": 0.1}, "bad_targets"),
        ):
            with pytest.raises(RobotError) as refused:
                client.perform(targets)
            assert refused.value.code == code


def test_a_restarted_daemon_does_not_repeat_a_move() -> None:
    bind = f"tcp://127.0.0.1:{lasting_port()}"
    with simulator(bind=bind) as robot, RobotClient(bind, timeout=120) as client:
        client.acquire()
        client.perform(program(client, hip_left=10))
        robot.kill()
        with simulator(bind=bind):
            with pytest.raises(RobotRestartedError, match="restarted"):
                client.perform(program(client, hip_left=20))
            client.hello()
            assert client.status().sequence == 0  # nothing was performed
            client.acquire()
            client.perform(program(client, hip_left=20))


def test_nothing_listens() -> None:
    with pytest.raises(RobotUnreachableError, match="127"):
        RobotClient("tcp://127.0.0.1:9", timeout=0.5)


CONTROLLER = """
import math, sys
from protocol.transport.client import RobotClient
from protocol.transport.telemetry import TelemetrySubscriber
client = RobotClient(sys.argv[1])
client.acquire()
targets = {joint.name: 0.0 for joint in client.capabilities.joints}
targets["hip_left"] = math.radians(-90)
client.perform(targets, on_progress=lambda progress: print(progress.phase, flush=True))
"""


def test_a_killed_controller_leaves_a_holding_robot() -> None:
    with simulator("--real-time") as robot:
        controller = subprocess.Popen(
            [sys.executable, "-c", CONTROLLER, robot.uri], stdout=subprocess.PIPE, text=True
        )
        with RobotClient(robot.uri) as viewer:
            assert controller.stdout is not None
            for line in controller.stdout:
                if line.strip() == "moving":
                    break
            controller.kill()
            controller.communicate()
            # 1.5 s of motion go on; the silence of 5 s is noticed long after. What counts is that
            # the robot is not limp, and that nobody else is let in before 30 s.
            with TelemetrySubscriber(viewer.telemetry_endpoint) as telemetry:
                while telemetry.next(timeout=120).state != "holding":
                    pass
            assert viewer.status().controller is not None
            with pytest.raises(RobotError) as refused:
                viewer.acquire()
            assert refused.value.code == "held"


def test_stop_from_a_viewer_freezes_a_moving_robot() -> None:
    moving = threading.Event()
    ended: list[RobotError] = []

    def watch(progress: Progress) -> None:
        if progress.phase == "moving":
            moving.set()

    def control(client: RobotClient) -> None:
        try:
            client.perform(program(client, hip_left=-90), on_progress=watch)
        except RobotError as error:
            ended.append(error)

    with (
        simulator("--real-time") as robot,
        RobotClient(robot.uri) as controller,
        RobotClient(robot.uri) as viewer,
    ):
        controller.acquire()
        thread = threading.Thread(target=control, args=(controller,))
        thread.start()
        assert moving.wait(120)
        viewer.stop()
        thread.join(120)
        assert [error.code for error in ended] == ["aborted_stop"]
        assert viewer.status().state == "stopped"
        controller.clear()
        assert -math.radians(89) < controller.read().angles["hip_left"] < 0


def test_sigterm_parks_and_leaves() -> None:
    with simulator("--real-time") as robot:
        with RobotClient(robot.uri) as client:
            client.acquire()
            client.perform(program(client, hip_left=-40))
        start = time.monotonic()
        code, output = robot.terminate()
        assert time.monotonic() - start < 30
    assert code == 0
    assert output == ""  # PyBullet's chatter stays out


def test_a_body_that_fell_stays_down_without_an_operator() -> None:
    with simulator("--no-operator", "--noise", "none") as robot, RobotClient(robot.uri) as client:
        client.acquire()
        client.perform(program(client, hip_left=-30))
        flat = client.perform(program(client))
        assert flat.clearance == pytest.approx(0, abs=2e-3)
