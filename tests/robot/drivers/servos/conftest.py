from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.drivers.links.device_files import open_serial
from robot.drivers.servos.sv203 import SV203
from sim_robot.electronics.sv203 import SV203Emulator
from tests.robot.clocks import InstantClock
from tests.robot.drivers.servos.lines import Wire


@pytest.fixture
def servo_board() -> Iterator[SV203Emulator]:
    emulator = SV203Emulator()
    yield emulator
    emulator.close()


@pytest.fixture
def servos(servo_board: SV203Emulator, clock: InstantClock) -> Iterator[SV203]:
    driver = SV203(lambda: open_serial(servo_board.port, 9600), clock=clock)
    yield driver
    driver.close()


@pytest.fixture
def wire() -> Iterator[Wire]:
    bare = Wire()
    yield bare
    bare.close()
