"""The findings of an examination."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from robot.errors import DeviceError

_SUBJECT_WIDTH: Final = 18


class Severity(StrEnum):
    """How bad it is; only ``BAD`` fails the examination."""

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
    """

    subject: str
    verdict: Severity
    text: str
    advice: str = ""

    def lines(self) -> Iterator[str]:
        """The finding as lines of text."""
        yield f"{self.verdict:<5} {self.subject:<{_SUBJECT_WIDTH}} {self.text}"
        if self.advice:
            yield f"{'':5} {'':{_SUBJECT_WIDTH}} -> {self.advice}"


def ok(subject: str, text: str) -> Finding:
    """A finding that all is well."""
    return Finding(subject=subject, verdict=Severity.OK, text=text)


def look(subject: str, text: str, advice: str) -> Finding:
    """A finding of something that works, and that somebody should know of."""
    return Finding(subject=subject, verdict=Severity.LOOK, text=text, advice=advice)


def bad(subject: str, text: str, advice: str) -> Finding:
    """A finding of something that does not work."""
    return Finding(subject=subject, verdict=Severity.BAD, text=text, advice=advice)


def failed(subject: str, error: DeviceError) -> Finding:
    """A finding of a device that failed."""
    return bad(subject, error.message, error.advice)
