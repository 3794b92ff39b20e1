"""Writes a problem file out for a particular robot: "all joints" and "one such part per joint".

What a file says of robots in general becomes what it says of one, before anything is checked:

* joints may all go by their names: the numbers that the robot gives them take their place;
* ``motors.driven`` may be ``"all"``, or a table from numbers of joints to lists of joints, with
  ``other`` for the rest: ``{ 8 = [1, 2, 3, 4], other = "all" }``;
* a part with ``each = "driven"`` stands for one such part per driven joint, in their order.

What is not understood here is left as it is, for the checks that follow to complain about.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any, Final

from estimator.parameters.announced import Announced
from protocol.wire.field_checks import MAX_ITEMS


@dataclass(frozen=True, kw_only=True)
class Inventory:
    """What a problem file needs to know of a robot to be written out.

    Attributes:
        joints: How many joints it has.
        touch_sensors: How many touch sensors it has.
        names: Names of its joints, where the file uses them.
        announced: How well it was calibrated.
        lean: The larger tilt in its zero pose, rad; 0: it does not lean there.
    """

    joints: int
    touch_sensors: int
    names: tuple[str, ...] = ()
    announced: Announced = field(default_factory=dict)
    lean: float = 0.0


PAPERS_ROBOT: Final = Inventory(joints=8, touch_sensors=4)


def supposed_robots(raw: Mapping[str, Any]) -> Iterator[Inventory]:
    """Yields robots to write a file out for before one is known; a file is right if it suits one.

    The paper's comes first if the file allows it. Where all joints are driven and each part names
    its own, there is one robot, with as many joints as they name; where a part stands for one per
    driven joint, robots of every other size follow, the nearest first. Joints that go by their
    names are numbered in the order of the file.

    Raises:
        ValueError: Some joints go by their names and others by their numbers.
    """
    names = _supposed_names(raw)
    first = replace(_supposed_joints(_by_number(raw, names)), names=names)
    yield first
    if any("each" in rule for rule in _part_rules(raw)):
        other_sizes = (size for size in range(1, MAX_ITEMS + 1) if size != first.joints)
        for size in sorted(other_sizes, key=lambda size: abs(size - first.joints)):
            yield replace(first, joints=size)


def _supposed_names(raw: Mapping[str, Any]) -> tuple[str, ...]:
    entries = (holder[key] for _, holder, key in _joint_places(raw))
    return tuple(dict.fromkeys(entry for entry in entries if isinstance(entry, str) and entry))


def _supposed_joints(raw: Mapping[str, Any]) -> Inventory:
    motors = raw.get("motors")
    driven = motors.get("driven") if isinstance(motors, dict) else None
    if isinstance(driven, dict):
        if str(PAPERS_ROBOT.joints) in driven:
            return PAPERS_ROBOT
        if "other" not in driven:
            sizes = [int(key) for key in driven if key.isdecimal()]
            return replace(PAPERS_ROBOT, joints=sizes[0]) if sizes else PAPERS_ROBOT
        driven = driven["other"]
    named = _joints_named(_part_rules(raw))
    return replace(PAPERS_ROBOT, joints=max(named)) if driven == "all" and named else PAPERS_ROBOT


def _part_rules(raw: Mapping[str, Any]) -> list[dict[str, Any]]:
    rules = raw.get("parts")
    return [rule for rule in rules if isinstance(rule, dict)] if isinstance(rules, list) else []


def _joints_named(parts: Sequence[Mapping[str, Any]]) -> list[int]:
    """Joints that parts name; none where a part stands for one such part per joint."""
    if any("each" in rule for rule in parts):
        return []
    numbers = [rule.get(key) for rule in parts for key in ("motor", "locked")]
    return [number for number in numbers if isinstance(number, int) and 1 <= number <= MAX_ITEMS]


def write_out(raw: Mapping[str, Any], robot: Inventory) -> tuple[dict[str, Any], list[int]]:
    """The file's content for one robot.

    Args:
        raw: Content of the TOML file.
        robot: The robot.

    Returns:
        The content without templates, and for each of its parts the index of the part in the file
        that it comes from.

    Raises:
        ValueError: An entry is wrong: key and reason.
    """
    raw = _by_number(raw, robot.names)
    written = dict(raw)
    driven = None
    motors = raw.get("motors")
    if isinstance(motors, dict) and "driven" in motors:
        driven = _driven_joints(motors["driven"], robot.joints)
        written["motors"] = {**motors, "driven": driven}
    parts: list[Any] = []
    origins: list[int] = []
    rules = raw.get("parts")
    for index, rule in enumerate(rules if isinstance(rules, list) else []):
        copies = _copies(rule, driven, index) if isinstance(rule, dict) else [rule]
        parts += copies
        origins += [index] * len(copies)
    if isinstance(rules, list):
        written["parts"] = parts
    return written, origins


def _joint_places(raw: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Each place where the file says a joint: its name, what holds it, and under which key."""
    motors, rules = raw.get("motors"), raw.get("parts")
    driven = motors.get("driven") if isinstance(motors, dict) else None
    for value in driven.values() if isinstance(driven, dict) else [driven]:
        for index in range(len(value) if isinstance(value, list) else 0):
            yield "motors.driven", value, index
    for number, rule in enumerate(rules if isinstance(rules, list) else [], start=1):
        for key in ("motor", "locked"):
            if isinstance(rule, dict) and key in rule:
                yield f"parts[{number}].{key}", rule, key


