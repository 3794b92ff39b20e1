"""The command line of ``sim-robotd``."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

from protocol.errors import BodyschemaError
from protocol.system.files import may_exist
from protocol.transport.server import Server
from robot.cli.run import add_server_arguments
from robot.cli.startup import add_version
from robot.configuration.robot_config import RobotConfig, read_config, with_calibration
from robot.host.logs import complain, set_up_logging
from robot.service.daemon import serve
from sim_robot.errors import BodyError, FaultError
from sim_robot.faults.control_socket import FaultSocket
from sim_robot.faults.fault_panel import KNOWN, FaultSpec
from sim_robot.simulator.daemon import Emulation, emulation, robot_on
from sim_robot.simulator.electronics_sets import DEFAULT_SET, SETS
from sim_robot.simulator.person import RehearsalConsole, SimulatedPerson
from sim_robot.world.body import body_path, default_body_path, examine, load_body, shipped_bodies
from sim_robot.world.sensor_noise import load_noise
from sim_robot.world.simulation import DEFAULT_ENGINE, ENGINES


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns 0 when done, 1 after a sentence on standard error."""
    options = _parser().parse_args(arguments)
    if options.config is not None and options.electronics is not None:
        options.refuse("--config says which electronics there are: leave --electronics out")
    set_up_logging()
    try:
        if options.check is not None:
            return check(options.check)
        if options.print_body:
            body = load_body(options.body)
            urdf = body.urdf.encode() if body.notes else options.body.read_bytes()
            sys.stdout.buffer.write(urdf)
        elif options.list_bodies:
            list_bodies()
        elif options.calibrate:
            calibrate(options)
        elif options.console:
            console(options)
        else:
            run(options)
    except BodyschemaError as error:
        complain("sim-robotd", error)
        return 1
    return 0


def run(options: argparse.Namespace) -> None:
    """Serves the simulated robot until a signal."""
    log = logging.getLogger("sim-robotd")
    with ExitStack() as stack:
        parts = stack.enter_context(
            _emulation(options, real_time=options.real_time, calibration=options.calibration)
        )
        for note in parts.body.notes:
            log.warning("%s", note)
        controller = robot_on(parts, log, operator=options.operator)
        for fault in options.fault:
            parts.panel.order(fault)
        if options.control is not None:
            socket = stack.enter_context(
                FaultSocket(
                    parts.panel,
                    options.control,
                    report=lambda: {
                        "pulses": list(parts.electronics.pulses()),
                        "robot_time": parts.clock.now(),
                    },
                )
            )
            log.info("faults can be injected at %s", socket.endpoint)
        server = Server(
            controller,
            bind=options.bind,
            keys=options.keys,
            insecure=options.insecure,
            log=log,
        )
        serve(controller, server, log)


def check(file: Path) -> int:
    """Prints all that is wrong with a description, or taken otherwise; returns the exit code."""
    body, faults = examine(file)
    if body is None:
        for fault in faults:
            print(fault)
        return 1
    for note in body.notes:
        print(f"note: {note}.")
    print(f"{body.name}: {len(body.motors)} joints, touch at {', '.join(body.touch) or 'none'}.")
    return 0


def calibrate(options: argparse.Namespace) -> None:
    """Lets a simulated person calibrate the simulated robot."""
    file = options.calibration
    if file is None:
        options.refuse("--calibrate needs --calibration FILE, which it writes")
    existing = file if may_exist(file) else None
    with _emulation(options, real_time=False, calibration=existing) as parts:
        SimulatedPerson(parts, seed=options.seed, echo=print).calibrate(parts.devices, file)


def console(options: argparse.Namespace) -> None:
    """Lets a person rehearse at the terminal."""
    with _emulation(options, real_time=True) as parts:
        for fault in options.fault:
            parts.panel.order(fault)
        RehearsalConsole(parts, seed=options.seed, file=options.calibration).run()


def _emulation(
    options: argparse.Namespace, *, real_time: bool, calibration: Path | None = None
) -> AbstractContextManager[Emulation]:
    log = logging.getLogger("sim-robotd")
    own = None if options.config is None else _own(options.config, log)
    return emulation(
        load_body(options.body),
        seed=options.seed,
        levels=load_noise(options.noise),
        real_time=real_time,
        log=log,
        electronics=options.electronics or DEFAULT_SET,
        own=own,
        wrong=options.miscalibrated,
        calibration=calibration,
        engine=options.engine,
    )


