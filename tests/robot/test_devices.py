"""Devices opened by a configuration: closed if one fails, and revived after a fault."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import NoReturn

import pytest

from bench.still_robot import StillPi, StillRobot, example_config, still_pi, still_robot
from robot.configuration.robot_config import RobotConfig
from robot.devices import Devices, open_devices, revive
from robot.drivers.buses import Buses
from robot.drivers.links.i2c import I2CBus
from robot.drivers.servos.sv203 import SV203Settings
from robot.errors import DeviceError, DeviceMissingError, DriverError
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.sv203 import SV203Emulator
from tests.robot.calibration.desk import Board
from tests.robot.clocks import InstantClock
from tests.robot.sensing.resting import Leaning


class Unreadable(SV203Settings):
    reads_back = False


@dataclass
class Servos(Board):
    """Servos in memory whose link may be dead, and that count how often it was opened anew."""

    dead: bool = False
    reopened: list[None] = field(default_factory=list)

    def read_counts(self, outputs: object) -> dict[int, int]:
        if self.dead:
            raise DeviceMissingError("The link is dead.", "Plug it in.")
        return {}

    def reopen(self) -> None:
        self.reopened.append(None)


def config(*, reads_back: bool = True) -> RobotConfig:
    settings = SV203Settings if reads_back else Unreadable
    servos = settings(port="", baud=9600, boards=(1,), line_gap=0.003)
    return replace(example_config(""), servos=servos)


@pytest.mark.parametrize(
    ("dead", "reads_back", "reopened"), [(False, True, 0), (True, True, 1), (False, False, 1)]
)
def test_a_link_is_opened_anew_unless_it_is_known_to_work(
    dead: bool, reads_back: bool, reopened: int
) -> None:
    servos = Servos(dead=dead)
    devices = Devices(servos=servos, inputs=None, accelerometer=Leaning(), touch=(), distance=None)
    revive(config(reads_back=reads_back), devices)
    assert len(servos.reopened) == reopened


def test_what_was_opened_is_closed_when_a_later_device_fails() -> None:
    def no_bus(path: str) -> I2CBus:
        raise DeviceMissingError(f"There is no {path}.", "Load i2c-dev.")

    board, closed = SV203Emulator(), []
    clock = InstantClock()
    daq = DMM32Emulator(lambda channel: 2.5, clock)
    daq.close = lambda: closed.append("daq")  # type: ignore[method-assign]
    buses = Buses(clock=clock, open_ports=lambda base: daq, open_i2c=no_bus)
    try:
        with pytest.raises(DeviceError, match="/dev/i2c-1"):
            open_devices(example_config(board.port), buses)
        assert closed == ["daq"]
        buses.open_serial(board.port, 9600).close()  # exclusive: nobody else has it open
    finally:
        board.close()


@pytest.mark.parametrize("build", [still_robot, still_pi])
def test_an_adapter_that_was_plugged_in_again_is_opened_anew(
    build: Callable[..., AbstractContextManager[StillRobot | StillPi]],
) -> None:
    """Of each driver on its bus, once, under the same name; nothing is left open."""
    with build(InstantClock(), housekeeping=None, log=logging.getLogger("test")) as robot:
        bus, opened = robot.bus, len(robot.bus.handles)
        bus.inject("unplugged")
        assert robot.devices.distance is not None
        with pytest.raises(DeviceMissingError, match="is gone"):
            robot.devices.distance.distance()
        for _ in range(3):
            robot.devices.servos.forget()
            with pytest.raises(DeviceMissingError, match="cannot be opened"):
                revive(robot.config, robot.devices)
            assert not bus.handles  # one that is open would keep its number
        bus.mend()
        for _ in range(3):
            robot.devices.servos.forget()
            revive(robot.config, robot.devices)
        assert robot.devices.distance.distance() is not None
        robot.devices.servos.read_counts([joint.output for joint in robot.config.joints])
        assert len(bus.handles) == opened
    assert not bus.handles


def test_ports_are_opened_anew_too() -> None:
    """Meanwhile a kernel driver may have claimed them, or given them back."""
    with still_robot(InstantClock(), housekeeping=None, log=logging.getLogger("test")) as robot:
        opened: list[int] = []

        def open_ports(base: int) -> DMM32Emulator:
            opened.append(base)
            if len(opened) == 2:
                raise DeviceMissingError("The ports belong to a driver.", "Unload it.")
            return robot.daq

        buses = replace(robot.buses, open_ports=open_ports)
        robot.servos.close()
        devices = open_devices(robot.config, buses)
        with pytest.raises(DeviceMissingError, match="Unload it"):
            revive(robot.config, devices)
        revive(robot.config, devices)
        assert opened == [0x300] * 3
        devices.close()


def test_a_driver_that_leaves_while_it_is_opened_is_named_with_its_table() -> None:
    def leave(path: str, baud: int) -> NoReturn:
        raise SystemExit(0)

    buses = Buses(clock=InstantClock(), open_serial=leave)
    with pytest.raises(
        DriverError, match=r"robot\.toml: servos: .*SV203 failed in open: SystemExit"
    ):
        open_devices(config(), buses, file="robot.toml")
