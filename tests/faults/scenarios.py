"""Real processes, really cut off, stopped and killed, on a servo board that outlives them."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Final

import pytest

from bench.network_proxy import TcpProxy, lasting_port
from protocol.errors import RobotError, RobotRestartedError
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply
from tests.faults.matrix import PROCESSES
from tests.faults.motions import (
    DAEMON,
    FAR,
    ZERO,
    Motion,
    check,
    controller,
    daemon,
    pulses_at_last,
    servo_board,
    wait_for_motion,
    wait_until,
)


def connections_reset() -> None:
    """A router restarts."""
    with (
        servo_board() as board,
        daemon(board) as robot,
        TcpProxy(robot.uri) as proxy,
        controller(proxy.endpoint) as client,
    ):
        with Motion(client) as motion:
            wait_for_motion(board)
            proxy.cut()
            time.sleep(1)
            proxy.mend()
        status = client.status()
        check("cut", motion.end, status)
        assert isinstance(motion.end, ObservationReply)
        assert math.degrees(motion.end.angles["hip_left"]) == pytest.approx(FAR, abs=0.4)
        assert motion.end.sequence == status.sequence == 1


def cable_pulled() -> None:
    """Longer than a controller may be silent."""
    with (
        servo_board() as board,
        daemon(board, speed=10) as robot,
        TcpProxy(robot.uri) as proxy,
        controller(proxy.endpoint) as client,
        RobotClient(robot.uri) as viewer,
    ):
        with Motion(client) as motion:
            wait_for_motion(board)
            proxy.pull()
            pulled = time.monotonic()
            wait_until(lambda: viewer.status().state == "holding")
            assert time.monotonic() - pulled > 3  # the last heartbeat was up to 1 s before
            status = viewer.status()
            assert "silent" in (status.reason or "")
            assert status.controller == client.client_id
            held = board.pulses()
            assert 0 not in held
            time.sleep(0.3)
            assert board.pulses() == held
            proxy.mend()
        check("pulled", motion.end, status)
        reading = client.read()
        assert reading.sequence == 1
        assert -85 < math.degrees(reading.angles["hip_left"]) < -25


CONTROLLER: Final = """
import sys
from protocol.transport.client import RobotClient
client = RobotClient(sys.argv[1])
client.acquire()
client.perform({joint.name: 0.0 for joint in client.capabilities.joints} | {"hip_left": -1.5})
"""


def controller_killed() -> None:
    """In mid-motion."""
    with (
        servo_board() as board,
        daemon(board, speed=10) as robot,
        RobotClient(robot.uri) as viewer,
    ):
        process = subprocess.Popen([sys.executable, "-c", CONTROLLER, robot.uri])
        wait_for_motion(board)
        process.kill()
        process.wait()
        assert viewer.status().state == "moving"
        wait_until(lambda: viewer.status().state == "holding")
        assert "silent" in (viewer.status().reason or "")
        with pytest.raises(RobotError) as refused:
            viewer.acquire()
        check("death", refused.value, viewer.status())
        held = board.pulses()
        assert viewer.stop().state == "stopped"
        assert board.pulses() == held
        assert 0 not in held


def sigterm() -> None:
    """A service manager stops the daemon in mid-motion."""
    with servo_board() as board, daemon(board) as robot, controller(robot.uri) as client:
        with Motion(client) as motion:
            wait_for_motion(board)
            start = time.monotonic()
            code, _ = robot.terminate()
            assert time.monotonic() - start < 30
        assert code == 0
        check("term", motion.end)
        assert board.pulses() == ZERO  # parked


def sigkill() -> None:
    """The daemon dies in mid-motion and is started again."""
    bind = f"tcp://127.0.0.1:{lasting_port()}"
    with (
        servo_board() as board,
        daemon(board, bind=bind) as first,
        controller(first.uri) as client,
        Motion(client) as motion,
    ):
        wait_for_motion(board)
        first.kill()
        held = pulses_at_last(board)
        assert 0 not in held
        with daemon(board, bind=bind) as second:
            # The client finds out by itself, and repeats nothing.
            wait_until(lambda: motion.end is not None)
            assert isinstance(motion.end, RobotRestartedError)
            client.hello()
            status = client.status()
            assert (status.state, status.sequence) == (PROCESSES["kill"].state, 0)
            assert board.pulses() == held
            client.acquire()
            counts = [held[0]]
            with Motion(client, 0.0) as home:
                while home.end is None:
                    counts.append(board.pulses()[0])
                    time.sleep(0.01)
            check("kill", home.end)
            # It slews from where the board stood: 60°/s is 88 counts a second.
            assert max(abs(b - a) for a, b in pairwise(counts)) < 45
            second.kill()


def computer_stands_still() -> None:
    """Suspended, swapping or stopped, in mid-motion."""
    with servo_board() as board, daemon(board, 30) as robot, controller(robot.uri) as client:
        with Motion(client) as motion:
            wait_for_motion(board)
            robot.send(signal.SIGSTOP)
            time.sleep(0.2)
            held = board.pulses()
            time.sleep(2.3)
            robot.send(signal.SIGCONT)
        check("stall", motion.end, client.status())
        assert abs(board.pulses()[0] - held[0]) < 20  # 2.5 s would have been 110 counts
        assert client.clear().state == "holding"
        with Motion(client, -20.0) as again:
            pass
        assert isinstance(again.end, ObservationReply)


JUMPING: Final = """
import time
_true, _calls = time.time, [0]
def jumping():
    _calls[0] += 1
    return _true() + (-1) ** _calls[0] * 3600.0 * _calls[0]
