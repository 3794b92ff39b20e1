"""A child that a driver forks keeps neither the daemon's address nor its connections."""

from __future__ import annotations

import subprocess
import sys

# In a process of its own: this one has threads that a fork would not have.
PARENT = """
import logging, os, socket, threading, time
from bench.still_robot import still_robot
from protocol.sockets.endpoints import Endpoint
from protocol.transport.server import Server
from robot.host.clock import WallClock
log = logging.getLogger("test")
with still_robot(WallClock(), housekeeping=None, log=log) as robot:
    server = Server(robot.controller, bind="tcp://127.0.0.1:*", log=log)
    thread = threading.Thread(target=server.run)
    thread.start()
    place = Endpoint.parse(server.endpoint)
    peer = socket.create_connection((place.host, place.port), timeout=10)
    while not len(server._listener):
        time.sleep(0.01)
    wait, go_on = os.pipe()
    if not (child := os.fork()):
        os.close(go_on)
        os.read(wait, 1)  # as long as the parent lives
        os._exit(0)
    server.close()
    while peer.recv(1000):
        pass
    Server(robot.controller, bind=str(place), log=log).close()
    os.close(go_on)
    os.waitpid(child, 0)
print("the address is free")
"""


def test_a_child_without_a_program_of_its_own_keeps_no_socket() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", PARENT],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.stdout == "the address is free\n", done.stderr