def _own(file: Path, log: logging.Logger) -> RobotConfig:
    """Reads somebody's own configuration, with its calibration if there is one."""
    config, calibration = read_config(file)
    if calibration is not None and not may_exist(calibration):
        log.warning(
            "%s names %s, which does not exist: its own values stand here, and robotd run would "
            "refuse it",
            file,
            calibration,
        )
    return with_calibration(config, calibration)[0]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sim-robotd",
        description="A simulated robot: the daemon of a real one, on emulated electronics.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_faults(),
    )
    parser.add_argument(
        "--body",
        type=_body,
        default=default_body_path(),
        metavar="NAME|FILE.urdf",
        help="the body, by name (see --list-bodies) or file (default: the paper's quadruped)",
    )
    parser.add_argument(
        "--electronics",
        choices=SETS,
        help="which boards: "
        + "; ".join(f"{name}: {one.summary}" for name, one in SETS.items())
        + f" (default {DEFAULT_SET})",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="robot.toml",
        help="the boards, wiring, limits and calibration of your own file, which is only read; a "
        "driver that there is no emulator of gets a stand-in, and that is said",
    )
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default=DEFAULT_ENGINE,
        help=f"what simulates the body (default: {DEFAULT_ENGINE})",
    )
    parser.add_argument("--print-body", action="store_true", help="print the body's URDF and exit")
    parser.add_argument(
        "--check",
        type=Path,
        metavar="FILE.urdf",
        help="say all that is wrong with a description, or what of it is taken otherwise, and exit",
    )
    parser.add_argument(
        "--list-bodies", action="store_true", help="list the bodies that have a name and exit"
    )
    parser.add_argument(
        "--seed", type=_seed, default=0, help="seed of the sensor noise (default 0)"
    )
    parser.add_argument(
        "--noise",
        default="default",
        metavar="default|none|FILE",
        help="sensor noise (a file is TOML with the keys of the documentation)",
    )
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="let time pass as on a wall clock (default: as fast as the physics goes)",
    )
    parser.add_argument(
        "--no-operator",
        dest="operator",
        action="store_false",
        help="leave the body as it fell, instead of laying it down before each interaction",
    )
    parser.add_argument(
        "--miscalibrated",
        type=_seed,
        metavar="SEED",
        help="wire the electronics otherwise than the configuration says: offsets, gains, signs",
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help="take the calibration from this file, as robotd does",
    )
    parser.add_argument(
        "--calibrate",
        action="store_true",
        help="let a simulated person calibrate the robot, write --calibration FILE, and exit",
    )
    parser.add_argument(
        "--console",
        action="store_true",
        help="serve nobody, but rehearse robotd doctor, calibrate and try in the terminal",
    )
    parser.add_argument(
        "--fault",
        type=_fault,
        action="append",
        default=[],
        metavar="SPEC",
        help="inject a fault, as in daq.stuck_channel=3@2i+10s: see below; may be repeated",
    )
    parser.add_argument(
        "--control",
        metavar="URI",
        help="inject and mend faults there while it runs: ipc://PATH or tcp://127.0.0.1:PORT "
        "(python -m sim_robot.faults.control_socket URI …)",
    )
    add_server_arguments(parser)
    add_version(parser)
    parser.set_defaults(refuse=parser.error)
    return parser


def _faults() -> str:
    width = max(map(len, KNOWN))
    lines = "\n".join(f"  {name:{width}}  {effect}" for name, effect in KNOWN.items())
    return (
        "faults: SPEC is DEVICE.FAULT[=N[:AMOUNT]][@START][+DURATION], with START 3i (third\n"
        "interaction) or 12.5s (robot time) and DURATION 2i, 5s or 5w (wall clock):\n\n" + lines
    )


def _fault(text: str) -> FaultSpec:
    try:
        return FaultSpec.parse(text)
    except FaultError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def list_bodies() -> None:
    """Prints the bodies that come with the simulator."""
    for name, path in shipped_bodies().items():
        body = load_body(path)
        print(f"{name:<14} {len(body.motors)} joints, {len(body.touch)} touch sensors")


def _body(text: str) -> Path:
    try:
        return body_path(text)
    except BodyError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"must be an integer from 0 to 2^32-1, not {text!r}")
    return int(text)