time.time = jumping
"""


def date_set() -> None:
    """Forwards and backwards, all the time."""
    with tempfile.TemporaryDirectory() as folder, servo_board() as board:
        (Path(folder) / "sitecustomize.py").write_text(JUMPING, encoding="utf-8")
        path = os.pathsep.join([folder, os.getcwd()])
        with daemon(board, environment={"PYTHONPATH": path}) as robot:
            with controller(robot.uri) as client:
                with Motion(client, -20.0) as motion:
                    pass
                check("date", motion.end, client.status())
            robot.terminate()
            hours = {line[:13] for line in robot.log if line[:2] == "20"}
            assert len(hours) > 1  # the log shows that the date did jump


def disk_full() -> None:
    """No log line can be written."""
    bind = f"tcp://127.0.0.1:{lasting_port()}"
    with servo_board() as board:
        with open("/dev/full", "w", encoding="utf-8") as full:
            process = subprocess.Popen(
                [sys.executable, "-m", DAEMON, "--bind", bind, "--port", board.port],
                stdout=full,
                stderr=full,
            )
        try:
            with controller(bind) as client:
                with Motion(client, -20.0) as motion:
                    pass
                check("disk", motion.end, client.status())
                process.terminate()
                process.wait(120)
        finally:
            process.kill()
            process.wait()
        assert board.pulses() == ZERO


WORKSTATION: Final = """
import resource, sys
from pathlib import Path
from estimator.identification.loop import carry_out
from estimator.identification.method import Listener
from estimator.storage.records import InteractionRecord
from estimator.storage.run_config import RunSettings
from estimator.identification.robot_link import WireLink
from estimator.storage.store import RunStore, first_id
uri, folder = sys.argv[1:]
link = WireLink(uri, client_id="workstation", first_id=first_id(0))
settings = RunSettings(
    robot=uri, problem="legs", problem_text="", method="paper", physics="pybullet",
    reference="pybullet", explore="random", search="deterministic-crowding", objective="largest",
    modalities=("tilt",), seed=1, interactions=1, population=4, generations=1,
)
planned = InteractionRecord(program=(-1.0,) * 8)
with RunStore.create(Path(folder), settings, link.capabilities, "workstation") as store:
    store.plan(0, planned.program)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    carry_out(link, 0, planned, lambda ticket: store.ask(0, ticket), Listener())
