"""An interaction that is made again after it was broken off feels what it would have felt."""

from __future__ import annotations

import logging
import random
from collections.abc import Iterator, Sequence
from itertools import count
from queue import SimpleQueue

import pytest

from protocol.rules.robot_interface import Finished
from protocol.wire.messages import Clear, ErrorReply, ObservationReply, Perform, Stop
from robot.control.controller import Controller
from sim_robot.simulator.daemon import SETS, emulation, robot_on
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

BODY = load_body(default_body_path())
SENDER = {"client": "test", "session": "test"}
PROGRAMS = tuple(
    {motor.name: rng.uniform(-0.5, 0.5) for motor in BODY.motors}
    for rng in map(random.Random, (1, 4))
)


class Requests:
    """Sends requests to a controller, and waits for their ends."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._numbers = count(1)
        self._news: SimpleQueue[None] = SimpleQueue()
        controller.set_notify(lambda: self._news.put(None))

    def stop(self) -> None:
        number = next(self._numbers)
        self._controller.submit(number, Stop(id=number, **SENDER))

    def clear(self) -> None:
        number = next(self._numbers)
        self._controller.submit(number, Clear(id=number, **SENDER))
        self._end(number)

    def perform(self, targets: dict[str, float]) -> object:
        number = next(self._numbers)
        self._controller.submit(number, Perform(id=number, targets=targets, **SENDER))
        return self._end(number)

    def _end(self, number: int) -> object:
        while True:
            self._news.get()
            for event in self._controller.events():
                if isinstance(event, Finished) and event.ticket == number:
                    return event.reply


def felt(electronics: str, broken_off: Sequence[int], patch: pytest.MonkeyPatch) -> list[object]:
    """What two interactions feel, the second broken off when the robot waits the n-th time."""
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
def test_a_motion_that_was_broken_off_feels_the_same_when_it_is_made_again(
    electronics: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = felt(electronics, (), monkeypatch)
    assert len(expected) == len(PROGRAMS)
    for broken_off in ((3,), (20,), (60,), (70, 11)):
        assert felt(electronics, broken_off, monkeypatch) == expected
