"""A description package for ROS 2: the body's URDF, and files that show it in RViz.

Each joint has a slider there. The package is built as any other, ``colcon build --packages-select
NAME``; its name is as REP 144 wants it.
"""

from __future__ import annotations

import re
from typing import Final
from xml.sax.saxutils import escape

from estimator.report.export.description import Description

_DEFAULT_NAME: Final = "robot"  # if a robot's name has nothing that a package's name may have

_PACKAGE: Final = """\
<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" \
schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>{package}</name>
  <version>0.0.1</version>
  <description>The body of {robot}, as its movements have told it.</description>
  <maintainer email="somebody@example.com">somebody</maintainer>
  <license>unknown</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <exec_depend>joint_state_publisher_gui</exec_depend>
  <exec_depend>launch_ros</exec_depend>
  <exec_depend>robot_state_publisher</exec_depend>
  <exec_depend>rviz2</exec_depend>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
_CMAKE: Final = """\
cmake_minimum_required(VERSION 3.8)
project({package} NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY launch rviz urdf DESTINATION share/${{PROJECT_NAME}})
ament_package()
"""
_LAUNCH: Final = '''\
"""Shows the robot in RViz: ros2 launch {package} display.launch.py"""

from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(__file__).parents[1]


def generate_launch_description():
    description = (SHARE / "urdf" / "robot.urdf").read_text(encoding="utf-8")
    return LaunchDescription(
        [
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                # said to be text, or launch reads it as YAML
                parameters=[{{"robot_description": ParameterValue(description, value_type=str)}}],
            ),
            Node(
                package="joint_state_publisher_gui",
                executable="joint_state_publisher_gui",
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", str(SHARE / "rviz" / "robot.rviz")],
            ),
        ]
    )
'''
_RVIZ: Final = """\
Panels:
  - Class: rviz_common/Displays
    Name: Displays
Visualization Manager:
  Class: ""
  Displays:
    - Class: rviz_default_plugins/Grid
      Cell Size: 0.1
      Enabled: true
      Name: Grid
      Value: true
    - Class: rviz_default_plugins/RobotModel
      Description Source: Topic
      Description Topic:
        Durability Policy: Transient Local
        Value: /robot_description
      Enabled: true
      Name: RobotModel
      Value: true
    - Class: rviz_default_plugins/TF
      Enabled: false
      Name: TF
      Value: false
  Enabled: true
  Global Options:
    Fixed Frame: "{base}"
    Frame Rate: 30
  Tools:
    - Class: rviz_default_plugins/MoveCamera
  Value: true
  Views:
    Current:
      Class: rviz_default_plugins/Orbit
      Distance: {distance:.2f}
      Name: Current View
      Pitch: 0.5
      Target Frame: <Fixed Frame>
      Value: Orbit (rviz)
      Yaw: 0.8
    Saved: ~
"""


def ros2_package(body: Description, urdf: str) -> dict[str, str]:
    """The files of the package by their paths, which begin with its name.

    Args:
        body: The body.
        urdf: The same body as URDF.
    """
    package = f"{_package_name(body.robot)}_description"
    base = body.base.replace("\\", "\\\\").replace('"', '\\"')
    files = {
        "package.xml": _PACKAGE.format(package=package, robot=escape(body.robot)),
        "CMakeLists.txt": _CMAKE.format(package=package),
        "launch/display.launch.py": _LAUNCH.format(package=package),
        "rviz/robot.rviz": _RVIZ.format(base=base, distance=6 * max(body.size)),
        "urdf/robot.urdf": urdf,
    }
    return {f"{package}/{path}": text for path, text in files.items()}


def _package_name(robot: str) -> str:
    """A robot's name in small letters, digits and single underscores, a letter first (REP 144)."""
    words = re.findall(r"[a-z0-9]+", robot.lower())
    name = "_".join(words).lstrip("0123456789_")
    return name or _DEFAULT_NAME
