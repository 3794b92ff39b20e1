"""Interactions of a simulated robot: repeated they read alike, and what is settled is at rest."""

from __future__ import annotations

import logging
import math
import random
from collections.abc import Iterator, Sequence

import pytest

from bench.daemons import simulator
from protocol import RobotClient
from protocol.wire.messages import ErrorReply, ObservationReply
from sim_robot.simulator.daemon import emulation, robot_on
from sim_robot.simulator.electronics_sets import SETS
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels
from tests.sim_robot.simulator.requests import Requests

BODY = load_body(default_body_path())
PROGRAMS = tuple(
    {motor.name: rng.uniform(-0.5, 0.5) for motor in BODY.motors}
    for rng in map(random.Random, (1, 4))
)


def measured(
    electronics: str, broken_off: Sequence[int], patch: pytest.MonkeyPatch
) -> list[object]:
    """Reads two interactions, the second broken off when the robot waits the n-th time."""
    log = logging.getLogger("test")
    with emulation(
        BODY, seed=8, levels=NoiseLevels(), real_time=False, log=log, electronics=electronics
    ) as parts:
        controller = robot_on(parts, log, operator=True)
        requests = Requests(controller)
        waits: Iterator[int] = iter(())
        sleep = parts.clock.sleep

        def counted(seconds: float) -> None:
            if next(waits, None) == 0:
                requests.stop()
            sleep(seconds)

        patch.setattr(parts.clock, "sleep", counted)
        controller.start()
        replies = [requests.perform(PROGRAMS[0])]
        for at in broken_off:
            waits = iter(range(at, -1, -1))
            end = requests.perform(PROGRAMS[1])
            assert isinstance(end, ErrorReply)
            assert end.code == "aborted_stop"
            requests.clear()
        replies.append(requests.perform(PROGRAMS[1]))
        controller.shut_down()
    return [
        (reply.angles, reply.touch, reply.tilt, reply.clearance)
        for reply in replies
        if isinstance(reply, ObservationReply)
    ]


@pytest.mark.parametrize("electronics", SETS)
def test_a_motion_that_was_broken_off_reads_the_same_when_it_is_made_again(
    electronics: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = measured(electronics, (), monkeypatch)
    assert len(expected) == len(PROGRAMS)
    for broken_off in ((3,), (20,), (60,), (70, 11)):
        assert measured(electronics, broken_off, monkeypatch) == expected


# Radians. PyBullet's body stands still in these poses for half a second, then tips over by 11° and
# 24°; a look back of 0.3 s called it settled before.
ON_AN_EDGE = (
    (0.053, 0.281, -0.013, -0.494, 0.324, -0.457, 0.314, -0.343),
    (-0.312, 0.139, -0.323, 0.398, -0.471, -0.412, 0.236, -0.196),
)


def test_what_is_settled_does_not_tip_over_afterwards() -> None:
    pytest.importorskip("pybullet")
    with (
        simulator("--noise", "none", "--engine", "pybullet") as robot,
        RobotClient(robot.uri) as client,
    ):
        client.acquire()
        names = [joint.name for joint in client.capabilities.joints]
        for pose in ON_AN_EDGE:
            observation = client.perform(dict(zip(names, pose, strict=True)))
            assert observation.settled
            assert observation.tilt is not None
            for _ in range(5):  # each a second of robot time
                later = client.read()
            assert later.tilt == pytest.approx(observation.tilt, abs=math.radians(0.3))
