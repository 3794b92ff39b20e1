"""What the service manager hears, on a real datagram socket; and that only a live loop is heard."""

from __future__ import annotations

import logging
import os
import socket
import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from bench.still_robot import StillRobot, still_robot
from robot.host.clock import WallClock, WatchedClock
from robot.host.service_manager import ServiceManager
from sim_robot.electronics.dmm32 import DMM32Emulator
from tests.robot.stepped import program

PATIENCE = 0.2  # s; the manager's, as WatchdogSec


@contextmanager
def ear(name: str) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(name)
        receiver.settimeout(5)
        yield receiver


def environment(address: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": str(int(PATIENCE * 1e6))}


@pytest.mark.parametrize("abstract", [True, False])
def test_the_manager_hears_each_message_whole(tmp_path: Path, abstract: bool) -> None:
    address = f"@robotd-{uuid.uuid4()}" if abstract else str(tmp_path / "notify")
    with ear(address.replace("@", "\0")) as manager:
        service = ServiceManager(environment(address))
        service.ready("serving quadruped")
        assert manager.recv(999) == b"READY=1\nSTATUS=serving quadruped"
        service.status("fault: a sentence\nREADY=1")  # no text can forge an assignment
        assert manager.recv(999) == b"STATUS=fault: a sentence READY=1"
        service.stopping("parking")
        assert manager.recv(999) == b"STOPPING=1\nSTATUS=parking"
        service.alive()
        service.alive()  # too soon to be worth a message
        assert manager.recv(999) == b"WATCHDOG=1"
        manager.setblocking(False)
        with pytest.raises(BlockingIOError):
            manager.recv(999)


@pytest.mark.parametrize(
    ("changes", "period"),
    [
        ({}, PATIENCE / 4),
        ({"WATCHDOG_PID": str(os.getpid())}, PATIENCE / 4),
        ({"WATCHDOG_PID": "1"}, None),  # meant for another process
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
        ({"NOTIFY_SOCKET": ""}, None),
    ],
)
def test_how_often_it_wants_to_hear(changes: dict[str, str], period: float | None) -> None:
    assert ServiceManager(environment("/run/notify") | changes).period == period


@pytest.mark.parametrize("address", ["", "/nowhere/notify", "@nobody", "vsock:2:1234", "/" * 200])
def test_a_deaf_manager_costs_nothing(address: str) -> None:
    service = ServiceManager(environment(address))
    service.ready("serving")
    service.alive()
    service.stopping("parking")


@contextmanager
def watched_robot() -> Iterator[tuple[StillRobot, socket.socket]]:
    """A robot in real time whose control loop feeds a watchdog."""
    address = f"@robotd-{uuid.uuid4()}"
    manager = ServiceManager(environment(address))
    clock = WatchedClock(WallClock(), manager.alive)
    log = logging.getLogger("test")
    with (
        ear(address.replace("@", "\0")) as listener,
        still_robot(clock, housekeeping=None, log=log, manager=manager) as robot,
    ):
        robot.controller.start()
        yield robot, listener


def empty(listener: socket.socket) -> None:
    listener.setblocking(False)
    with suppress(BlockingIOError):
        while True:
            listener.recv(999)


def assert_fed(listener: socket.socket) -> None:
    empty(listener)
    listener.settimeout(5)
    assert [listener.recv(999) for _ in range(8)] == [b"WATCHDOG=1"] * 8


def test_the_loop_feeds_the_watchdog_while_it_idles_and_while_it_moves() -> None:
    with watched_robot() as (robot, listener):
        assert_fed(listener)
        robot.controller.submit(1, program(robot, hip_left=-60.0))  # takes over a second
        assert_fed(listener)
        assert robot.controller.snapshot().state in ("moving", "settling")
        assert robot.controller.shut_down()


def test_a_hung_device_starves_the_watchdog(monkeypatch: pytest.MonkeyPatch) -> None:
    hung, mended = threading.Event(), threading.Event()
    whole = DMM32Emulator.read

    def hang(self: DMM32Emulator, port: int, n: int = 1) -> bytes:
        hung.set()
        assert mended.wait(120)
        return whole(self, port, n)

    with watched_robot() as (robot, listener):
        robot.controller.submit(1, program(robot, hip_left=-30.0))
        assert_fed(listener)
        monkeypatch.setattr(DMM32Emulator, "read", hang)
        assert hung.wait(120)
        empty(listener)
        listener.settimeout(3 * PATIENCE)
        with pytest.raises(TimeoutError):
            listener.recv(999)
        assert robot.controller.snapshot().state in ("moving", "settling")  # clients are answered
        mended.set()
        assert_fed(listener)
        assert robot.controller.shut_down()


def test_a_device_that_fails_does_not_starve_it() -> None:
    with watched_robot() as (robot, listener):
        robot.servo_board.inject("mute")  # every query waits for a reply that never comes
        robot.controller.submit(1, program(robot))
        listener.settimeout(5)
        while robot.controller.snapshot().state != "fault":
            assert listener.recv(999)
        assert_fed(listener)
        assert robot.controller.shut_down()