def _by_number(raw: Mapping[str, Any], names: Sequence[str]) -> Mapping[str, Any]:
    """The file's content with numbers of joints in the place of their names.

    Raises:
        ValueError: The robot has no such joint, or others go by their numbers.
    """
    written = deepcopy(raw)
    named, numbered = "", ""
    for where, holder, key in _joint_places(written):
        name = holder[key]
        if isinstance(name, int):
            numbered = numbered or f"{where} has {name}"
        if isinstance(name, str):
            named = named or f"{where} has {name!r}"
            if not name or name not in names:
                joint_names = ", ".join(names)
                raise ValueError(
                    f"{where}: the robot has no joint named {name!r}; its joints are {joint_names}"
                )
            holder[key] = names.index(name) + 1
    if named and numbered:
        raise ValueError(
            f"joints go by their names or by their numbers, not by both: {named}, {numbered}"
        )
    return written


def _driven_joints(value: Any, joints: int) -> Any:
    if isinstance(value, dict):
        wrong_keys = [key for key in value if key != "other" and not key.isdecimal()]
        if wrong_keys:
            raise ValueError(
                f"motors.driven: {wrong_keys[0]!r} must be a number of joints or 'other', as in "
                '{ 8 = [1, 2, 3, 4], other = "all" }'
            )
        if str(joints) not in value and "other" not in value:
            raise ValueError(
                f"motors.driven: says nothing of a robot with {joints} joints: add {joints} = … "
                "or other = …"
            )
        value = value.get(str(joints), value.get("other"))
    if value == "all":
        return list(range(1, joints + 1))
    if isinstance(value, str):
        raise ValueError(f'motors.driven: must be a list of joints or "all", not {value!r}')
    return value


def _copies(rule: dict[str, Any], driven: Any, index: int) -> list[dict[str, Any]]:
    if "each" not in rule:
        return [rule]
    where, name = f"parts[{index + 1}]", rule.get("name", "part")
    if rule["each"] != "driven":
        raise ValueError(f'{where}.each ({name}): must be "driven", not {rule["each"]!r}')
    keys = [key for key in ("motor", "locked", "sensor") if key in rule]
    if keys:
        raise ValueError(
            f'{where}.{keys[0]} ({name}): follows from each = "driven" and the robot; leave it '
            'out, and say touch = "outermost" where parts feel touch'
        )
    common = {key: value for key, value in rule.items() if key != "each"}
    return [
        {**common, "name": f"{name} {number}", "motor": motor}
        for number, motor in enumerate(driven if isinstance(driven, list) else [], start=1)
    ]
