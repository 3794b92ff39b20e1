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


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--baud", "56700"], "feetech has 38400, 57600, "),
        (["--baud", "38400", "--servos", "dynamixel"], "dynamixel has 9600, 57600, "),
    ],
)
def test_a_baud_rate_that_no_servo_has_is_refused_before_the_port_is_opened(
    options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scan", "/dev/nothing", *options]) == 1
    said = capsys.readouterr().err
    assert f"--baud {options[1]} is no rate of these servos: {words}" in said
    assert ("feetech" in said) == ("--servos" not in options)


def test_servos_that_report_a_fault_are_listed_too(
    bus: BusServos,  # type: ignore[type-arg]
    capsys: pytest.CaptureFixture[str],
) -> None:
    bus.inject("dip")
    assert main(["scan", bus.port, "--ids", "3", "--baud", "1000000"]) == 0
    assert capsys.readouterr().out.endswith("1000000 baud: 1, 3\n")
