"""What a check of a robot or of a problem finds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Fitness(Enum):
    """How serious the result of a check is."""

    FINE = "fine"
    NOTE = "note"
    BAD = "bad"


@dataclass(frozen=True)
class ExaminedItem:
    """The result of one check."""

    subject: str
    verdict: Fitness
    sentence: str


def fine(subject: str, sentence: str) -> ExaminedItem:
    """A finding that all is well."""
    return ExaminedItem(subject, Fitness.FINE, sentence)


def note(subject: str, sentence: str) -> ExaminedItem:
    """A finding that hinders nothing, and that somebody should know of."""
    return ExaminedItem(subject, Fitness.NOTE, sentence)


def bad(subject: str, sentence: str) -> ExaminedItem:
    """A finding that hinders."""
    return ExaminedItem(subject, Fitness.BAD, sentence)
