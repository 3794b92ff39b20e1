"""Formats of a report by name: what ``estimator show --format`` prints.

A format of another package belongs to the entry-point group ``bodyschema.report``.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import MappingProxyType
from typing import Final, Protocol

from estimator.plugins import Registry
from estimator.report.result import Result


class Format(Protocol):
    """Writes a report; any function of this form will do."""

    def __call__(self, result: Result, directory: Path) -> str:
        """Returns the report as text.

        Args:
            result: The run in numbers.
            directory: The run directory, whose derived files are up to date if it can be written.
        """


def as_json(result: Result, directory: Path) -> str:
    """The content of ``result.json``, in ASCII, so that a terminal can show any name."""
    del directory
    return json.dumps(json.loads(result.model_dump_json()), indent=2)


FORMATS: Final[Registry[Format]] = Registry(
    kind="report format",
    group="bodyschema.report",
    own=MappingProxyType({"json": "estimator.report.formats:as_json"}),
)
