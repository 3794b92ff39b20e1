"""Faults to inject: which one, from when on, for how long.

A fault is written ``DEVICE.FAULT[=N[:AMOUNT]][@START][+DURATION]``, for instance
``servo_board.unplugged``, ``daq.stuck_channel=3@2i``, ``distance.nak@12.5s+3i``, ``body.cut=2:50``.

* ``DEVICE.FAULT`` is one of ``KNOWN``, N its number and AMOUNT its amount, where it needs them.
* START is ``3i``, at the zero pose of the third interaction, or ``12.5s``, at that robot time.
  Without it the fault begins at once.
* DURATION is ``2i`` (interactions), ``5s`` (robot time) or ``5w`` (seconds on the wall; virtual
  time stands still in a robot that is down, so it never ends a fault there). Without it a fault
  lasts until it is mended; those that happen once have none.
"""

from __future__ import annotations

import difflib
import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from robot.errors import CommandError
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.clock import HostClock
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.dynamixel import DynamixelEmulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.feetech import FeetechEmulator
from sim_robot.electronics.gpio import GPIOEmulator
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.sensors import Sensors
from sim_robot.electronics.servos import Servos
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.errors import FaultError
from sim_robot.faults.world_faults import Damage, Ground

DEVICES: Final[Mapping[str, type[FaultSwitch]]] = MappingProxyType(
    {
        "servo_board": SV203Emulator,
        "servos": Servos,
        "feetech": FeetechEmulator,
        "daq": DMM32Emulator,
        "pwm": PCA9685Emulator,
        "dynamixel": DynamixelEmulator,
        "adc": ADS1115Emulator,
        "accelerometer": MPU6050Emulator,
        "distance": VL6180XEmulator,
        "i2c": I2CBus,
        "gpio": GPIOEmulator,
        "clock": HostClock,
        "sensors": Sensors,
        "body": Damage,
        "ground": Ground,
    }
)
"""What can fail, by its name in a fault."""

KNOWN: Final[Mapping[str, str]] = MappingProxyType(
    {
        f"{device}.{name}": fault.effect
        for device, kind in DEVICES.items()
        for name, fault in kind.FAULTS.items()
    }
)
"""Every fault and what it does."""

_SPEC: Final = re.compile(
    r"(?P<name>\w+\.\w+)"
    r"(?:=(?P<value>-?\d{1,9})(?::(?P<amount>-?\d{1,6}(?:\.\d{1,6})?))?)?"
    r"(?:@(?P<start>\d+(?:\.\d+)?[si]))?"
    r"(?:\+(?P<duration>\d+(?:\.\d+)?[siw]))?"
)


@dataclass(frozen=True)
class Span:
    """A time or a duration: in s of robot time (s), interactions (i) or s on the wall (w)."""

    amount: float
    unit: str

    @classmethod
    def parse(cls, text: str | None) -> Span | None:
        """Reads ``12.5s``, ``3i`` or ``5w``; ``None`` stays ``None``."""
        return None if text is None else cls(float(text[:-1]), text[-1])

    def __str__(self) -> str:
        return f"{self.amount:g}{self.unit}"


@dataclass(frozen=True)
class FaultSpec:
    """One fault to inject; the module says what its parts mean."""

    device: str
    fault: str
    value: int = 0
    amount: float = 0.0
    start: Span | None = None
    duration: Span | None = None

    @classmethod
    def parse(cls, text: str) -> FaultSpec:
        """Reads a fault as it is written.

        Raises:
            FaultError: It is no fault as written; the message says what to write instead.
        """
        match = _SPEC.fullmatch(text)
        if match is None:
            raise FaultError(
                f"{text!r} is no fault: write DEVICE.FAULT[=N[:AMOUNT]][@START][+DURATION], for "
                "instance daq.stuck_channel=3@2i+10s."
            )
        name = check_name(match["name"])
        device, _, fault = name.partition(".")
        duration = Span.parse(match["duration"])
        if duration is not None and DEVICES[device].FAULTS[fault].once:
            raise FaultError(f"{text!r}: {name} happens once, so leave out the duration.")
        return cls(
            device,
            fault,
            int(match["value"] or 0),
            float(match["amount"] or 0),
            Span.parse(match["start"]),
            duration,
        )

    @property
    def name(self) -> str:
        """Device and fault, as in ``daq.absent``."""
        return f"{self.device}.{self.fault}"

    def __str__(self) -> str:
        number = f"={self.value}" if self.value else ""
        number += f":{self.amount:g}" if self.amount else ""
        start = f"@{self.start}" if self.start else ""
        return f"{self.name}{number}{start}{f'+{self.duration}' if self.duration else ''}"


