"""Viewers of a robot, all in one process: ``python -m bench.latency.viewers URI COUNT``.

Each has a connection of its own, sends a heartbeat a second and reads all telemetry. Prints
``ready`` once each has been answered and has heard telemetry; at the end of its standard input,
what it saw.
"""

from __future__ import annotations

import sys
import time

import zmq

from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.telemetry import TOPIC
from protocol.wire.codec import decode, encode
from protocol.wire.messages import PROTOCOL_VERSION, Heartbeat, Hello, Status, Welcome, parse_reply


def main() -> None:
    """Watches until standard input ends."""
    uri, count = sys.argv[1], int(sys.argv[2])
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    poller = zmq.Poller()
    poller.register(sys.stdin.fileno(), zmq.POLLIN)
    viewers: dict[zmq.Socket[bytes], str] = {}
    beats: dict[zmq.Socket[bytes], bytes] = {}
    listeners: dict[zmq.Socket[bytes], int] = {}
    for number in range(count):
        wire = context.socket(zmq.DEALER)
        wire.connect(uri)
        viewers[wire] = f"viewer-{number}"
        hello = Hello(id=1, client=viewers[wire], versions=(PROTOCOL_VERSION,))
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
                beat = Heartbeat(id=2, client=viewers[wire], session=reply.session)
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


if __name__ == "__main__":
    main()
