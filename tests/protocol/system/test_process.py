"""Ctrl-C waits for what cannot stand it."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading

import pytest

from protocol.system.process import interrupts_deferred


def work(done: list[str]) -> None:
    with interrupts_deferred():
        signal.raise_signal(signal.SIGINT)
        done.append("all of it")


def fail() -> None:
    with interrupts_deferred():
        signal.raise_signal(signal.SIGINT)
        raise OSError("full")


def test_an_interrupt_waits_for_the_end_of_the_block() -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        work(done)
    assert done
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_an_error_in_the_block_comes_before_an_interrupt() -> None:
    with pytest.raises(OSError, match="full"):
        fail()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_other_threads_are_never_interrupted() -> None:
    done: list[str] = []

    def calmly() -> None:
        with interrupts_deferred():
            done.append("all of it")

    thread = threading.Thread(target=calmly)
    thread.start()
    thread.join()
    assert done


PROGRAM = """
import ctypes, sys
from protocol.system.process import native_output_discarded

libc = ctypes.CDLL(None)
print("before")
with native_output_discarded():
    libc.puts(b"buffered by C")
    libc.write(2, b"not buffered", 12)
try:
    with native_output_discarded():
        raise ValueError
except ValueError:
    print("after")
libc.puts(b"C again")
libc.fflush(None)
"""


def test_only_what_is_printed_inside_is_discarded() -> None:
    printed = subprocess.run(
        [sys.executable, "-u", "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert (printed.stdout, printed.stderr) == ("before\nafter\nC again\n", "")


# In a process of its own: this one has threads that a fork would not have.
PARENT = """
import logging, os, socket, threading, time
from bench.still_robot import still_robot
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.server import Server
from robot.host.clock import WallClock
log = logging.getLogger("test")
with still_robot(WallClock(), housekeeping=None, log=log) as robot:
    # Nobody else connects from there, and so takes the port in between.
    server = Server(robot.controller, bind=f"tcp://127.{os.getpid() % 250 + 2}.0.1:*", log=log)
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
