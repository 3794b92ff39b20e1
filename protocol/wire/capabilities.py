"""The capability dictionary: what ``hello`` makes public about a robot.

It holds what the paper assumes known (the main body's size and mass, the parts' radii, the joints,
the sensors) and never what is to be found out (lengths, attachments).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Final

from protocol.errors import LocalProtocolError, RobotError
from protocol.wire import field_checks
from protocol.wire.declaration import Record, checked, checked_optional, nested

MODALITIES: Final = ("touch", "tilt", "clearance")

_name = partial(field_checks.text, longest=field_checks.MAX_NAME)
_positive = partial(field_checks.number, least=1e-9)
_not_negative = partial(field_checks.number, least=0.0)
_ROUNDING: Final = 1e-6  # m, by which a width may differ from twice the radius


@dataclass(frozen=True, kw_only=True)
class Joint(Record):
    """A driven joint: reachable limits in rad, top speed in rad/s, resolution in rad.

    ``measured_noise`` is the root mean square error of the measured angle in one observation, rad;
    ``None``: nothing measures it.

    ``zero_sigma`` and ``travel_sigma`` are standard deviations of the calibration: of the angle 0,
    rad, and of how far the joint turns, as a fraction; ``None``: nobody states them.
    """

    name: str = checked(_name)
    lower: float = checked(field_checks.number)
    upper: float = checked(field_checks.number)
    speed: float = checked(_positive)
    resolution: float = checked(_not_negative)
    measured_noise: float | None = checked_optional(_not_negative)
    zero_sigma: float | None = checked_optional(_positive)
    travel_sigma: float | None = checked_optional(_positive)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lower >= self.upper:
            raise LocalProtocolError(
                f"joint {self.name}: 'lower' must lie below 'upper', not {self.lower}, {self.upper}"
            )


@dataclass(frozen=True, kw_only=True)
class Sensor(Record):
    """One modality's sensor.

    Attributes:
        modality: touch, tilt or clearance.
        unit: Unit of the reading: bool, rad or m.
        count: Number of values in a reading (touch: number of sensors; tilt 2; clearance 1).
        noise: Root mean square error of one observation, in ``unit``.
        rate: Samples per second while settling.
        upper: Largest value that can be read, where there is one (clearance: the cap, m).
        zero_sigma: Standard deviation of the calibration's zero, in ``unit`` (tilt: of what is
            level for the main body; clearance: of the belly on the ground); ``None``: nobody
            states it.
        gain_sigma: Standard deviation of the gain, as a fraction; ``None``: nobody states it.
    """

    modality: str = checked(partial(field_checks.one_of, choices=MODALITIES))
    unit: str = checked(_name)
    count: int = checked(partial(field_checks.integer, least=1))
    noise: float = checked(_not_negative)
    rate: float = checked(_positive)
    upper: float | None = checked_optional(field_checks.number)
    zero_sigma: float | None = checked_optional(_positive)
    gain_sigma: float | None = checked_optional(_positive)


@dataclass(frozen=True, kw_only=True)
class Capabilities(Record):
    """What a robot is and can do.

    Attributes:
        robot: The robot's name.
        software: Name and version of the daemon.
        config_hash: Hash that changes whenever the daemon's configuration does.
        base_size: Size of the main body along x, y, z, m.
        base_radius: Radius of a round main body, an upright cylinder as high and as wide as
            ``base_size`` says, m; ``None``: it is a box.
        base_mass: Mass of the main body, kg.
        part_radii: Radius of the part that each joint moves, in joint order, m; ``None`` where
            not all of them are known.
        joints: The joints, in motor order.
        sensors: The sensors, at most one per modality.
        telemetry: Endpoint of the telemetry; ``*`` or a wildcard host means the host that the
            client reached.
        telemetry_rate: Publications per second.
    """

    robot: str = checked(_name)
    software: str = checked(_name)
    config_hash: str = checked(_name)
    base_size: tuple[float, ...] = checked(partial(field_checks.items, check=_positive, count=3))
    base_radius: float | None = checked_optional(_positive)
    base_mass: float = checked(_positive)
    part_radii: tuple[float, ...] | None = checked_optional(
        partial(field_checks.items, check=_positive)
    )
    joints: tuple[Joint, ...] = checked(partial(field_checks.items, check=nested(Joint)))
    sensors: tuple[Sensor, ...] = checked(partial(field_checks.items, check=nested(Sensor)))
    telemetry: str = checked(field_checks.text)
    telemetry_rate: float = checked(_positive)

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [joint.name for joint in self.joints]
        if not names or len(set(names)) != len(names):
            raise LocalProtocolError(f"'joints' must be one or more with different names: {names}")
        if self.base_radius is not None:
            width = 2 * self.base_radius
            if any(abs(extent - width) > _ROUNDING for extent in self.base_size[:2]):
                raise LocalProtocolError(
                    f"'base_size' of a round main body must begin with its width twice, {width:g}, "
                    f"{width:g}, not {', '.join(f'{extent:g}' for extent in self.base_size[:2])}"
                )
        if self.part_radii is not None and len(self.part_radii) != len(names):
            raise LocalProtocolError(
                f"'part_radii' must have one item per joint, not {len(self.part_radii)}"
            )
        modalities = [sensor.modality for sensor in self.sensors]
        if len(set(modalities)) != len(modalities):
            raise LocalProtocolError(f"'sensors' must name each modality once, not {modalities}")

    def sensor(self, modality: str) -> Sensor | None:
        """The sensor of a modality, or ``None``."""
        return next((sensor for sensor in self.sensors if sensor.modality == modality), None)


_DECIMALS: Final = 4  # decimals of a printed angle, or more, where those hide the difference


def check_targets(joints: Sequence[Joint], targets: Mapping[str, float]) -> None:
    """Checks that the targets name every joint once and lie within the limits, which are reachable.

    Args:
        joints: The joints that ``hello`` lists.
        targets: Target angle by joint name, rad.

    Raises:
        RobotError: ``bad_targets`` or ``out_of_range``; the sentence names the joint.
    """
    names = [joint.name for joint in joints]
    missing = [name for name in names if name not in targets]
    unknown = [name for name in targets if name not in names]
    if missing:
        raise RobotError("bad_targets", f"There is no target for {_list(missing)}.")
    if unknown:
        raise RobotError("bad_targets", f"There is no joint {_list(unknown)}.")
    for joint in joints:
        target = targets[joint.name]
        if not joint.lower <= target <= joint.upper:
            limit = joint.lower if target < joint.lower else joint.upper
            digits = next(n for n in count(_DECIMALS) if _differ(target, limit, n))
            raise RobotError(
                "out_of_range",
                f"Joint {joint.name} reaches {joint.lower:.{digits}f} to {joint.upper:.{digits}f} "
                f"rad, not {target:.{digits}f}.",
            )


def _differ(one: float, other: float, digits: int) -> bool:
    return f"{one:.{digits}f}" != f"{other:.{digits}f}"


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:8])
    return shown if len(names) <= 8 else f"{shown} and {len(names) - 8} more"
