"""Requests to the control loop of a simulated robot."""

from __future__ import annotations

from itertools import count
from queue import SimpleQueue

from protocol.rules.robot_interface import Finished
from protocol.wire.messages import Clear, Hold, Ok, Perform, Read, Relax, Stop
from robot.control.controller import Controller

SENDER = {"client": "test", "session": "test"}


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

    def ask(self, kind: type[Hold | Relax]) -> Ok:
        number = next(self._numbers)
        self._controller.submit(number, kind(id=number, **SENDER))
        reply = self._end(number)
        assert isinstance(reply, Ok), reply
        return reply

    def perform(self, targets: dict[str, float]) -> object:
        number = next(self._numbers)
        self._controller.submit(number, Perform(id=number, targets=targets, **SENDER))
        return self._end(number)

    def read(self) -> object:
        number = next(self._numbers)
        self._controller.submit(number, Read(id=number, **SENDER))
        return self._end(number)

    def _end(self, number: int) -> object:
        while True:
            self._news.get()
            for event in self._controller.events():
                if isinstance(event, Finished) and event.ticket == number:
                    return event.reply
