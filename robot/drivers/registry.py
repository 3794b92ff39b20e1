"""Which drivers there are: ours, and those that other distributions bring.

A distribution offers a driver by an entry point, as in ``docs/extending.md``, whose name is what
``robot.toml`` calls it; a sensor's name begins with its table: ``accelerometer``, ``touch``,
``distance`` or ``daq``. A module is imported only when a configuration names its driver. No
distribution can replace ours.
"""

from __future__ import annotations

from importlib import metadata
from types import MappingProxyType
from typing import Any, Final

from protocol.text import error_text
from robot.errors import ConfigError
from robot.toml_sections import Section

SERVOS: Final = "bodyschema.servos"
SENSORS: Final = "bodyschema.sensors"

OURS: Final = MappingProxyType(
    {
        SERVOS: MappingProxyType(
            {
                "sv203": "robot.drivers.servos.sv203:SV203Settings",
                "pca9685": "robot.drivers.servos.pca9685:PCA9685Settings",
                "feetech": "robot.drivers.servos.feetech:FeetechSettings",
                "dynamixel": "robot.drivers.servos.dynamixel:DynamixelSettings",
            }
        ),
        SENSORS: MappingProxyType(
            {
                "daq.dmm32": "robot.drivers.sensors.dmm32:DMM32Settings",
                "daq.comedi": "robot.drivers.sensors.comedi:ComediSettings",
                "daq.ads1115": "robot.drivers.sensors.ads1115:ADS1115Settings",
                "accelerometer.mpu6050": "robot.drivers.sensors.mpu6050:MPU6050Settings",
                "accelerometer.analogue": "robot.drivers.sensors.analogue:AnalogueAxes",
                "touch.switch": "robot.drivers.sensors.analogue:SwitchSettings",
                "touch.gpio": "robot.drivers.sensors.gpio:GPIOSwitchSettings",
                "touch.analogue": "robot.drivers.sensors.analogue:StrainGauge",
                "distance.vl6180x": "robot.drivers.sensors.vl6180x:VL6180XSettings",
            }
        ),
    }
)
"""Entry-point group → name → module and class."""


def installed() -> list[metadata.EntryPoint]:
    """Entry points of all drivers, ours first, without a ``dist``; a name may be offered twice."""
    points: list[metadata.EntryPoint] = []
    for group, ours in OURS.items():
        points += [metadata.EntryPoint(name, value, group) for name, value in ours.items()]
        points += metadata.entry_points(group=group)
    return points


def read_settings(table: Section, group: str, default: str, *, kind: str = "") -> Any:
    """Reads from a table the settings of the driver that its key ``driver`` names.

    Args:
        table: Table of ``robot.toml``.
        group: Group of entry points: ``SERVOS`` or ``SENSORS``.
        default: The driver of a table that names none.
        kind: For a sensor, the name of its table.

    Raises:
        ConfigError: There is no such driver, or more than one; it cannot be imported, or refuses
            its keys or fails on them. The error names file, key and reason.
    """
    prefix = f"{kind}." if kind else ""
    driver = table.text("driver", default)
    name, ours = prefix + driver, OURS[group]
    if name in ours:  # no search for others' drivers: it takes a while on a small computer
        points = [metadata.EntryPoint(name, ours[name], group)]
    else:
        points = list(metadata.entry_points(group=group, name=name))
    if not points:
        names = {*ours, *metadata.entry_points(group=group).names}
        choices = sorted(entry.removeprefix(prefix) for entry in names if entry.startswith(prefix))
        raise table.refuse("driver", f"must be one of {', '.join(choices)}, not {driver!r}.")
    if len(points) > 1:
        dists = sorted(point.dist.name for point in points if point.dist is not None)
        raise table.refuse(
            "driver", f"is offered by {' and '.join(dists)}; uninstall all of them but one."
        )
    (point,) = points
    try:
        settings = load(point)
    except ImportError as error:
        raise table.refuse("driver", f"is {point.value}, which {error}.") from error
    try:
        return settings.read(table)
    except (ConfigError, KeyboardInterrupt):
        raise
    except BaseException as error:  # whatever it does with the table
        raise table.refuse(
            "driver", f"is {point.value}, which failed on this table: {error_text(error)}."
        ) from error


def load(point: metadata.EntryPoint) -> Any:
    """The settings class at an entry point.

    Raises:
        ImportError: Importing its module failed in whatever way, ``sys.exit`` included.
    """
    try:
        return point.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise ImportError(f"cannot be imported: {error_text(error)}") from error
