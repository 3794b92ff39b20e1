"""Findings as a person reads them."""

from __future__ import annotations

from robot.diagnosis.findings import Severity, bad, failed, look, ok
from robot.errors import DeviceTimeoutError


def test_a_finding_that_is_well_is_one_line() -> None:
    (line,) = ok("servo board", "answers").lines(str.upper)
    assert line.split() == ["ok", "servo", "board", "answers"]


def test_whatever_is_wrong_says_what_to_check() -> None:
    for finding in (bad("touch", "is dead", "Look."), look("touch", "is odd", "Look.")):
        first, second = finding.lines(str.upper)
        assert first.startswith(finding.verdict)
        assert second.strip() == "-> Look."


def test_what_needs_calibration_ends_with_the_command_for_that() -> None:
    _, advice = bad("touch", "is odd", "Look; then:", "foot").lines(str.upper)
    assert advice.strip() == "-> Look; then: FOOT"


def test_a_device_error_becomes_a_bad_finding_with_its_advice() -> None:
    finding = failed("distance", DeviceTimeoutError("It is late.", "Wait."))
    assert (finding.verdict, finding.text, finding.advice) == (Severity.BAD, "It is late.", "Wait.")
