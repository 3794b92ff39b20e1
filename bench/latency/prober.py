"""Round trips to a robot beside a bare echo: ``python -m bench.latency.prober URI ECHO COUNT``.

Each heartbeat to the robot is followed by a frame of the same size to the echo, so that both meet
the same load. Only heartbeats that a moving robot answered are counted. Prints JSON.
"""

from __future__ import annotations

import json
import random
import sys
import time

import zmq

from protocol.wire.codec import decode, encode
from protocol.wire.messages import (
    PROTOCOL_VERSION,
    Heartbeat,
    Hello,
    State,
    Status,
    Welcome,
    parse_reply,
)

PATIENCE = 10_000  # ms
PAUSE = (0.002, 0.006)  # s between round trips, drawn, so as not to march in step with anything


def main() -> None:
    """Measures, and prints the round trips in ms."""
    uri, echo, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
    rng = random.Random(0)
    with zmq.Context() as context:
        robot, mirror = context.socket(zmq.DEALER), context.socket(zmq.DEALER)
        robot.connect(uri)
        mirror.connect(echo)
        hello = Hello(id=1, client="prober", versions=(PROTOCOL_VERSION,))
        robot.send(encode(hello.to_map()))
        welcome = parse_reply(decode(robot.recv()))
        assert isinstance(welcome, Welcome)
        trips: list[float] = []
        echoes: list[float] = []
        number = 2
        while len(trips) < count:
            number += 1
            beat = Heartbeat(id=number, client="prober", session=welcome.session)
            frame = encode(beat.to_map())
            took, answer = trip(robot, frame)
            status = parse_reply(decode(answer))
            assert isinstance(status, Status)
            assert status.id == number
            bare, _ = trip(mirror, frame)
            if status.state == State.MOVING:
                trips.append(took)
                echoes.append(bare)
            time.sleep(rng.uniform(*PAUSE))
        print(json.dumps({"robot": trips, "echo": echoes}))
        robot.close(0)
        mirror.close(0)


def trip(wire: zmq.Socket[bytes], frame: bytes) -> tuple[float, bytes]:
    """Milliseconds until the answer, and the answer."""
    start = time.perf_counter()
    wire.send(frame)
    if not wire.poll(PATIENCE):
        raise TimeoutError("no answer")
    answer = wire.recv()
    return 1000 * (time.perf_counter() - start), answer


if __name__ == "__main__":
    main()
