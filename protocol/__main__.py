"""``python -m protocol URI status|stop|clear|watch|hold|relax``: a robot by hand, from a terminal.

``stop`` and ``watch`` need no control of the robot; clear, hold and relax acquire it, and give it
back.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence

from protocol.errors import BodyschemaError
from protocol.text import command_line, printable
from protocol.transport.client import RobotClient
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.messages import State, Telemetry

COMMANDS = ("status", "stop", "clear", "watch", "hold", "relax")
TIMEOUT = 5.0  # s to wait for an answer


def main(arguments: Sequence[str] | None = None) -> int:
    """Carries out one command; returns 0, or 1 after a sentence on standard error."""
    parser = argparse.ArgumentParser(
        prog="python -m protocol",
        description="Asks a robot for its status, watches it until Ctrl-C, or stops it by hand.",
    )
    parser.add_argument("uri", metavar="URI", help="where the robot is, tcp://host:port")
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("--keys", metavar="DIR", help="key directory, where the robot asks for one")
    options = parser.parse_args(arguments)
    try:
        if options.command == "watch":
            return _watch(options.uri, options.keys)
        with RobotClient(options.uri, timeout=TIMEOUT, keys=options.keys) as robot:
            if options.command == "stop":
                robot.stop()
            elif options.command != "status":
                robot.acquire()
                getattr(robot, options.command)()
            status = robot.status()
    except BodyschemaError as error:
        print(f"protocol: {printable(str(error))}", file=sys.stderr)
        return 1
    _show(status.state, status.reason, options.uri, options.keys)
    return 0


def _show(state: str, reason: str | None, uri: str, keys: str | None) -> None:
    print(printable(f"{state}{f': {reason}' if reason else ''}"), flush=True)
    if state in (State.STOPPED, State.FAULT):
        option = ("--keys", keys) if keys else ()
        clear = command_line("python", "-m", "protocol", uri, "clear", *option)
        print(f"It stays so until: {clear}", flush=True)


def _watch(uri: str, keys: str | None) -> int:
    """Prints state and pose whenever they change, until Ctrl-C."""
    with RobotClient(uri, timeout=TIMEOUT, keys=keys) as robot:
        place = robot.telemetry_endpoint
    shown: tuple[object, ...] = ()
    with TelemetrySubscriber(place, keys=keys) as telemetry:
        try:
            while True:
                seen = telemetry.next(TIMEOUT)
                if (seen.state, seen.reason) != shown[:2]:
                    _show(seen.state, seen.reason, uri, keys)
                latest = (seen.state, seen.reason, _pose(seen))
                if latest[2:] != shown[2:]:
                    print(printable(latest[2]), flush=True)
                shown = latest
        except KeyboardInterrupt:
            return 0


def _pose(seen: Telemetry) -> str:
    angles = "  ".join(f"{name} {math.degrees(a):+.1f}°" for name, a in seen.angles.items())
    controller = f"client {seen.controller}" if seen.controller else "nobody"
    return f"  {angles or 'limp'}; {seen.sequence} observations; controlled by {controller}"


if __name__ == "__main__":
    sys.exit(main())
