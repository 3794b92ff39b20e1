"""The daemon of a real robot, on emulated electronics over a simulated body."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from robot.configuration.calibration_file import read_calibration
from robot.configuration.robot_config import RobotConfig, apply_calibration
from robot.control.controller import Controller
from robot.devices import Devices, open_devices
from robot.drivers.buses import Buses
from robot.service.daemon import HOUSEKEEPING, build_controller
from sim_robot.electronics.clock import HostClock, RealTimeClock, VirtualClock
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.faults.fault_panel import FaultPanel
from sim_robot.faults.world_faults import Damage, Ground
from sim_robot.simulator.electronics_sets import DEFAULT_SET, SETS
from sim_robot.simulator.emulated_electronics import EmulatedElectronics
from sim_robot.simulator.fitted_body import fitted
from sim_robot.simulator.wiring import Wiring, miscalibrated
from sim_robot.world.body import Body
from sim_robot.world.damage import damaged
from sim_robot.world.sensor_noise import Noise, NoiseLevels
from sim_robot.world.simulation import DEFAULT_ENGINE, World, open_world


@dataclass(frozen=True, kw_only=True)
class Emulation:
    """Emulated electronics over a body, found and identified by a robot's drivers.

    The daemon believes ``config``; ``truth`` has the true calibration. The body is without damages,
    also where the world has another one. ``buses`` lead drivers to the emulators.
    """

    config: RobotConfig
    truth: RobotConfig
    buses: Buses
    devices: Devices
    clock: HostClock
    real_time: bool
    noise: Noise
    body: Body
    panel: FaultPanel
    world: World
    electronics: EmulatedElectronics


class SimulatedOperator:
    """Numbers interactions, for the noise, and lays the body down before each.

    An interaction that is repeated after it was broken off reads what it would have read.

    Args:
        parts: Emulation of the robot.
        observed: Returns the number of observations so far.
        lays_down: Whether to put the body back on its belly.
    """

    def __init__(self, parts: Emulation, *, observed: Callable[[], int], lays_down: bool):
        self._parts = parts
        self._observed = observed
        self.lays_down = lays_down

    def attend(self) -> None:
        """Called at each interaction, once the joints are at zero."""
        parts = self._parts
        parts.clock.sleep(parts.electronics.lag)  # the world catches up
        parts.panel.begin_interaction()
        parts.electronics.begin_interaction()
        parts.noise.begin(self._observed() + 1)
        if self.lays_down:
            parts.world.lay_down()


@contextmanager
def emulation(
    body: Body,
    *,
    seed: int,
    levels: NoiseLevels,
    real_time: bool,
    log: logging.Logger,
    electronics: str = DEFAULT_SET,
    wrong: int | None = None,
    calibration: Path | None = None,
    engine: str = DEFAULT_ENGINE,
    own: RobotConfig | None = None,
) -> Iterator[Emulation]:
    """Builds emulated electronics over a body, and starts a robot's drivers on them.

    Args:
        body: The body.
        seed: Seed of the sensor noise.
        levels: Sensor noise.
        real_time: Whether time passes as on a wall clock instead of in lockstep with the loop.
        log: Where to write what a person may want to know.
        electronics: Set of electronics, by a name out of ``SETS``.
        wrong: Seed of electronics that differ from their configuration, or ``None`` for true ones.
        calibration: A calibration file, whose values the configuration takes over.
        engine: Name of the engine that simulates the body.
        own: Configuration whose electronics are emulated, instead of ``electronics``.

    Raises:
        BodyError: The body does not fit the configuration ``own``.
    """
    with ExitStack() as stack:
        if own is None:
            boards = EmulatedElectronics(SETS[electronics].configure(body, levels))
        else:
            body, fit_notes = fitted(body, own)
            boards = EmulatedElectronics(own)
            for note in (*fit_notes, *boards.notes):
                log.warning("%s", note)
        stack.callback(boards.close)
        world = stack.enter_context(open_world(body, log=log, engine=engine))
        noise = Noise(levels, seed)
        config = boards.config
        truth = config if wrong is None else miscalibrated(config, wrong)
        if calibration is not None:
            calibrated = read_calibration(calibration, config.servos.known_counts)
            config = apply_calibration(config, calibrated, file=str(calibration))
        wiring = Wiring(truth, world, noise)

        damage, ground = Damage(body, damaged), Ground()

        def advance(time: float) -> None:
            panel.advance()
            if (new_body := damage.new_body()) is not None:
                world.become(new_body)
            world.incline(ground.up)
            wiring.drive(boards.pulses())
            world.advance_to(time)
            boards.feel(lambda: wiring.servos.feel(boards.pulses(), wiring.felt()))

        clock = RealTimeClock(advance) if real_time else VirtualClock(advance)
        host_clock = HostClock(clock)
        boards.connect(wiring, clock)
        switches: dict[str, FaultSwitch] = {
            "servos": wiring.servos,
            "sensors": wiring.sensors,
            "body": damage,
            "ground": ground,
            "clock": host_clock,
        }
        panel = FaultPanel({**boards.switches, **switches}, host_clock.now)
        stack.callback(panel.close)
        buses = boards.buses(host_clock)
        devices = open_devices(config, buses)
        stack.callback(devices.close)
        clock.synchronise = boards.follow(devices.servos)
        wiring.drive(boards.pulses())
        world.lay_down()
        boards.feel(wiring.felt)
        yield Emulation(
            config=config,
            truth=truth,
            buses=buses,
            devices=devices,
            clock=host_clock,
            real_time=real_time,
            noise=noise,
            body=body,
            panel=panel,
            world=world,
            electronics=boards,
        )


def switch_on(parts: Emulation, log: logging.Logger) -> None:
    """Puts joints whose servos are off at 0°, and switches them on, as a person would."""
    joints, servos = parts.config.joints, parts.devices.servos
    counts = servos.read_counts([joint.output for joint in joints])
    off_counts = {joint.output: joint.quantise(0.0) for joint in joints if not counts[joint.output]}
    if off_counts:
        servos.set_counts(off_counts)
        parts.world.lay_down()
        log.info("the servos were off; the operator put every joint at 0° and switched them on")


def robot_on(parts: Emulation, log: logging.Logger, *, operator: bool) -> Controller:
    """The control loop of a robot on emulated electronics; it is not yet started.

    Args:
        parts: Emulation of the robot.
        log: Where to write what a person may want to know.
        operator: Whether there is an operator, who switches servos that are off on in the zero pose
            and lays the body on its belly at each interaction.
    """
    if operator:
        switch_on(parts, log)
    controller = build_controller(
        parts.config,
        parts.devices,
        clock=parts.clock,
        operator=SimulatedOperator(
            parts,
            observed=lambda: controller.snapshot().sequence,
            lays_down=operator,
        ),
        housekeeping=HOUSEKEEPING if parts.real_time else None,
        log=log,
    )
    return controller
