"""The page on faults says what the tests test."""

from __future__ import annotations

from sim_robot.faults.fault_panel import KNOWN, FaultSpec
from tests.faults.devices import DEVICES
from tests.faults.document import PAGE, page
from tests.faults.pi_devices import GPIO_DEVICES, PI_DEVICES


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: make faults"


def test_every_fault_that_can_be_injected_is_in_the_matrix() -> None:
    matrix = {**DEVICES, **PI_DEVICES, **GPIO_DEVICES}
    tested = {FaultSpec.parse(row.injected).name for rows in matrix.values() for row in rows}
    assert tested == set(KNOWN)
