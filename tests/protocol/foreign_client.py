"""A client written from SPEC.md alone: ZeroMQ, MessagePack and nothing of this project.

    python foreign_client.py tcp://127.0.0.1:5750 ANGLE

It moves every joint to the same angle (rad) and prints what the robot felt, as JSON.
"""

import json
import sys
import threading
import time
import uuid
from itertools import count
from typing import Any

import msgpack
import zmq

RESEND = 2  # s
PATIENCE = 60.0  # s


class Robot:
    """One session; a lock lets the heartbeat thread share the socket."""

    def __init__(self, address: str):
        self.socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.DEALER)
        self.socket.setsockopt(zmq.IMMEDIATE, 1)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.connect(address)
        self.lock = threading.Lock()
        self.client = str(uuid.uuid4())
        self.session: str | None = None
        self.ids = count(1)
        self.loose_ids = count(2**52)
        self.left = threading.Event()
        welcome = self.ask("hello", next(self.loose_ids), versions=[1], software="foreign 1")
        assert welcome["version"] == 1
        self.session = welcome["session"]
        self.joints = [joint["name"] for joint in welcome["capabilities"]["joints"]]
        self.pulse = threading.Thread(target=self.beat)
        self.pulse.start()

    def say(self, kind: str, number: int, **fields: Any) -> None:
        message = {"type": kind, "id": number, "client": self.client, **fields}
        if self.session is not None:
            message["session"] = self.session
        with self.lock:
            if self.socket.poll(RESEND * 1000, zmq.POLLOUT):
                self.socket.send(msgpack.packb(message))

    def hear(self, seconds: float) -> dict[str, Any]:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with self.lock:  # briefly: the heartbeat must get its turn
                if self.socket.poll(20):
                    reply: dict[str, Any] = msgpack.unpackb(self.socket.recv())
                    return reply
        return {}

    def ask(self, kind: str, number: int, **fields: Any) -> dict[str, Any]:
        silent_since = time.monotonic()
        self.say(kind, number, **fields)
        while time.monotonic() < silent_since + PATIENCE:
            reply = self.hear(RESEND)
            if not reply:
                self.say(kind, number, **fields)  # the same id: it is carried out at most once
            elif reply.get("id") == number:
                silent_since = time.monotonic()
                if reply["type"] == "error":
                    raise SystemExit(f"{reply['code']}: {reply['message']} {reply['advice']}")
                if reply["type"] not in ("accepted", "progress"):
                    return reply
        raise SystemExit("the robot does not answer")

    def beat(self) -> None:
        while not self.left.wait(1.0):
            self.say("heartbeat", next(self.loose_ids))

    def leave(self) -> None:
        self.left.set()
        self.pulse.join()
        self.socket.close()


def main(address: str, angle: float) -> None:
    robot = Robot(address)
    try:
        robot.ask("acquire", next(robot.ids))
        targets = dict.fromkeys(robot.joints, angle)
        performed = robot.ask("perform", next(robot.ids), targets=targets)
        felt = robot.ask("read", next(robot.ids))
        robot.ask("release", next(robot.ids))
    finally:
        robot.leave()
    print(json.dumps({"performed": performed, "read": felt}))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
