"""Bodies with more joints and feet than one board has outputs and inputs."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import pytest

from robot.drivers.servos.sv203 import SV203Settings
from sim_robot.simulator.daemon import emulation
from sim_robot.world.body import Body, load_body, shipped_bodies
from sim_robot.world.sensor_noise import NO_NOISE

INERTIAL = (
    '<inertial><origin xyz="{centre} 0 0"/><mass value="{mass}"/>'
    '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial>'
)


def spider(folder: Path, legs: int) -> Body:
    """A box with legs of three joints each, all along x."""
    parts = [
        f'<link name="base">{INERTIAL.format(centre=0, mass=1)}<collision><geometry>'
        '<box size="0.3 0.3 0.06"/></geometry></collision></link>'
    ]
    for leg in range(legs):
        parent, origin = "base", f"0.15 {0.02 * leg - 0.1} 0"
        for joint, axis in enumerate(("0 0 1", "0 -1 0", "0 -1 0")):
            name = f"leg{leg}_{joint}"
            parts.append(
                f'<link name="{name}">{INERTIAL.format(centre=0.03, mass=0.02)}<collision>'
                '<origin xyz="0.03 0 0" rpy="0 1.5707963 0"/><geometry><cylinder radius="0.005" '
                f'length="0.06"/></geometry></collision></link><joint name="{name}" '
                f'type="revolute"><parent link="{parent}"/><child link="{name}"/>'
                f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
                '<limit lower="-1.2" upper="1.2" effort="5" velocity="2"/></joint>'
            )
            parent, origin = name, "0.06 0 0"
    file = folder / "spider.urdf"
    file.write_text(f'<robot name="spider">{"".join(parts)}</robot>', encoding="utf-8")
    return load_body(file)


@pytest.mark.parametrize(("legs", "boards"), [(6, (1, 2, 3)), (8, (1, 2, 3)), (5, (1, 2))])
def test_each_joint_goes_where_its_own_output_sends_it(
    tmp_path: Path, legs: int, boards: tuple[int, ...]
) -> None:
    body = spider(tmp_path, legs)
    with emulation(
        body, seed=0, levels=NO_NOISE, real_time=False, log=logging.getLogger("test")
    ) as parts:
        assert isinstance(parts.config.servos, SV203Settings)
        assert parts.config.servos.boards == boards
        parts.world.hold(1.0, (0.0, 0.0, 1.0))
        wanted = [0.02 * number - 0.2 for number in range(3 * legs)]
        servos = parts.devices.servos
        servos.read_counts([joint.output for joint in parts.config.joints])
        servos.set_counts(
            {
                joint.output: joint.quantise(angle)
                for joint, angle in zip(parts.config.joints, wanted, strict=True)
            }
        )
        parts.clock.sleep(1.0)
        assert parts.world.angles() == pytest.approx(wanted, abs=math.radians(0.7))


def test_a_body_has_as_many_boards_as_it_needs() -> None:
    body = load_body(shipped_bodies()["hexapod_18"])
    with emulation(
        body,
        seed=0,
        levels=NO_NOISE,
        real_time=False,
        log=logging.getLogger("test"),
        electronics="pi",
    ) as robot:
        joints, servos = robot.config.joints, robot.devices.servos
        outputs = [joint.output for joint in joints]
        assert outputs == list(range(18))  # the last two on the second board
        assert set(servos.read_counts(outputs).values()) == {0}
        servos.set_counts({joint.output: joint.quantise(0.2) for joint in joints})
        robot.clock.sleep(1.0)
        wanted = [joint.scale.angle(joint.quantise(0.2)) for joint in joints]
        assert robot.world.angles() == pytest.approx(wanted, abs=0.01)
        last = list(body.touch)[-1]
        robot.world.press(last, 2.0)
        loads = [sensor.load() for sensor in robot.devices.touch]
        assert len(loads) == 6  # the last two on the second chip
        assert loads[-1] - loads[-2] > 1.0
