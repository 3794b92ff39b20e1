"""A bad network between robot and controller, and faults ordered on the command line."""

from __future__ import annotations

import math
import random
import time
from contextlib import suppress

import pytest

from bench.daemons import simulator
from bench.network_proxy import MessageProxy
from protocol.errors import RobotError, RobotUnreachableError
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply
from sim_robot.command_line import main
from sim_robot.faults.control_socket import FaultClient
from tests.faults.matrix import NETWORK, WeatherRow

PROGRAMS = 4


def perform(client: RobotClient, degrees: dict[str, float]) -> ObservationReply:
    """Asks for one motion until it is answered, as a program that wrote its id down would."""
    angles = {joint.name: 0.0 for joint in client.capabilities.joints}
    angles |= {name: math.radians(value) for name, value in degrees.items()}
    request_id = client.reserve_id()
    for _ in range(20):
        try:
            return client.perform(angles, request_id=request_id)
        except RobotUnreachableError:
            continue
    raise AssertionError("the network lets nothing through")


def measured(observation: ObservationReply) -> tuple[object, ...]:
    return (
        observation.sequence,
        observation.angles,
        observation.touch,
        observation.tilt,
        observation.clearance,
    )


@pytest.fixture(scope="module")
def programs() -> list[dict[str, float]]:
    rng = random.Random(7)
    hips = ("hip_left", "hip_front", "hip_right", "hip_back")
    return [{hip: rng.uniform(-30, 30) for hip in hips} for _ in range(PROGRAMS)]


@pytest.fixture(scope="module")
def expected(programs: list[dict[str, float]]) -> list[tuple[object, ...]]:
    """What a robot with the same seed reads on a good network."""
    with simulator("--seed", "3") as robot, RobotClient(robot.uri) as client:
        client.acquire()
        return [measured(perform(client, degrees)) for degrees in programs]


@pytest.mark.parametrize("row", [pytest.param(row, id=row.fault) for row in NETWORK])
def test_each_request_is_carried_out_once(
    row: WeatherRow,
    programs: list[dict[str, float]],
    expected: list[tuple[object, ...]],
) -> None:
    with (
        simulator("--seed", "3", "--control", "tcp://127.0.0.1:*") as robot,
        MessageProxy(robot.uri) as proxy,
        RobotClient(proxy.endpoint, timeout=1.5) as client,
    ):
        faults = FaultClient(robot.control)
        client.acquire()
        proxy.weather = row.weather
        # The noise is drawn by the number of the interaction: one that was done twice would show.
        assert [measured(perform(client, degrees)) for degrees in programs] == expected
        assert faults.report()["interactions"] == PROGRAMS
        fates = proxy.fates
        assert bool(fates.lost) == bool(row.weather.loss)
        assert bool(fates.doubled) == bool(row.weather.duplication)
        assert bool(fates.overtaken) == bool(row.weather.jitter)
        proxy.weather = type(row.weather)()
        assert client.status().state == row.state
        assert client.status().controller == client.client_id


def test_a_fault_comes_in_its_interaction_and_goes_by_itself() -> None:
    options = ("--fault", "daq.stuck_wait@2i+0.3w", "--fault", "servos.dead=1@9i")
    with simulator(*options) as robot, RobotClient(robot.uri) as client:
        client.acquire()
        flat = {joint.name: 0.0 for joint in client.capabilities.joints}
        assert client.perform(flat).settled
        with pytest.raises(RobotError, match="WAIT") as down:
            client.perform(flat)
        assert down.value.code == "fault"
        deadline = time.monotonic() + 120
        while client.status().state == "fault":  # which ends by the clock on the wall
            assert time.monotonic() < deadline
            with suppress(RobotError):
                client.clear()
        assert client.perform(flat).sequence == 2


@pytest.mark.parametrize("fault", ["daq.stuk_wait", "daq", "servo_board.brown_out+1s"])
def test_a_fault_that_cannot_be_is_refused_before_anything_starts(
    fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--fault", fault])
    assert ended.value.code == 2
    assert "argument --fault" in capsys.readouterr().err
