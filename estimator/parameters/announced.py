"""What a robot says of itself, and which rows of the table that tightens or widens.

How well it was calibrated tightens narrow spreads only: that a calibration is wrong altogether
stays as possible as it was. Where joints are measured, it matters little where servos stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final, TypeAlias

from estimator.parameters.table import Parameter
from protocol.wire.capabilities import Capabilities

_GROUND: Final = math.radians(0.2)
"""Standard deviation of the ground's slope, rad, which no calibration of a robot knows and which
feels like its accelerometer's own tilt. Floors may be 4 mm in 1 m uneven, 0.23° (DIN 18202)."""

Announced: TypeAlias = Mapping[tuple[str, int | None], float]
"""Standard deviations, in SI units or of a logarithm, by group and motor; ``None``: no joint's."""


def announced(capabilities: Capabilities) -> Announced:
    """Standard deviations that a robot announces of its calibration, and of measured angles."""
    stated: dict[tuple[str, int | None], float | None] = {}
    if tilt := capabilities.sensor("tilt"):
        level = tilt.zero_sigma and math.hypot(tilt.zero_sigma, _GROUND)
        stated["accelerometer_deg", None] = level
        stated["accelerometer_gain", None] = tilt.gain_sigma
    if clearance := capabilities.sensor("clearance"):
        stated["distance_mm", None] = clearance.zero_sigma
        stated["distance_gain", None] = clearance.gain_sigma
    for motor, joint in enumerate(capabilities.joints):
        stated["zero_deg", motor] = joint.zero_sigma
        stated["travel_of_each", motor] = joint.travel_sigma
    measured = [joint.measured_noise for joint in capabilities.joints]
    if None not in measured:
        stated["servo_short_deg", None] = max(filter(None, measured), default=0.0)
    return {key: sigma for key, sigma in stated.items() if sigma is not None}


def tightened(row: Parameter, stated: Announced) -> Parameter:
    """The row with a narrow spread that is no larger than announced."""
    return replace(row, narrow=min(row.narrow, stated.get((row.group, row.motor), math.inf)))


def widened(row: Parameter, lean: float) -> Parameter:
    """The row with a narrow spread that is no smaller than a robot leans in its zero pose, rad.

    Ground that slopes, or an accelerometer that is turned, is then as probable as it is there.
    """
    is_tilt = row.group == "accelerometer_deg"
    return replace(row, narrow=max(row.narrow, lean)) if is_tilt else row


def tightens(table: Iterable[Parameter], stated: Announced) -> str:
    """Groups of a table whose rows are as narrow as announced, for people; empty: none are."""
    groups: dict[str, list[float]] = {}
    for row in table:
        if row.narrow == stated.get((row.group, row.motor)):
            groups.setdefault(row.group, []).append(row.narrow * row.unit)
    return ", ".join(
        f"{group} to {max(spreads):.2g}{f' ({len(spreads)} rows)' if spreads[1:] else ''}"
        for group, spreads in groups.items()
    )
