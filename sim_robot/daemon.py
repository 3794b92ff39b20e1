"""The same daemon as on a robot, on emulated electronics over a PyBullet body."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from robot.controller import Controller
from robot.daemon import HOUSEKEEPING, Electronics, build_controller, start_devices
from robot.drivers.sv203 import open_serial
from sim_robot.body import Body
from sim_robot.clock import RealTimeClock, VirtualClock
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.noise import Noise, NoiseLevels
from sim_robot.wiring import REACH, RECESS, Wiring, configure
from sim_robot.world import World

SYNCHRONISE_TIMEOUT = 2.0  # s of real time for the emulated board to read what was written


@dataclass(frozen=True, kw_only=True)
class SimulatedRobot:
    """A robot, and the parts behind it that a test may want to touch."""

    controller: Controller
    clock: VirtualClock | RealTimeClock
    world: World
    servo_board: SV203Emulator
    daq: DMM32Emulator
    distance: VL6180XEmulator


class SimulatedAttendant:
    """Counts interactions, for the noise, and lays the body down before each.

    Args:
        world: The world.
        noise: Drawn anew for each interaction.
        lays_down: Whether to put the body back on its belly.
    """

    def __init__(self, world: World, noise: Noise, *, lays_down: bool):
        self._world = world
        self._noise = noise
        self.lays_down = lays_down
        self._interactions = 0

    def attend(self) -> None:
        """Called at each interaction, once the joints are at zero."""
        self._interactions += 1
        self._noise.begin(self._interactions)
        if self.lays_down:
            self._world.lay_down()


@contextmanager
def simulated_robot(
    body: Body,
    *,
    seed: int,
    levels: NoiseLevels,
    real_time: bool,
    attendant: bool,
    log: logging.Logger,
) -> Iterator[SimulatedRobot]:
    """Builds a simulated robot; its control loop is not yet started.

    Args:
        body: The body.
        seed: Seed of the sensor noise.
        levels: Sensor noise.
        real_time: Whether time passes as on a wall clock instead of in lockstep with the loop.
        attendant: Whether somebody puts the body back on its belly before each interaction.
        log: Where to write what a person may want to know.
    """
    with ExitStack() as stack:
        world = stack.enter_context(World(body, log=log))
        noise = Noise(levels, seed)
        wiring = Wiring(body, world, noise)
        board = SV203Emulator()
        stack.callback(board.close)

        def advance(time: float) -> None:
            wiring.drive(board.pulses())
            world.advance_to(time)

        clock = RealTimeClock(advance) if real_time else VirtualClock(advance)
        daq = DMM32Emulator(wiring.volts, clock)
        distance = VL6180XEmulator(wiring.distance_mm, clock, reach_mm=int(1000 * (REACH + RECESS)))
        config = configure(body, port=board.port, levels=levels)
        devices = start_devices(
            config,
            Electronics(serial=open_serial(board.port), ports=daq, i2c=distance),
            clock,
        )
        stack.callback(devices.close)
        clock.synchronise = lambda: _synchronise(board, devices.servos.bytes_written)
        wiring.drive(board.pulses())
        world.lay_down()
        controller = build_controller(
            config,
            devices,
            clock=clock,
            attendant=SimulatedAttendant(world, noise, lays_down=attendant),
            housekeeping=HOUSEKEEPING if real_time else None,
            log=log,
        )
        yield SimulatedRobot(
            controller=controller,
            clock=clock,
            world=world,
            servo_board=board,
            daq=daq,
            distance=distance,
        )


def _synchronise(board: SV203Emulator, written: int) -> None:
    board.wait_until_read(written, SYNCHRONISE_TIMEOUT)
