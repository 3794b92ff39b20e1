"""How a message is declared: its fields, and a check for each; an illegal one cannot exist."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from protocol.wire import field_checks
from protocol.wire.capabilities import Capabilities


def checked(check: Any) -> Any:
    """A field that must be there and pass a check, which may normalise it."""
    return field(metadata={"check": check})


def checked_optional(check: Any) -> Any:
    """A field that may be absent."""
    return field(default=None, metadata={"check": field_checks.optional(check)})


def _set(instance: Any, name: str, value: object) -> None:
    object.__setattr__(instance, name, value)  # the only way to normalise a frozen dataclass


@dataclass(frozen=True, kw_only=True)
class Message:
    """Base of all messages; subclasses declare a check for each field."""

    TYPE: ClassVar[str]

    def __post_init__(self) -> None:
        for item in fields(self):
            _set(self, item.name, item.metadata["check"](item.name, getattr(self, item.name)))

    def to_map(self) -> dict[str, Any]:
        """The message as it goes into msgpack; absent fields are left out."""
        found: dict[str, Any] = {"type": self.TYPE}
        for item in fields(self):
            value = getattr(self, item.name)
            if value is None:
                continue
            if isinstance(value, Capabilities):
                value = value.to_map()
            found[item.name] = list(value) if isinstance(value, tuple) else value
        return found
