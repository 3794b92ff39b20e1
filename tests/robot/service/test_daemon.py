"""Serving: what the daemon sets up around the control loop and the server."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from dataclasses import replace

import pytest

from bench.still_robot import example_config, still_robot
from protocol.wire.messages import Stop
from robot.service.daemon import describe, serve
from tests.robot.stepped import SteppedClock

SIGNALS = [signal.SIGTERM, signal.SIGINT, signal.SIGHUP]


class BriefServer:
    """Serves for no time, and notes what it finds."""

    endpoint = telemetry_endpoint = "tcp://127.0.0.1:1"

    def __init__(self) -> None:
        self.turn = 0.0
        self.handled: list[signal.Signals] = []

    def __enter__(self) -> BriefServer:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def run(self) -> None:
        self.turn = sys.getswitchinterval()
        self.handled = [item for item in SIGNALS if callable(signal.getsignal(item))]


def test_threads_take_quick_turns_while_it_serves_and_only_then() -> None:
    before = sys.getswitchinterval(), signal.getsignal(signal.SIGTERM)
    log = logging.getLogger("test")
    with still_robot(SteppedClock(), housekeeping=None, log=log) as robot:
        server = BriefServer()
        serve(robot.controller, server, log)  # type: ignore[arg-type]
        assert robot.controller.shut_down()
    assert server.turn <= 0.001
    assert server.handled == SIGNALS
    assert (sys.getswitchinterval(), signal.getsignal(signal.SIGTERM)) == before


def test_what_the_log_advises_can_be_typed_where_the_robot_serves_every_address(
    caplog: pytest.LogCaptureFixture,
) -> None:
    log, stopped = logging.getLogger("test"), threading.Event()
    with still_robot(SteppedClock(), housekeeping=None, log=log) as robot:

        class StoppedServer(BriefServer):
            endpoint = "tcp://*:5761"

            def run(self) -> None:
                robot.controller.set_notify(stopped.set)
                robot.controller.submit(1, Stop(id=1, client="operator"))
                assert stopped.wait(10)

        serve(robot.controller, StoppedServer(), log)  # type: ignore[arg-type]
        assert robot.controller.shut_down()
    assert "python -m protocol tcp://127.0.0.1:5761 clear" in caplog.text


def test_a_signal_that_nohup_has_taken_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with still_robot(SteppedClock(), housekeeping=None, log=logging.getLogger("test")) as robot:
            server = BriefServer()
            serve(robot.controller, server, logging.getLogger("test"))  # type: ignore[arg-type]
            assert robot.controller.shut_down()
        assert server.handled == SIGNALS[:2]
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_radii_are_public_where_all_are_known() -> None:
    config = example_config("")
    assert describe(config).part_radii == (0.013,) * 4 + (0.006,) * 4
    first, *others = config.joints
    unknown = replace(config, joints=(replace(first, part_radius=None), *others))
    assert describe(unknown).part_radii is None
