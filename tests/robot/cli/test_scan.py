"""``robotd scan`` on emulated servos."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.cli.command_line import main
from sim_robot.electronics.bus_servos import BusServos
from sim_robot.electronics.dynamixel import DynamixelEmulator
from sim_robot.electronics.feetech import BAUD, FeetechEmulator


@pytest.fixture(params=[FeetechEmulator, DynamixelEmulator])
def bus(request: pytest.FixtureRequest) -> Iterator[BusServos]:  # type: ignore[type-arg]
    emulator = request.param((1, 3))
    yield emulator
    emulator.close()


def test_every_id_that_answers_is_listed_with_its_baud_rate(
    bus: BusServos,  # type: ignore[type-arg]
    capsys: pytest.CaptureFixture[str],
) -> None:
    if isinstance(bus, FeetechEmulator):
        bus.servos[1].memory[BAUD] = 4
        lines = ["feetech, 1000000 baud: 1", "feetech, 115200 baud: 3"]
    else:
        lines = ["dynamixel, 1000000 baud: 1, 3"]
    assert main(["scan", bus.port, "--ids", "3"]) == 0
    assert capsys.readouterr().out.splitlines() == lines


def test_a_line_without_servos_is_a_sentence(
    bus: BusServos,  # type: ignore[type-arg]
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["scan", bus.port, "--ids", "2", "--baud", "57600"]) == 1
    assert f"No servo answers on {bus.port}." in capsys.readouterr().err
