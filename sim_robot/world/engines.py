"""The engines that a world can be simulated in, by name.

PyBullet is the default where it is installed. MuJoCo shares nothing with it: its contacts are soft,
and another solver finds the forces.
"""

from __future__ import annotations

import importlib
import logging
from importlib.util import find_spec
from types import MappingProxyType
from typing import Final

from protocol.system.missing_library import install_command
from sim_robot.errors import EngineError
from sim_robot.world.body import Body
from sim_robot.world.simulation import World

ENGINES: Final = MappingProxyType(
    {
        "pybullet": ("sim_robot.world.pybullet_world", "PyBulletWorld"),
        "mujoco": ("sim_robot.world.mujoco_world", "MuJoCoWorld"),
    }
)
DEFAULT_ENGINE: Final = "mujoco" if find_spec("pybullet") is None else "pybullet"

_ADVICE: Final = MappingProxyType(
    {
        "pybullet": " brings it to Python 3.11 on Linux (x86-64); take --engine mujoco elsewhere",
        "mujoco": "",
    }
)


def open_world(body: Body, *, log: logging.Logger, engine: str = DEFAULT_ENGINE) -> World:
    """Puts a body into a world.

    Args:
        body: The body.
        log: Told when a servo cannot hold its angle.
        engine: A name in ``ENGINES``.

    Raises:
        EngineError: The engine is not installed.
    """
    module, name = ENGINES[engine]
    if find_spec(engine) is None:
        raise EngineError(f"{engine} is not installed: {install_command('sim')}{_ADVICE[engine]}")
    world: World = getattr(importlib.import_module(module), name)(body, log=log)
    return world
