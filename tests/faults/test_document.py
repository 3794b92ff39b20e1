"""The published fault matrix says what the tests test."""

from __future__ import annotations

from sim_robot.faults.fault_panel import KNOWN, FaultSpec
from tests.faults.devices import DEVICES
from tests.faults.document import FILE, matrix
from tests.faults.pi_devices import PI_DEVICES


def test_the_file_is_current() -> None:
    assert FILE.read_text(encoding="utf-8") == matrix(), "run: make faults"


def test_every_fault_that_can_be_injected_is_in_the_matrix() -> None:
    rows_of = {**DEVICES, **PI_DEVICES}
    tested = {FaultSpec.parse(row.injected).name for rows in rows_of.values() for row in rows}
    assert tested == set(KNOWN)