def check_name(name: str) -> str:
    """Returns a fault's name, if there is such a fault.

    Raises:
        FaultError: There is no such fault; the message names one that is spelt like it, or all.
    """
    if name not in KNOWN:
        similar = difflib.get_close_matches(name, KNOWN, n=1)
        hint = f"did you mean {similar[0]}?" if similar else f"known are {', '.join(KNOWN)}."
        raise FaultError(f"There is no fault {name!r}: {hint}")
    return name


class FaultPanel:
    """Injects faults when they are due and mends them when their time is over.

    The control loop says how time goes on (``advance``, ``begin_interaction``); everything else may
    be called from any thread.

    Args:
        devices: What can fail here, by the names of ``DEVICES``.
        now: Tells the robot time, s.
    """

    def __init__(self, devices: Mapping[str, FaultSwitch], now: Callable[[], float]):
        self.interactions = 0
        self._devices = devices
        self._now = now
        self._lock = threading.RLock()
        self._waiting: list[FaultSpec] = []
        self._endings: dict[str, Span] = {}  # in absolute terms, by the fault's name
        self._timers: dict[str, threading.Timer] = {}  # ends on the wall, by the fault's name

    def order(self, spec: FaultSpec) -> None:
        """Injects a fault, at once or when it is due.

        Raises:
            FaultError: This robot has no such device, or the fault no such number or amount.
        """
        if spec.device not in self._devices:
            raise FaultError(f"This robot has no {spec.device}; it has {', '.join(self._devices)}.")
        try:
            self._devices[spec.device].check(spec.fault, spec.value, spec.amount)
        except CommandError as error:
            raise FaultError(f"{spec.device}.{error}.") from None
        with self._lock:
            self._waiting.append(spec)
            self._apply_due()

    def mend(self, name: str | None = None) -> None:
        """Ends a fault, or all of them; also those that have not begun.

        Raises:
            FaultError: There is no such fault.
        """
        if name is not None:
            check_name(name)
        with self._lock:
            self._waiting = [spec for spec in self._waiting if name not in (None, spec.name)]
            for ending in {*self._endings, *self._timers}:
                if name in (None, ending):
                    self._drop_ending(ending)
            for device, switch in self._devices.items():
                for fault in switch.faults:
                    if name in (None, f"{device}.{fault}"):
                        switch.mend(fault)

    def active(self) -> list[str]:
        """The faults that are on, with their numbers."""
        return [
            str(FaultSpec(device, fault, value, switch.amount(fault)))
            for device, switch in self._devices.items()
            for fault, value in switch.faults.items()
        ]

    def waiting(self) -> list[str]:
        """The faults that have not begun."""
        with self._lock:
            return [str(spec) for spec in self._waiting]

    def advance(self) -> None:
        """Injects and mends what is due; called when robot time has advanced."""
        if self._waiting or self._endings:
            with self._lock:
                self._apply_due()

    def begin_interaction(self) -> None:
        """Counts interactions; called when one begins, in the zero pose."""
        with self._lock:
            self.interactions += 1
            self._apply_due()

    def close(self) -> None:
        """Cancels the faults that have not begun, and the ends of the others."""
        with self._lock:
            self._waiting.clear()
            for name in {*self._endings, *self._timers}:
                self._drop_ending(name)

    def _apply_due(self) -> None:
        for spec in [spec for spec in self._waiting if self._reached(spec.start)]:
            self._waiting.remove(spec)
            self._begin(spec)
        for name in [name for name, end in self._endings.items() if self._reached(end)]:
            self._end(name)

    def _reached(self, when: Span | None) -> bool:
        if when is None:
            return True
        reached = self.interactions if when.unit == "i" else self._now()
        return reached >= when.amount

    def _begin(self, spec: FaultSpec) -> None:
        self._drop_ending(spec.name)  # that of the fault whose place this one takes
        self._devices[spec.device].inject(spec.fault, spec.value, spec.amount)
        duration = spec.duration
        if duration is None:
            return
        if duration.unit == "w":
            timer = threading.Timer(duration.amount, self._time_out, [spec.name])
            timer.daemon = True
            self._timers[spec.name] = timer
            timer.start()
        else:
            start = self.interactions if duration.unit == "i" else self._now()
            self._endings[spec.name] = Span(start + duration.amount, duration.unit)

    def _time_out(self, name: str) -> None:
        with self._lock:
            if self._timers.get(name) is threading.current_thread():  # else cancelled too late
                self._end(name)

    def _end(self, name: str) -> None:
        self._drop_ending(name)
        device, _, fault = name.partition(".")
        self._devices[device].mend(fault)

    def _drop_ending(self, name: str) -> None:
        self._endings.pop(name, None)
        timer = self._timers.pop(name, None)
        if timer is not None:
            timer.cancel()
