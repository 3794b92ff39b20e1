"""A robot of 24 joints, from its URDF to lengths that were found on it, through the wire."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from bench.daemons import simulator
from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.storage.run_config import RunConfig
from estimator.workplaces import IN_THIS_PROCESS
from tests.estimator.model_robot import without_plots

LEGS = 8
PARTS = (("coxa", "0 0 1", 0.04), ("femur", "0 -1 0", 0.06), ("tibia", "0 -1 0", 0.08))
UNKNOWN = {1: 0.11, 6: 0.065}
"""Lengths of the tibias that are to be found, by leg, m."""

LINK = """
<link name="{name}"><inertial><origin xyz="{middle} 0 0"/><mass value="0.02"/>
  <inertia ixx="1e-6" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="{middle} 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><cylinder radius="0.006" length="{length}"/></geometry></collision></link>
<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}"/>
  <origin xyz="{at}" rpy="0 0 {yaw}"/><axis xyz="{axis}"/>
  <limit lower="-0.8" upper="0.8" effort="3" velocity="2"/></joint>
"""
BASE = """
<link name="base"><inertial><mass value="1.0"/>
  <inertia ixx="0.004" iyy="0.004" izz="0.008" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.2 0.2 0.06"/></geometry></collision></link>
"""
HEAD = """
name = "octopod"
description = "Eight legs of three parts, of which two have unknown ends."
density = 2000.0
touch = "outermost"
motors = { driven = "all", range_deg = [-30.0, 30.0], slew_deg_per_s = 60.0 }
search = { population = 40, generations = 10, interactions = 4 }
"""
PART = """
[[parts]]
name = "{name}"
motor = "{name}"
parent = {parent}
at = {at}
yaw_deg = {yaw}
axis = [{axis}]
length = {length}
radius = 0.006
"""


def octopod() -> tuple[str, str]:
    """The robot as URDF, and as a problem."""
    robot, problem = BASE, HEAD
    for leg in range(LEGS):
        turn = 2 * math.pi * (leg + 0.5) / LEGS
        hip = (round(0.1 * math.cos(turn), 4), round(0.1 * math.sin(turn), 4), 0.0)
        parent, at = "base", " ".join(map(str, hip))
        for row, (part, axis, usual) in enumerate(PARTS):
            name, yaw = f"{part}_{leg}", turn if row == 0 else 0.0
            length = UNKNOWN.get(leg, usual) if part == "tibia" else usual
            robot += LINK.format(
                name=name,
                parent=parent,
                at=at,
                yaw=yaw,
                axis=axis,
                middle=length / 2,
                length=length,
            )
            problem += PART.format(
                name=name,
                parent=3 * leg + row if row else 0,
                at=1.0 if row else list(hip),
                yaw=math.degrees(yaw),
                axis=axis.replace(" ", ", "),
                length=[0.04, 0.14] if part == "tibia" and leg in UNKNOWN else length,
            )
            parent, at = name, f"{length} 0 0"
    return f'<robot name="octopod">{robot}</robot>', problem


def test_lengths_are_found_on_a_robot_of_24_joints(tmp_path: Path) -> None:
    robot, problem = octopod()
    (tmp_path / "octopod.urdf").write_text(robot, encoding="utf-8")
    (tmp_path / "octopod.toml").write_text(problem, encoding="utf-8")
    with simulator("--body", str(tmp_path / "octopod.urdf"), "--seed", "0") as running:
        order = RunConfig(
            robot=running.uri,
            problem=str(tmp_path / "octopod.toml"),
            seed=0,
            method="paper",
            physics="statics",
            explore="disagreement",
            interactions=4,
        )
        result = identify(
            tmp_path / "run", order, IN_THIS_PROCESS, Listener(), report=without_plots
        )
    assert len(result.legs) == 3 * LEGS
    found = {leg.joint: leg.length_m for leg in result.legs}
    for leg, length in UNKNOWN.items():
        assert found[f"tibia_{leg}"] == pytest.approx(length, abs=0.008)
