"""The mounts and hinges of a problem: those of its tables, and those that parts have inline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from estimator.body.morphology import BASE
from estimator.body.mounts import (
    HINGES,
    PART_SIDES,
    SIDES,
    BaseMount,
    Hinge,
    PartMount,
    Vector,
    four_sides,
)
from estimator.problem.sections import HingeRule, MountRule, PartRule
from estimator.problem.values import UNKNOWN

Place: TypeAlias = tuple[int, int]
"""A part's parent, and the index of its mount there."""

_CARRIER_WORDS: Final = {True: "on the main body", False: "on a part"}


@dataclass(frozen=True, kw_only=True)
class Attached:
    """What is known of how one part is attached; ``None``: to be found, or impossible there.

    Attributes:
        on_base: Index of its mount if it sits on the main body.
        on_part: Index of its mount if it sits on a part.
        hinge: Index of its hinge.
    """

    on_base: int | None
    on_part: int | None
    hinge: int | None

    def mount(self, parent: int) -> int | None:
        """Index of the part's mount on a parent."""
        return self.on_base if parent == BASE else self.on_part


class AttachmentTables:
    """All mounts and hinges: first those of the tables, which genes choose from, then the others.

    Args:
        mounts: Mounts of the problem; without any on the main body, or on parts: the paper's four
            sides there.
        hinges: Hinges of the problem; without any: the paper's six.
        parts: Parts of the problem.

    Attributes:
        part_mounts: Where parts can sit on parts.
        hinges: How parts can turn.
        base_choices: How many mounts on the main body a gene chooses from.
        part_choices: How many mounts on a part a gene chooses from.
        hinge_choices: How many hinges a gene chooses from.
        attached: What is known of how each part is attached.
        places: Where each part may sit, if no other part sits there.

    Raises:
        ValueError: A table or a part is wrong: key, name and reason.
    """

    def __init__(
        self,
        mounts: Sequence[MountRule],
        hinges: Sequence[HingeRule],
        parts: Sequence[PartRule],
    ) -> None:
        on_base = tuple(
            BaseMount(name=rule.name, at=rule.at, **_direction(rule))
            for rule in mounts
            if isinstance(rule.at, tuple)
        )
        on_part = tuple(
            PartMount(name=rule.name, fraction=rule.at, **_direction(rule))
            for rule in mounts
            if isinstance(rule.at, float)
        )
        self._on_base = on_base
        self._inline_mounts: tuple[BaseMount, ...] = ()
        self.part_mounts = on_part or PART_SIDES
        self.hinges = tuple(Hinge(name=rule.name, axis=rule.axis) for rule in hinges) or HINGES
        self._names = {
            True: _distinct("mounts", [mount.name for mount in on_base] or list(SIDES)),
            False: _distinct("mounts", [mount.name for mount in self.part_mounts]),
        }
        self._hinge_names = _distinct("hinges", [hinge.name for hinge in self.hinges])
        self.base_choices = len(self._names[True])
        self.part_choices = len(self.part_mounts)
        self.hinge_choices = len(self.hinges)
        self.attached = tuple(self._attached(index, part) for index, part in enumerate(parts))
        self.places = tuple(self._places(index, part) for index, part in enumerate(parts))

    def base_mounts(self, size: Vector) -> tuple[BaseMount, ...]:
        """Mounts on a main body with these extents, m."""
        return (*(self._on_base or four_sides(size)), *self._inline_mounts)

    def mount_names(self, parent: int) -> Sequence[str]:
        """Names of the mounts on a parent that a gene chooses from."""
        return self._names[parent == BASE]

    def check_doubles(self, parts: Sequence[PartRule]) -> None:
        """Refuses parts that cannot all have a mount of their own.

        Raises:
            ValueError: Parts share a mount, or would have to: key, names and reason.
        """
        owners: dict[tuple[int, int], PartRule] = {}
        for index, (rule, attached) in enumerate(zip(parts, self.attached, strict=True)):
            mount = None if rule.parent is None else attached.mount(rule.parent)
            if rule.parent is None or mount is None:
                continue
            owner = owners.setdefault((rule.parent, mount), rule)
            if owner is not rule:
                carrier = "the main body" if rule.parent == BASE else parts[rule.parent].name
                raise ValueError(
                    f"parts[{index + 1}].mount ({rule.name}): {owner.name} sits there already, on "
                    f"{rule.mount or rule.at} of {carrier}, and share_mounts = false forbids it"
                )
        seated: dict[Place, int] = {}
        for index in range(len(parts)):
            tried: set[Place] = set()
            if not self._seat(index, seated, tried):
                crowd = sorted({index, *(seated[place] for place in tried)})
                raise ValueError(
                    f"share_mounts: {', '.join(parts[one].name for one in crowd)} may sit on only "
                    f"{len(tried)} mount{'s' * (len(tried) > 1)}: add mounts, or let them be shared"
                )

    def _seat(self, part: int, seated: dict[Place, int], tried: set[Place]) -> bool:
        """Seats a part where others, which may move to other places, leave it one (Kuhn 1955)."""
        for place in self.places[part]:
            if place not in tried:
                tried.add(place)
                if place not in seated or self._seat(seated[place], seated, tried):
                    seated[place] = part
                    return True
        return False

    def _places(self, index: int, part: PartRule) -> list[Place]:
        places = []
        for parent in range(BASE, index) if part.parent is None else [part.parent]:
            mount = self.attached[index].mount(parent)
            choices = self.base_choices if parent == BASE else self.part_choices
            places += [(parent, one) for one in (range(choices) if mount is None else [mount])]
        return places

    def _attached(self, index: int, part: PartRule) -> Attached:
        where = f"parts[{index + 1}]"
        on_base = on_part = None
        if part.at is not None:
            if part.parent is None:
                raise ValueError(
                    f"{where}.at ({part.name}): a place is one on a known parent: name the parent, "
                    'or write mount = "unknown"'
                )
            if isinstance(part.at, tuple) != (part.parent == BASE):
                raise ValueError(
                    f"{where}.at ({part.name}): must be a point [x, y, z] on the main body, and a "
                    f"fraction of the length on a part, but its parent is {part.parent + 1}"
                )
            if isinstance(part.at, tuple):
                on_base = self._base_mount_index(part.at, part)
            else:
                on_part = self._part_mount_index(part.at, part)
        elif part.mount is not None:
            if part.parent in (None, BASE):
                on_base = self._mount_index(f"{where}.mount", part, part.mount, on_base=True)
            if part.parent != BASE and index:
                on_part = self._mount_index(f"{where}.mount", part, part.mount, on_base=False)
        return Attached(on_base=on_base, on_part=on_part, hinge=self._hinge_index(where, part))

    def _base_mount_index(self, at: Vector, part: PartRule) -> int:
        x, y, z = (round(1000 * coordinate, 1) for coordinate in at)
        name = f"({x:g}, {y:g}, {z:g}) mm, {_direction_words(part)}"
        mount = BaseMount(name=name, at=at, **_direction(part))
        for index, existing in enumerate((*self._on_base, *self._inline_mounts)):
            if replace(existing, name=name) == mount:
                return index if self._on_base else index + self.base_choices
        self._inline_mounts += (mount,)
        return self.base_choices + len(self._inline_mounts) - 1

    def _part_mount_index(self, fraction: float, part: PartRule) -> int:
        name = f"{100 * fraction:g} % of the length, {_direction_words(part)}"
        mount = PartMount(name=name, fraction=fraction, **_direction(part))
        for index, existing in enumerate(self.part_mounts):
            if replace(existing, name=name) == mount:
                return index
        self.part_mounts += (mount,)
        return len(self.part_mounts) - 1

    def _mount_index(self, key: str, part: PartRule, name: str, *, on_base: bool) -> int:
        names = self._names[on_base]
        if name not in names:
            raise ValueError(
                f"{key} ({part.name}): {_CARRIER_WORDS[on_base]}, must be one of {_listed(names)}, "
                f"not {name!r}"
            )
        return names.index(name)

    def _hinge_index(self, where: str, part: PartRule) -> int | None:
        if part.axis is not None:
            x, y, z = (round(coordinate, 3) for coordinate in part.axis)
            self.hinges += (Hinge(name=f"about ({x:g}, {y:g}, {z:g})", axis=part.axis),)
            return len(self.hinges) - 1
        if part.hinge is None:
            return None
        if part.hinge not in self._hinge_names:
            raise ValueError(
                f"{where}.hinge ({part.name}): must be one of {_listed(self._hinge_names)}, not "
                f"{part.hinge!r}"
            )
        return self._hinge_names.index(part.hinge)


def _direction(rule: MountRule | PartRule) -> dict[str, float]:
    return {
        "yaw": math.radians(rule.yaw_deg or 0.0),
        "elevation": math.radians(rule.elevation_deg),
    }


def _direction_words(part: PartRule) -> str:
    raised = f", {part.elevation_deg:+g}° up" if part.elevation_deg else ""
    return f"{part.yaw_deg or 0.0:g}°{raised}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(repr(name) for name in (*names, UNKNOWN))


def _distinct(table: str, names: list[str]) -> list[str]:
    for index, name in enumerate(names):
        if name in names[:index] or name == UNKNOWN:
            raise ValueError(f"{table}: {name!r} is no name of its own: choose another")
    return names


PAPERS_TABLES: Final = AttachmentTables((), (), ())
"""The paper's four sides and six hinges."""
