"""How messages and the records in them are declared: each field with its check.

A record that breaks a check cannot exist, whether it was built here or came over the wire.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Self, TypeVar

from protocol.errors import LocalProtocolError
from protocol.wire import field_checks

R = TypeVar("R", bound="Record")


def checked(check: Any) -> Any:
    """A required field with its check, which may normalise the value."""
    return field(metadata={"check": check})


def checked_optional(check: Any) -> Any:
    """A field that may be absent."""
    return field(default=None, metadata={"check": field_checks.optional(check)})


def nested(kind: type[R]) -> Callable[[str, Any], R]:
    """A check for a record, or for the map that describes one."""

    def check(name: str, value: Any) -> R:
        try:
            return value if isinstance(value, kind) else kind.from_map(value)
        except LocalProtocolError as error:
            raise LocalProtocolError(f"{name}: {error}") from None

    return check


@dataclass(frozen=True, kw_only=True)
class Record:
    """Base of everything with named fields that goes over the wire."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = item.metadata["check"](item.name, getattr(self, item.name))
            object.__setattr__(self, item.name, value)  # the frozen dataclass's own way

    @classmethod
    def from_map(cls, values: Any) -> Self:
        """The record that a decoded map describes; unknown keys are ignored.

        Raises:
            LocalProtocolError: It is no map, or a field is missing or fails its check; the message
                names the field.
        """
        if not isinstance(values, Mapping):
            raise LocalProtocolError(f"must be a map, not {values!r:.60}")
        known = fields(cls)
        missing = [
            item.name for item in known if item.default is MISSING and item.name not in values
        ]
        if missing:
            raise LocalProtocolError(f"missing {', '.join(missing)}")
        return cls(**{item.name: values[item.name] for item in known if item.name in values})

    def to_map(self) -> dict[str, Any]:
        """The record as a map that can be encoded; absent fields are left out."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {name: _plain(value) for name, value in values.items() if value is not None}


@dataclass(frozen=True, kw_only=True)
class Message(Record):
    """Base of all messages; ``TYPE`` is what ``type`` says on the wire."""

    TYPE: ClassVar[str]

    def to_map(self) -> dict[str, Any]:
        """The message as a map that can be encoded; absent fields are left out."""
        return {"type": self.TYPE, **super().to_map()}


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return value.to_map()
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
