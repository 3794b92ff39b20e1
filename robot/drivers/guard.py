"""Guards the callers of a driver: against what it raises or returns, and against its hanging.

A driver may come from anywhere. What it raises besides a ``DeviceError`` or a ``CommandError``
becomes a ``DeviceError``, ``SystemExit`` included, which would end a thread or the whole program in
silence; a number that is not finite, which compares as false with every threshold, is never taken
for a reading; and while a driver does not return, others can tell which one it is.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, Protocol

from robot.drivers.servos.servo_bus import ServoState
from robot.errors import CommandError, DeviceDataError, DeviceError, DeviceTimeoutError, DriverError

CLOSING: Final = 1.0
"""Seconds that a driver may take to close."""


class Settings(Protocol):
    """The settings of any driver."""

    @property
    def name(self) -> str:
        """Name of the device, for messages."""

    @property
    def open(self) -> Callable[..., Any]:
        """Opens the link."""


def open_driver(settings: Settings, *where: Any) -> Any:
    """Opens a device, and guards its driver.

    The guarded driver has the attributes of the driver, which may also be set and deleted there.

    Args:
        settings: Settings of the driver.
        where: Arguments of ``settings.open``.

    Raises:
        DeviceError: The device cannot be opened.
    """
    return _Guarded(_call(settings.name, "open", settings.open, *where), settings.name)


def under_way(thread: int | None) -> str:
    """Says which method of which driver a thread waits in, as a clause; empty if in none."""
    waiting = _under_way.get(thread or 0)
    return f"the driver of the {waiting[0]} does not return from {waiting[1]}" if waiting else ""


_under_way: Final[dict[int, tuple[str, str]]] = {}  # by thread: name of the device, method


class _Guarded:
    def __init__(self, driver: Any, name: str):
        vars(self).update(_driver=driver, _name=name)

    def __getattr__(self, attribute: str) -> Any:
        member = getattr(self._driver, attribute)
        if not callable(member):
            return member
        if attribute == "close":
            return lambda: _close(self._name, member)

        def guarded(*values: Any, **named: Any) -> Any:
            result = _call(self._name, attribute, member, *values, **named)
            check = _CHECKS.get(attribute)
            return result if check is None else check(self._name, result)

        return guarded

    def __setattr__(self, attribute: str, value: Any) -> None:
        setattr(self._driver, attribute, value)

    def __delattr__(self, attribute: str) -> None:
        delattr(self._driver, attribute)


def _call(device: str, doing: str, method: Callable[..., Any], *values: Any, **named: Any) -> Any:
    thread = threading.get_ident()
    outer = _under_way.get(thread)
    _under_way[thread] = device, doing
    try:
        return method(*values, **named)
    except (DeviceError, CommandError):
        raise
    except KeyboardInterrupt as error:
        if threading.current_thread() is threading.main_thread():  # Ctrl-C
            raise
        raise DriverError.of(device, doing, error) from error
    except BaseException as error:
        raise DriverError.of(device, doing, error) from error
    finally:
        if outer is None:
            del _under_way[thread]
        else:
            _under_way[thread] = outer


def _close(device: str, method: Callable[[], Any]) -> None:
    """Closes a driver; waits no longer than ``CLOSING``, for whoever closes wants to leave.

    Raises:
        DeviceError: Closing failed, or did not return.
    """
    failures: list[BaseException] = []

    def close() -> None:
        try:
            _call(device, "close", method)
        except (DeviceError, CommandError) as error:
            failures.append(error)

    thread = threading.Thread(target=close, name="closing", daemon=True)
    thread.start()
    thread.join(CLOSING)
    if thread.is_alive():
        raise DeviceTimeoutError(
            f"The driver of the {device} does not return from close.",
            "Look whether the device still answers; this is a mistake in the driver, too.",
        )
    if failures:
        raise failures[0]


def _number(device: str, value: Any) -> float:
    try:
        number = math.nan if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise DeviceDataError(
            f"The {device} gave {value!r:.60} for a reading, which is no finite number.",
            "Check its wires and supply; if they are sound, its driver is wrong.",
        )
    return number


def _numbers(device: str, values: Any) -> list[float]:
    try:
        parts = list(values)
    except TypeError:
        parts = [math.nan]
    return [_number(device, part) for part in parts]


def _axes(device: str, values: Any) -> tuple[float, ...]:
    axes = tuple(_numbers(device, values))
    if len(axes) != 3:
        raise DeviceDataError(
            f"The {device} gave {len(axes)} axes instead of 3.", "Its driver is wrong."
        )
    return axes


def _counts(device: str, counts: Any) -> dict[int, int]:
    if isinstance(counts, Mapping) and all(isinstance(count, int) for count in counts.values()):
        return dict(counts)
    raise DeviceDataError(
        f"The {device} gave {counts!r:.60} for its counts, which are not integers by output.",
        "Its driver is wrong.",
    )


def _states(device: str, states: Any) -> dict[int, ServoState]:
    if not isinstance(states, Mapping) or not all(
        isinstance(output, int) and isinstance(state, ServoState)
        for output, state in states.items()
    ):
        raise DeviceDataError(
            f"The {device} gave {states!r:.60} for what its servos say, which is not a ServoState "
            "by output.",
            "Its driver is wrong.",
        )
    for state in states.values():
        measured = (state.position, state.load, state.voltage, state.temperature, state.current)
        _numbers(device, [value for value in measured if value is not None])
    return dict(states)


_CHECKS: Final[Mapping[str, Callable[[str, Any], Any]]] = MappingProxyType(
    {
        "acceleration": _axes,
        "raw": _axes,
        "load": lambda device, load: load if isinstance(load, bool) else _number(device, load),
        "distance": lambda device, value: None if value is None else _number(device, value),
        "scan": _numbers,
        "read_counts": _counts,
        "read_states": _states,
        "seconds_for": _number,
    }
)
"""Check of the value that a driver's method returned, by the method's name."""
