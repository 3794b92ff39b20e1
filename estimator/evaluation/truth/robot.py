"""Whether a URDF is that of the robot that a run talked to, as far as a robot tells."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from estimator.errors import TruthError
from estimator.evaluation.truth.urdf import read_urdf
from protocol.wire.capabilities import Capabilities

_SIZE: Final = 0.005
"""By how much a main body may differ from what its robot says, m; both were measured by people."""

_MASS: Final = 0.1
"""By how much its mass may differ, relative."""


def check_robot(path: Path, robot: Capabilities) -> None:
    """Refuses another robot's URDF.

    Raises:
        TruthError: The file is no URDF of the supported subset, or has other joints, or a main body
            of another size or mass.
    """
    urdf = read_urdf(path)
    joints = tuple(joint.name for joint in urdf.joints if joint.type == "revolute")
    known = tuple(joint.name for joint in robot.joints)
    if joints != known:
        raise _refusal(path, robot, f"the joints {', '.join(joints)}", ", ".join(known))
    size, _ = urdf.main_box
    root = next(link for link in urdf.links if link.name == urdf.root)
    mass = None if root.inertial is None else root.inertial.mass.value
    if not np.allclose(size, robot.base_size, rtol=0.0, atol=_SIZE):
        raise _refusal(path, robot, f"a main body of {_mm(size)} mm", f"{_mm(robot.base_size)} mm")
    if mass is not None and not np.isclose(mass, robot.base_mass, rtol=_MASS, atol=0.0):
        raise _refusal(path, robot, f"a main body of {mass:g} kg", f"{robot.base_mass:g} kg")


def _refusal(path: Path, robot: Capabilities, there: str, here: str) -> TruthError:
    return TruthError(
        f"{path} is another robot's: it has {there}, and {robot.robot}, which the run talked to, "
        f"{here}: give the URDF of that robot."
    )


def _mm(size: Sequence[float]) -> str:
    return " x ".join(f"{length * 1000:.0f}" for length in size)
