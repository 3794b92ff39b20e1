"""A body that fits somebody's own ``robot.toml``: its joints and feet are those of the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from robot.configuration.robot_config import RobotConfig
from sim_robot.errors import BodyError
from sim_robot.world.body import Body, load_body, shipped_bodies

_SIZE_TOLERANCE: Final = 2e-3  # m by which a main body may differ from the file without a word
_MASS_TOLERANCE: Final = 0.05  # kg by which its mass may differ without a word, or
_MASS_SHARE: Final = 0.05  # this share of its mass


def fitted(body: Body, config: RobotConfig) -> tuple[Body, list[str]]:
    """A body in the order of a configuration, so that joint and foot k are those of the file.

    Where the body has the file's names, joints and feet are matched by name; otherwise in order,
    which a note says. Feet that the file does not name have no sensor.

    Returns:
        The body, and notes on where it differs from the file, a sentence each.

    Raises:
        BodyError: The body has another number of joints, or not the feet that the file names.
    """
    joints = [joint.name for joint in config.joints]
    if len(joints) != len(body.motors):
        raise BodyError(
            body.name,
            "",
            f"has {len(body.motors)} joints, and {config.name} in robot.toml {len(joints)}: give "
            f"--body a body with {len(joints)}{_with_joints(len(joints))}.",
        )
    notes: list[str] = []
    motors = {motor.name: motor for motor in body.motors}
    if set(joints) == motors.keys():
        body = replace(body, motors=tuple(motors[name] for name in joints))
    else:
        pairs = ", ".join(f"{a} = {b}" for a, b in zip(joints, motors, strict=True))
        notes.append(f"the body's joints have other names, and are taken in order: {pairs}")
    feet = [point.name for point in config.touch]
    if set(feet) <= body.touch.keys():
        body = replace(body, touch={name: body.touch[name] for name in feet})
    elif len(feet) == len(body.touch):
        pairs = ", ".join(f"{a} = {b}" for a, b in zip(feet, body.touch, strict=True))
        notes.append(f"the body's feet have other names, and are taken in order: {pairs}")
        body = replace(body, touch=dict(zip(feet, body.touch.values(), strict=True)))
    else:
        raise BodyError(
            body.name,
            "",
            f"has the feet {', '.join(body.touch) or '(none)'}, and robot.toml names "
            f"{', '.join(feet)}: call them as they are called there, or give --body another body.",
        )
    return body, [*notes, *_differences(body, config)]


def _with_joints(number: int) -> str:
    names = [
        name for name, path in shipped_bodies().items() if len(load_body(path).motors) == number
    ]
    return f" (with as many comes {', '.join(names)})" if names else ""


def _differences(body: Body, config: RobotConfig) -> Iterator[str]:
    """Sentences on what the file, and so the robot, says otherwise than the body."""
    extents = zip(body.base_size, config.body.size, strict=True)
    if any(abs(one - other) > _SIZE_TOLERANCE for one, other in extents):
        sizes = body.base_size, config.body.size
        true, said = (" x ".join(f"{1000 * metres:.0f}" for metres in size) for size in sizes)
        yield f"the main body is {true} mm in the URDF and {said} mm in robot.toml"
    mass, said_mass = body.base_mass, config.body.mass
    if abs(mass - said_mass) > max(_MASS_TOLERANCE, _MASS_SHARE * mass):
        yield f"the main body has {mass:.3g} kg in the URDF and {said_mass:.3g} kg in robot.toml"
    if body.lies_flat != config.body.lies_flat:
        words = {True: "lies flat", False: "stands"}
        yield (
            f"with all joints at 0 the body {words[body.lies_flat]}, and robot.toml says that it "
            f"{words[config.body.lies_flat]} (body.zero_pose)"
        )
