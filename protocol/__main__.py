"""``python -m protocol URI status|stop|clear|hold|relax``: a robot by hand, from a terminal.

``stop`` needs no control of the robot; clear, hold and relax acquire it, and give it back.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from protocol.errors import BodyschemaError
from protocol.text.printable import printable
from protocol.transport.client import RobotClient
from protocol.wire.states import State

COMMANDS = ("status", "stop", "clear", "hold", "relax")
TIMEOUT = 5.0  # s


def main(arguments: Sequence[str] | None = None) -> int:
    """Sends one request; returns 0, or 1 after a sentence on standard error."""
    parser = argparse.ArgumentParser(
        prog="python -m protocol", description="Asks a robot for its status, or stops it by hand."
    )
    parser.add_argument("uri", metavar="URI", help="where the robot is, tcp://host:port")
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("--keys", metavar="DIR", help="key directory, where the robot asks for one")
    options = parser.parse_args(arguments)
    try:
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
    print(printable(f"{status.state}{f': {status.reason}' if status.reason else ''}"))
    if status.state in (State.STOPPED, State.FAULT):
        keys = f" --keys {options.keys}" if options.keys else ""
        print(f"It stays so until: python -m protocol {options.uri} clear{keys}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
