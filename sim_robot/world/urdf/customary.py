"""What URDF files of others have, rewritten into the subset; what that changes is said.

================================ ================================================================
In the file                      What it is taken as
================================ ================================================================
a mesh                           the box around it
a ``continuous`` joint           a revolute one of ±180°
limits beyond ±180°              ±180°
a range without 0                the same range, counted from its end nearest to 0
an effort of 0, or none          a servo that is strong enough: the robot's weight, two metres out
a link without mass, fixed       a part of the link that it is fixed to
a root without shape             what is fixed to it and has one is the root; else its ``<visual>``
a root that floats in a world    the root
joints before their parents      joints after their parents
words of other programs          nothing
================================ ================================================================
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from lxml import etree

from sim_robot.world.urdf.customary_joints import complete_joint
from sim_robot.world.urdf.customary_tree import settle_tree
from sim_robot.world.urdf.elements import Element, Say, frame, mass, set_frame, text_of
from sim_robot.world.urdf.foreign_words import drop_foreign
from sim_robot.world.urdf.frames import frame_of
from sim_robot.world.urdf.mesh_box import box_of_mesh, find_mesh

_AMPLE: Final = 2.0 * 9.81  # N·m for each kg of the robot


def rewrite(root: Element, file: Path, *, note: Say, fault: Say) -> None:
    """Rewrites a description in place.

    Args:
        root: Its ``<robot>``.
        file: Where it came from; meshes are looked for near it.
        note: Told what is taken otherwise than it stands there.
        fault: Told what cannot be taken at all.
    """
    settle_tree(root, note=note)
    for link in root.findall("link"):
        _replace_meshes(link, file, note, fault)
    masses = [mass(link) for link in root.findall("link")]
    effort = _AMPLE * float(np.nansum(masses))
    for joint in root.findall("joint"):
        complete_joint(joint, effort, note=note, fault=fault)
    drop_foreign(root, note=note, fault=fault)


def _replace_meshes(link: Element, file: Path, note: Say, fault: Say) -> None:
    for collision in link.findall("collision"):
        geometry = collision.find("geometry")
        mesh = None if geometry is None else geometry.find("mesh")
        if geometry is None or mesh is None:
            continue
        geometry.remove(mesh)
        where, name = f"link '{link.get('name')}': collision: mesh", mesh.get("filename", "")
        try:
            scale = [float(number) for number in mesh.get("scale", "1 1 1").split()]
            path = find_mesh(name, file)
            if path is None:
                raise ValueError("is not there")
            size, middle = box_of_mesh(path, scale)
        except (OSError, ValueError) as error:
            fault(where, f"{name} {getattr(error, 'strerror', None) or error}.")
            etree.SubElement(geometry, "box", size="1 1 1")  # so that it is said once
            continue
        etree.SubElement(geometry, "box", size=text_of(np.maximum(size, 1e-4)))
        set_frame(collision, frame(collision) @ frame_of(middle))
        extents = " × ".join(f"{1000 * extent:.0f}" for extent in size)
        note(where, f"{Path(name).name} is taken as the box around it, {extents} mm")
