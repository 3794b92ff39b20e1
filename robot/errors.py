"""The errors of the robot's side.

The tree::

    BodyschemaError
    ├── ConfigError (ValueError)     a file of the robot is wrong: robot.toml, calibration
    ├── AbandonedError               somebody left a guided session before its end
    ├── CommandError (ValueError)    you asked a driver for what its device cannot do
    └── DeviceError                  a device failed; the robot freezes until a person clears it
        ├── DeviceMissingError       nothing answers: unplugged, unpowered, wrong address
        ├── DeviceTimeoutError       it is there and did not finish in time
        ├── DeviceDataError          it answered nonsense
        └── DriverError              its driver raised what no driver may raise

``DeviceTimeoutError`` is no ``TimeoutError`` on purpose: that one is an ``OSError``, so every
handler for a failed link would swallow it.
"""

from __future__ import annotations

from protocol.errors import BodyschemaError
from protocol.text import brief, error_text


class ConfigError(BodyschemaError, ValueError):
    """A file of the robot says something impossible.

    Attributes:
        file: The file, as the user named it.
        key: Where in the file, such as ``joints.hip_left.lower``; empty for the whole file.
        reason: What is wrong and what to write instead.
    """

    def __init__(self, reason: str, *, file: str = "", key: str = ""):
        self.file = file
        self.key = key
        self.reason = reason
        super().__init__(": ".join(part for part in (file, key, reason) if part))


class AbandonedError(BodyschemaError):
    """Somebody left a guided session: the robot holds; what was measured before is written."""


class CommandError(BodyschemaError, ValueError):
    """A driver was asked for something that its device cannot do (servo output 9, count 300)."""


class DeviceError(BodyschemaError):
    """A device failed.

    Attributes:
        message: What happened, one sentence; cut by ``brief``, for it may quote foreign
            libraries and drivers.
        advice: What to check, one sentence; cut by ``brief``, too.
    """

    def __init__(self, message: str, advice: str):
        self.message = brief(message)
        self.advice = brief(advice)
        super().__init__(f"{self.message} {self.advice}")


class DeviceMissingError(DeviceError):
    """Nothing answers: cable pulled, power off, wrong port or address, no permission."""


class DeviceTimeoutError(DeviceError):
    """The device is there but did not finish in time: no reply, a busy flag that stays on."""


class DeviceDataError(DeviceError):
    """The device answered nonsense: garbage on the line, FIFO overflow, an error code."""


class DriverError(DeviceError):
    """A driver raised what no driver may raise: anything but a ``DeviceError``."""

    @classmethod
    def of(cls, device: str, doing: str, cause: BaseException) -> DriverError:
        """Returns the error for a device, the driver's method that failed, and what that raised."""
        return cls(
            f"The driver of the {device} failed in {doing}: {error_text(cause)}.",
            "This is a mistake in the driver: tell whoever wrote it.",
        )
