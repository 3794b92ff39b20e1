"""Writes bodies as URDF files, so that what reads URDF can be held to our own kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from estimator.body.morphology import BASE, HINGE_AXES, SIDE_YAWS, Morphology, Part, attachment

_INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01"/>'
_LIMIT = '<limit lower="-3" upper="3" effort="10" velocity="1"/>'


def write_urdf(path: Path, body: Morphology, names: Sequence[str | None]) -> Path:
    """Writes a body.

    Args:
        path: The file.
        body: The body.
        names: Name of the joint of each part; ``None`` for a fixed one.
    """
    size = " ".join(str(extent) for extent in body.base.size)
    text = _link("base", _shape(f'<box size="{size}"/>', 0.0, ""), body.base.mass)
    for index, (part, name) in enumerate(zip(body.parts, names, strict=True)):
        parent = None if part.parent == BASE else body.parts[part.parent]
        x, y, z = attachment(body.base, parent, part.side)
        axis = " ".join(str(value) for value in HINGE_AXES[part.hinge])
        kind = "fixed" if name is None else "revolute"
        text += _link(f"part_{index}", _capsule(part))
        text += (
            f'<joint name="{name or f"fixed_{index}"}" type="{kind}">'
            f'<parent link="{"base" if parent is None else f"part_{part.parent}"}"/>'
            f'<child link="part_{index}"/><axis xyz="{axis}"/>{_LIMIT if name else ""}'
            f'<origin xyz="{x} {y} {z}" rpy="0 0 {SIDE_YAWS[part.side]}"/></joint>'
        )
    path.write_text(f'<robot name="tree">{text}</robot>', encoding="utf-8")
    return path


def _link(name: str, shapes: str, mass: float = 0.05) -> str:
    inertial = f'<inertial><mass value="{mass}"/>{_INERTIA}</inertial>'
    return f'<link name="{name}">{inertial}{shapes}</link>'


def _shape(geometry: str, x: float, turn: str) -> str:
    origin = f'<origin xyz="{x} 0 0"{turn}/>'
    return f"<collision>{origin}<geometry>{geometry}</geometry></collision>"


def _capsule(part: Part) -> str:
    ball = f'<sphere radius="{part.radius}"/>'
    straight = part.far_centre - part.near_centre
    tube = f'<cylinder radius="{part.radius}" length="{straight}"/>'
    middle = (part.far_centre + part.near_centre) / 2
    return (
        _shape(tube, middle, ' rpy="0 1.5707963267948966 0"')
        + _shape(ball, part.near_centre, "")
        + _shape(ball, part.far_centre, "")
    )
