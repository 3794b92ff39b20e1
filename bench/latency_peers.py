"""The peers that ``bench.latency`` starts beside the robot, each in a process of its own.

``python -m bench.latency_peers echo``, ``probe URI ECHO COUNT`` or ``view URI COUNT``.
"""

from __future__ import annotations

import json
import random
import sys
import time
from typing import Final

import zmq

from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.telemetry import TOPIC
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

PATIENCE: Final = 10_000  # ms
PAUSE: Final = (0.002, 0.006)  # s between round trips, drawn, so as not to march in step


def echo() -> None:
    """Serves as a bare ROUTER that sends back what it gets, the least that a server can do.

    Prints its address, and goes on until it is terminated.
    """
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        router.bind("tcp://127.0.0.1:*")
        print(router.getsockopt_string(zmq.LAST_ENDPOINT), flush=True)
        while True:
            router.send_multipart(router.recv_multipart())


def probe(uri: str, echo_uri: str, count: int) -> None:
    """Measures round trips to a robot and to the echo; prints them in ms, as JSON.

    Each heartbeat to the robot is followed by a frame of its size to the echo, so that both meet
    the same load. Only heartbeats that a moving robot answered are counted.
    """
    rng = random.Random(0)
    with zmq.Context() as context:
        robot, mirror = context.socket(zmq.DEALER), context.socket(zmq.DEALER)
        robot.connect(uri)
        mirror.connect(echo_uri)
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


def view(uri: str, count: int) -> None:
    """Watches a robot as ``count`` viewers, until standard input ends.

    Each has a connection of its own, sends a heartbeat a second and reads all telemetry. Prints
    ``ready`` once each has been answered and has heard telemetry; at the end, what they saw.
    """
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    poller = zmq.Poller()
    poller.register(sys.stdin.fileno(), zmq.POLLIN)
    names: dict[zmq.Socket[bytes], str] = {}
    beats: dict[zmq.Socket[bytes], bytes] = {}
    listeners: dict[zmq.Socket[bytes], int] = {}
    for number in range(count):
        wire = context.socket(zmq.DEALER)
        wire.connect(uri)
        names[wire] = f"viewer-{number}"
        hello = Hello(id=1, client=names[wire], versions=(PROTOCOL_VERSION,))
        wire.send(encode(hello.to_map()))
        poller.register(wire, zmq.POLLIN)
    answers, ready, due = 0, False, time.monotonic() + 1
    while True:
        readable = dict(poller.poll(max(0, round(1000 * (due - time.monotonic())))))
        if sys.stdin.fileno() in readable:
            break
        for wire in readable:
            if wire in listeners:
                listeners[wire] += len(wire.recv_multipart()) == 2
                continue
            reply = parse_reply(decode(wire.recv()))
            if isinstance(reply, Welcome):
                beat = Heartbeat(id=2, client=names[wire], session=reply.session)
                beats[wire] = encode(beat.to_map())
                listener = context.socket(zmq.SUB)
                listener.setsockopt(zmq.SUBSCRIBE, TOPIC)
                listener.connect(str(Endpoint.parse(reply.capabilities.telemetry).seen_from(uri)))
                poller.register(listener, zmq.POLLIN)
                listeners[listener] = 0
            answers += isinstance(reply, Status)
        if not ready and len(listeners) == count and all(listeners.values()):
            ready = True
            print("ready", flush=True)
        if time.monotonic() >= due:
            due += 1
            for wire, beat_frame in beats.items():
                wire.send(beat_frame)
    print(f"{answers} heartbeats answered, {sum(listeners.values())} publications read")
    context.destroy(linger=0)


def main() -> None:
    """Does what the command line says."""
    match sys.argv[1:]:
        case ["echo"]:
            echo()
        case ["probe", uri, echo_uri, count]:
            probe(uri, echo_uri, int(count))
        case ["view", uri, count]:
            view(uri, int(count))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
