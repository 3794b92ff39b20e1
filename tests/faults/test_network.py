"""Bad networks between a client and a real ``sim-robotd``: nothing lost, nothing done twice."""

from __future__ import annotations

import math
import random

import pytest

from bench.daemons import simulator
from bench.network_proxy import MessageProxy
from protocol.errors import RobotUnreachableError
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply
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


def felt(seen: ObservationReply) -> tuple[object, ...]:
    return seen.sequence, seen.angles, seen.touch, seen.tilt, seen.clearance


@pytest.fixture(scope="module")
def programs() -> list[dict[str, float]]:
    rng = random.Random(7)
    hips = ("hip_left", "hip_front", "hip_right", "hip_back")
    return [{hip: rng.uniform(-30, 30) for hip in hips} for _ in range(PROGRAMS)]


@pytest.fixture(scope="module")
def expected(programs: list[dict[str, float]]) -> list[tuple[object, ...]]:
    """What a robot with the same seed feels on a good network."""
    with simulator("--seed", "3") as robot, RobotClient(robot.uri) as client:
        client.acquire()
        return [felt(perform(client, degrees)) for degrees in programs]


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
        assert [felt(perform(client, degrees)) for degrees in programs] == expected
        assert faults.report()["interactions"] == PROGRAMS
        fates = proxy.fates
        assert bool(fates.lost) == bool(row.weather.loss)
        assert bool(fates.doubled) == bool(row.weather.duplication)
        assert bool(fates.overtaken) == bool(row.weather.jitter)
        proxy.weather = type(row.weather)()
        assert client.status().state == row.state
        assert client.status().controller == client.client_id
