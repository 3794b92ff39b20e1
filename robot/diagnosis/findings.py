"""What was found about one thing."""

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
    """What was found.

    Attributes:
        subject: What was looked at.
        verdict: How bad it is.
        text: What was found.
        advice: What to check; empty when all is well.
    """

    subject: str
    verdict: Severity
    text: str
    advice: str = ""

    def lines(self) -> Iterator[str]:
        """As a person reads it."""
        yield f"{self.verdict:<5} {self.subject:<{_SUBJECT_WIDTH}} {self.text}"
        if self.advice:
            yield f"{'':5} {'':{_SUBJECT_WIDTH}} -> {self.advice}"


def ok(subject: str, text: str) -> Finding:
    """All is well."""
    return Finding(subject=subject, verdict=Severity.OK, text=text)


def look(subject: str, text: str, advice: str) -> Finding:
    """Works, but somebody should know."""
    return Finding(subject=subject, verdict=Severity.LOOK, text=text, advice=advice)


def bad(subject: str, text: str, advice: str) -> Finding:
    """Does not work."""
    return Finding(subject=subject, verdict=Severity.BAD, text=text, advice=advice)


def failed(subject: str, error: DeviceError) -> Finding:
    """A device failed."""
    return bad(subject, error.message, error.advice)
