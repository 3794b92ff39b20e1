"""Errors in what a simulated robot is given.

The tree::

    BodyschemaError
    ├── BodyError (ValueError)       a URDF file outside the subset
    ├── EngineError                  an engine that is not installed
    └── FaultError (ValueError)      a fault that cannot be injected, or nobody to inject it
"""

from __future__ import annotations

from protocol.errors import BodyschemaError


class BodyError(BodyschemaError, ValueError):
    """A URDF file that this simulator does not take; the message names file, element and reason."""

    def __init__(self, file: str, element: str, reason: str):
        self.file = file
        self.element = element
        self.reason = reason
        super().__init__(file, element, reason)  # as they came, so that it can be pickled

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.element, self.reason) if part)


class EngineError(BodyschemaError):
    """An engine that is not installed; the message says which is."""


class FaultError(BodyschemaError, ValueError):
    """A fault that cannot be injected as it was written; the message says what to write instead."""
