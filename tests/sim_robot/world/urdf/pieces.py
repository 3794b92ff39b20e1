"""Links and joints of which tests put descriptions together."""

from __future__ import annotations

from pathlib import Path

from sim_robot.world.body import Body, load_body

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.002" iyy="0.002" izz="0.002"/></inertial>'
BOX = '<collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision>'
BASE = f'<link name="base">{INERTIAL}{BOX}</link>'
LEG = f'<link name="leg">{INERTIAL}{BOX}</link>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def joint(kind: str, parent: str, child: str, inside: str = "") -> str:
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="0 -1 0"/>{inside}</joint>'
    )


def written(folder: Path, *parts: str) -> Path:
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    return file


def taken(folder: Path, *parts: str) -> Body:
    return load_body(written(folder, *parts))
