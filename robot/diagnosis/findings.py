"""The findings of an examination."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from robot.drivers.links.i2c import I2CLink
from robot.errors import DeviceError

_SUBJECT_WIDTH: Final = 18
_MOST_REPEATS: Final = 0.02  # share of transfers; three losses running stop the robot


class Severity(StrEnum):
    """How bad a finding is; only ``BAD`` fails the examination."""

    OK = "ok"
    LOOK = "look"
    BAD = "BAD"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A finding about one device, joint or sensor.

    Attributes:
        subject: What was looked at.
        verdict: How bad it is.
        text: What was observed.
        advice: What to check; empty when all is well.
        part: Part whose calibration the advice ends with; empty for none.
    """

    subject: str
    verdict: Severity
    text: str
    advice: str = ""
    part: str = ""

    def lines(self, calibration_command: Callable[[str], str]) -> Iterator[str]:
        """The finding as lines of text, given what returns the command that calibrates a part."""
        yield f"{self.verdict:<5} {self.subject:<{_SUBJECT_WIDTH}} {self.text}"
        if self.advice:
            command = f" {calibration_command(self.part)}" if self.part else ""
            yield f"{'':5} {'':{_SUBJECT_WIDTH}} -> {self.advice}{command}"


def ok(subject: str, text: str) -> Finding:
    """A finding that all is well."""
    return Finding(subject=subject, verdict=Severity.OK, text=text)


def look(subject: str, text: str, advice: str, part: str = "") -> Finding:
    """A finding of something that works, and that somebody should know of."""
    return Finding(subject=subject, verdict=Severity.LOOK, text=text, advice=advice, part=part)


def bad(subject: str, text: str, advice: str, part: str = "") -> Finding:
    """A finding of something that does not work."""
    return Finding(subject=subject, verdict=Severity.BAD, text=text, advice=advice, part=part)


def failed(subject: str, error: DeviceError) -> Finding:
    """A finding of a device that failed."""
    return bad(subject, error.message, error.advice)


def with_repeats(finding: Finding, device: object) -> Finding:
    """A finding of a device, with how many of its transfers on an I²C bus had to be repeated.

    Args:
        finding: What was observed.
        device: The driver, which has its ``I2CLink`` as ``link``, or is on no such bus.
    """
    link: I2CLink | None = getattr(device, "link", None)
    if link is None or finding.verdict is Severity.BAD:
        return finding
    text = f"{finding.text}; {link.repeats} of {link.transfers} transfers repeated"
    if not link.repeats:
        return replace(finding, text=text)
    return replace(
        finding,
        verdict=Severity.BAD if link.repeats > _MOST_REPEATS * link.transfers else Severity.LOOK,
        text=text,
        advice="Acknowledges are lost: use short wires and a common ground, away from the wires of "
        f"the motors. {finding.advice}".rstrip(),
    )
