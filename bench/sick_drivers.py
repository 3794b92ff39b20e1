"""Drivers that hang or die on order, as those of others may."""

from __future__ import annotations

import time
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from robot.service.devices import Devices

DEATHS: Final = MappingProxyType(
    {kind.__name__: kind for kind in (SystemExit, KeyboardInterrupt, GeneratorExit, MemoryError)}
)
"""What a driver may raise that no driver may, by name."""


def make_sick(devices: Devices, order: str, *, only_while: Path | None = None) -> None:
    """Has a method of a driver hang or die.

    Args:
        devices: The drivers, opened.
        order: ``DEVICE.METHOD=HOW``, such as ``servos.set_counts=hang`` or
            ``distance.distance=SystemExit``; the touch sensor is the first.
        only_while: It is sick while there is this file, and works before and after; ``None``: from
            now on.
    """
    place, _, how = order.partition("=")
    device, _, method = place.partition(".")
    driver = devices.touch[0] if device == "touch" else getattr(devices, device)
    well = getattr(driver, method)

    def is_sick() -> bool:
        return only_while is None or only_while.exists()

    def sick(*given: Any) -> Any:
        if is_sick() and how != "hang":
            raise DEATHS[how]
        while is_sick():
            time.sleep(0.01)
        return well(*given)

    setattr(driver, method, sick)