"""


def workstation_full() -> None:
    """The estimator cannot write down what it is about to ask."""
    with (
        tempfile.TemporaryDirectory() as folder,
        servo_board() as board,
        daemon(board) as robot,
        RobotClient(robot.uri) as viewer,
    ):
        before = board.pulses()
        done = subprocess.run(
            [sys.executable, "-c", WORKSTATION, robot.uri, folder],
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=300,
        )
        assert done.returncode == 1
        assert "sqlite3" in done.stderr.splitlines()[-1], done.stderr
        status = viewer.status()
        assert (status.state, status.sequence) == (PROCESSES["workstation"].state, 0)
        assert board.pulses() == before


def brown_out_unasked() -> None:
    """Between requests, housekeeping finds it."""
    with servo_board() as board, daemon(board) as robot, controller(robot.uri) as client:
        with Motion(client, -20.0):
            pass
        board.power_cycle()
        found_unasked("unasked", client)


def adapter_renamed() -> None:
    """Between requests, and what was /dev/pts/5 is /dev/pts/6 now."""
    with servo_board() as board, daemon(board) as robot, controller(robot.uri) as client:
        with Motion(client, -20.0):
            pass
        before, held = os.readlink(board.port), board.pulses()
        board.unplug()
        squatters = os.openpty()  # takes the name that has become free
        board.replug()
        assert os.readlink(board.port) != before
        found_unasked("renamed", client)
        for end in squatters:
            os.close(end)
        assert board.pulses() == held


def found_unasked(name: str, client: RobotClient) -> None:
    """Housekeeping finds it within 3 s, says so, and a clear brings the robot back."""
    broken = time.monotonic()
    wait_until(lambda: client.status().state == "fault")
    assert time.monotonic() - broken < 30
    row, status = PROCESSES[name], client.status()
    assert status.state == row.state
    assert row.words in (status.reason or "")
    with pytest.raises(RobotError) as refused:
        client.read()
    assert refused.value.code == row.code
    client.clear()
    with Motion(client, -20.0) as motion:
        pass
    assert isinstance(motion.end, ObservationReply)


def sick_driver(name: str, order: str) -> None:
    """A driver hangs or dies in mid-motion, is stopped meanwhile, and works again."""
    method = order.partition(".")[2].partition("=")[0]
    with tempfile.TemporaryDirectory() as folder, servo_board() as board:
        sick = Path(folder) / "sick"
        options = ("--sick", order, "--sick-while", str(sick))
        with (
            daemon(board, 30, *options) as robot,
            controller(robot.uri) as client,
            RobotClient(robot.uri) as other,
        ):
            with Motion(client, -45.0) as motion:
                wait_for_motion(board)
                sick.touch()
                wait_until(lambda: method in (other.status().reason or ""))
                code = answer_to_stop(other)
                assert (code == "not_confirmed") == order.endswith("=hang")
            check(name, motion.end, other.status())
            held = board.pulses()
            assert 0 not in held
            with pytest.raises(RobotError) as refused:
                client.clear()
            assert refused.value.code == "fault"
            sick.unlink()
            wait_until(lambda: answer_to_stop(other) == "fault")
            assert client.clear().state == "holding"
            assert max(abs(a - b) for a, b in zip(board.pulses(), held, strict=True)) <= 1
            with Motion(client, -20.0) as motion:
                pass
            assert isinstance(motion.end, ObservationReply)


def answer_to_stop(client: RobotClient) -> str:
    """The state or the error code that a stop is answered with, within 250 ms.

    On a computer that has no time for its processes, it is asked again.
    """
    for _ in range(5):
        begun = time.monotonic()
        try:
            answer = client.stop().state
        except RobotError as error:
            answer = error.code
        if time.monotonic() - begun < 0.25:
            return answer
    raise AssertionError("no stop was answered within 250 ms")


def sigterm_while_hanging() -> None:
    """A service manager stops a daemon whose driver does not return."""
    with tempfile.TemporaryDirectory() as folder, servo_board() as board:
        sick = Path(folder) / "sick"
        options = ("--sick", "servos.set_counts=hang", "--sick-while", str(sick))
        with daemon(board, 60, *options) as robot, controller(robot.uri) as client:
            with Motion(client) as motion:
                wait_for_motion(board)
                sick.touch()
                wait_until(lambda: "does not return" in (client.status().reason or ""))
                code, _ = robot.terminate(timeout=30)
            assert code == 1
            assert "The control loop did not end as it should" in robot.log[-1], robot.log
            check("hanging at the end", motion.end)
            assert 0 not in board.pulses()


SCENARIOS: Final[Mapping[str, Callable[[], None]]] = MappingProxyType(
    {
        "cut": connections_reset,
        "pulled": cable_pulled,
        "death": controller_killed,
        "term": sigterm,
        "kill": sigkill,
        "stall": computer_stands_still,
        "date": date_set,
        "disk": disk_full,
        "workstation": workstation_full,
        "unasked": brown_out_unasked,
        "renamed": adapter_renamed,
        "hanging servos": partial(sick_driver, "hanging servos", "servos.set_counts=hang"),
        "hanging sensor": partial(sick_driver, "hanging sensor", "accelerometer.acceleration=hang"),
        "hanging at the end": sigterm_while_hanging,
        "dying servos": partial(sick_driver, "dying servos", "servos.verify=SystemExit"),
        "dying sensor": partial(sick_driver, "dying sensor", "distance.distance=KeyboardInterrupt"),
    }
)
"""What is tried, by the names of the matrix."""
