"""The capability dictionary: what ``hello`` makes public about a robot.

It holds what the paper assumes known (the main body's size and mass, the parts' radii, the joints,
the sensors) and never what is to be found out (lengths, attachments).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import partial
from typing import Any, Final, TypeVar, cast

from protocol.errors import LocalProtocolError
from protocol.wire import field_checks

MODALITIES: Final = ("touch", "tilt", "clearance")

_name = partial(field_checks.text, longest=field_checks.MAX_NAME)
_positive = partial(field_checks.number, least=1e-9)
_not_negative = partial(field_checks.number, least=0.0)
C = TypeVar("C")


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A driven joint: reachable limits in rad, top speed in rad/s, resolution in rad."""

    name: str
    lower: float
    upper: float
    speed: float
    resolution: float

    def __post_init__(self) -> None:
        _check(self, name=_name, lower=field_checks.number, upper=field_checks.number)
        _check(self, speed=_positive, resolution=_not_negative)
        if self.lower >= self.upper:
            raise LocalProtocolError(
                f"joint {self.name}: 'lower' must lie below 'upper', not {self.lower}, {self.upper}"
            )


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """One modality's sensor.

    Attributes:
        modality: touch, tilt or clearance.
        unit: Unit of the reading: bool, rad or m.
        count: Values in a reading (touch: number of sensors; tilt 2; clearance 1).
        noise: Root mean square error of one observation, in ``unit``.
        rate: Samples per second while settling.
        upper: Largest value that can be read, where there is one (clearance: the cap, m).
    """

    modality: str
    unit: str
    count: int
    noise: float
    rate: float
    upper: float | None = None

    def __post_init__(self) -> None:
        _check(self, modality=partial(field_checks.one_of, choices=MODALITIES), unit=_name)
        _check(
            self, count=partial(field_checks.integer, least=1), noise=_not_negative, rate=_positive
        )
        _check(self, upper=field_checks.optional(field_checks.number))


@dataclass(frozen=True, kw_only=True)
class Capabilities:
    """What a robot is and can do.

    Attributes:
        robot: The robot's name.
        software: Name and version of the daemon.
        config_hash: Changes whenever the daemon's configuration does.
        base_size: Main body along x, y, z, m.
        base_mass: Mass of the main body, kg.
        part_radii: Radius of the part that each joint moves, in joint order, m.
        joints: In motor order.
        sensors: At most one per modality.
        telemetry: Endpoint of the publications; ``*`` or a wildcard host means the host that the
            client reached.
        telemetry_rate: Publications per second.
    """

    robot: str
    software: str
    config_hash: str
    base_size: tuple[float, ...]
    base_mass: float
    part_radii: tuple[float, ...]
    joints: tuple[Joint, ...]
    sensors: tuple[Sensor, ...]
    telemetry: str
    telemetry_rate: float

    def __post_init__(self) -> None:
        _check(self, robot=_name, software=_name, config_hash=_name, telemetry=field_checks.text)
        _check(self, base_size=_array(_positive), base_mass=_positive, part_radii=_array(_positive))
        _check(self, joints=_array(_nested(Joint)), sensors=_array(_nested(Sensor)))
        _check(self, telemetry_rate=_positive)
        if len(self.base_size) != 3:
            raise LocalProtocolError(f"'base_size' must have 3 items, not {len(self.base_size)}")
        names = [joint.name for joint in self.joints]
        if not names or len(set(names)) != len(names):
            raise LocalProtocolError(f"'joints' must be one or more with different names: {names}")
        if len(self.part_radii) != len(names):
            raise LocalProtocolError(
                f"'part_radii' must have one item per joint, not {len(self.part_radii)}"
            )
        modalities = [sensor.modality for sensor in self.sensors]
        if len(set(modalities)) != len(modalities):
            raise LocalProtocolError(f"'sensors' must name each modality once, not {modalities}")

    @classmethod
    def of(cls, value: Any) -> Capabilities:
        """Accepts a ``Capabilities`` or its map."""
        return value if isinstance(value, cls) else _build(cls, "capabilities", value)

    def to_map(self) -> dict[str, Any]:
        """The dictionary as it goes over the wire; absent fields are left out."""
        return cast(dict[str, Any], _plain(asdict(self)))

    def sensor(self, modality: str) -> Sensor | None:
        """The sensor of a modality, or ``None``."""
        return next((sensor for sensor in self.sensors if sensor.modality == modality), None)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _check(instance: Any, **rules: Any) -> None:
    for name, check in rules.items():
        object.__setattr__(instance, name, check(name, getattr(instance, name)))


def _array(check: Any) -> Any:
    return lambda name, value: field_checks.items(name, value, check)


def _nested(kind: type[C]) -> Any:
    return lambda name, value: value if isinstance(value, kind) else _build(kind, name, value)


def _build(kind: type[C], name: str, value: Any) -> C:
    if not isinstance(value, Mapping):
        raise LocalProtocolError(f"'{name}' must be a map, not {value!r:.60}")
    known = {item.name for item in fields(kind)}  # type: ignore[arg-type]
    try:
        return kind(**{key: value[key] for key in known & value.keys()})
    except TypeError:
        missing = sorted(known - value.keys() - {"upper"})
        raise LocalProtocolError(f"'{name}': missing {', '.join(missing)}") from None
