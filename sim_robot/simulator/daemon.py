"""The same daemon as on a robot, on emulated electronics over a PyBullet body."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from robot.configuration.calibration_file import read_calibration
from robot.configuration.robot_config import RobotConfig, apply_calibration
from robot.control.controller import Controller
from robot.drivers.buses import Buses
from robot.drivers.sv203 import SV203
from robot.service.daemon import HOUSEKEEPING, build_controller
from robot.service.devices import Devices, open_devices
from sim_robot.electronics.clock import Follower, HostClock, RealTimeClock, VirtualClock
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.servos import Servos
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.faults.fault_panel import FaultPanel
from sim_robot.simulator.miscalibration import miscalibrated
from sim_robot.simulator.wiring import REACH, RECESS, Wiring, configure
from sim_robot.world.body import Body
from sim_robot.world.sensor_noise import Noise, NoiseLevels
from sim_robot.world.simulation import World


@dataclass(frozen=True, kw_only=True)
class Emulation:
    """Emulated electronics over a body, found and identified by a robot's drivers.

    Attributes:
        config: What the daemon believes about its robot.
        truth: How the electronics are really calibrated.
        buses: What leads the drivers to the emulators.
        devices: The drivers.
        clock: The robot clock.
        noise: Of the sensors.
        world: What they sense.
        panel: Where its faults are injected.
        servo_board: The emulator below the servo driver.
        daq: The emulator below the driver of the analogue inputs.
        distance: The emulator below the distance sensor's driver.
    """

    config: RobotConfig
    truth: RobotConfig
    buses: Buses
    devices: Devices
    clock: HostClock
    noise: Noise
    panel: FaultPanel
    world: World
    servo_board: SV203Emulator
    daq: DMM32Emulator
    distance: VL6180XEmulator


@dataclass(frozen=True, kw_only=True)
class SimulatedRobot(Emulation):
    """Emulated electronics with the control loop of a robot."""

    controller: Controller


class SimulatedAttendant:
    """Numbers interactions, for the noise, and lays the body down before each.

    Args:
        world: The world.
        noise: Drawn anew for each observation: one that is made again after it was broken off
            reads what it would have read.
        panel: Told of each interaction.
        observed: How many observations there were so far.
        lays_down: Whether to put the body back on its belly.
    """

    def __init__(
        self,
        world: World,
        noise: Noise,
        panel: FaultPanel,
        *,
        observed: Callable[[], int],
        lays_down: bool,
    ):
        self._world = world
        self._noise = noise
        self._panel = panel
        self._observed = observed
        self.lays_down = lays_down

    def attend(self) -> None:
        """Called at each interaction, once the joints are at zero."""
        self._panel.begin_interaction()
        self._noise.begin(self._observed() + 1)
        if self.lays_down:
            self._world.lay_down()


@contextmanager
def emulation(
    body: Body,
    *,
    seed: int,
    levels: NoiseLevels,
    real_time: bool,
    log: logging.Logger,
    wrong: int | None = None,
    calibration: Path | None = None,
) -> Iterator[Emulation]:
    """Builds emulated electronics over a body, and starts a robot's drivers on them.

    Args:
        body: The body.
        seed: Seed of the sensor noise.
        levels: Sensor noise.
        real_time: Whether time passes as on a wall clock instead of in lockstep with the loop.
        log: Where to write what a person may want to know.
        wrong: Seed of electronics that differ from their configuration, or ``None`` for true ones.
        calibration: A calibration file, whose values the configuration takes over.
    """
    with ExitStack() as stack:
        world = stack.enter_context(World(body, log=log))
        noise = Noise(levels, seed)
        board = SV203Emulator()
        stack.callback(board.close)
        config = configure(body, port=board.port, levels=levels)
        truth = config if wrong is None else miscalibrated(config, wrong)
        if calibration is not None:
            calibrated = read_calibration(calibration, config.servos.counts)
            config = apply_calibration(config, calibrated, file=str(calibration))
        wiring = Wiring(truth, world, noise)

        servos = Servos()

        def advance(time: float) -> None:
            panel.advance()
            wiring.drive(servos.carry(board.pulses()))
            world.advance_to(time)

        clock = RealTimeClock(advance) if real_time else VirtualClock(advance)
        host = HostClock(clock)
        daq = DMM32Emulator(wiring.volts, clock)
        distance = VL6180XEmulator(wiring.distance_mm, clock, reach_mm=int(1000 * (REACH + RECESS)))
        panel = FaultPanel(
            {
                "servo_board": board,
                "servos": servos,
                "daq": daq,
                "distance": distance,
                "clock": host,
            },
            host.now,
        )
        stack.callback(panel.close)
        buses = Buses(clock=host, open_ports=lambda base: daq, open_i2c=lambda path: distance)
        devices = open_devices(config, buses)
        stack.callback(devices.close)
        assert isinstance(devices.servos, SV203)
        clock.synchronise = Follower(board, devices.servos)
        wiring.drive(board.pulses())
        world.lay_down()
        yield Emulation(
            config=config,
            truth=truth,
            buses=buses,
            devices=devices,
            clock=host,
            noise=noise,
            panel=panel,
            world=world,
            servo_board=board,
            daq=daq,
            distance=distance,
        )


@contextmanager
def simulated_robot(
    body: Body,
    *,
    seed: int,
    levels: NoiseLevels,
    real_time: bool,
    attendant: bool,
    log: logging.Logger,
    wrong: int | None = None,
    calibration: Path | None = None,
) -> Iterator[SimulatedRobot]:
    """Builds a simulated robot; its control loop is not yet started.

    The arguments are those of ``emulation``, and ``attendant``: whether somebody puts the body back
    on its belly before each interaction.
    """
    with emulation(
        body,
        seed=seed,
        levels=levels,
        real_time=real_time,
        log=log,
        wrong=wrong,
        calibration=calibration,
    ) as parts:
        controller = build_controller(
            parts.config,
            parts.devices,
            clock=parts.clock,
            attendant=SimulatedAttendant(
                parts.world,
                parts.noise,
                parts.panel,
                observed=lambda: controller.snapshot().sequence,
                lays_down=attendant,
            ),
            housekeeping=HOUSEKEEPING if real_time else None,
            log=log,
        )
        yield SimulatedRobot(controller=controller, **vars(parts))
