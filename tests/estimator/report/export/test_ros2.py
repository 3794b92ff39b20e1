"""A description package for ROS 2, built and launched as far as that goes without ROS."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.report.export.description import Description, describe
from estimator.report.export.formats import urdf
from estimator.report.export.ros2 import ros2_package
from protocol.wire.capabilities import Joint

AMENT = """
macro(ament_package)
  install(FILES package.xml DESTINATION share/${PROJECT_NAME})
endmacro()
"""


def described(robot: str = "my robot & I") -> Description:
    leg = Part(parent=BASE, mount=1, hinge=2, length=0.2, radius=0.006, motor=0)
    return describe(
        Morphology(base=Base(size=(0.1,) * 3, mass=1.0), parts=(leg,), density=1000.0),
        robot=robot,
        parts=["leg"],
        carried=[0],
        joints=[Joint(name="hip", lower=-1, upper=1, speed=1, resolution=0)],
    )


def written(folder: Path, body: Description) -> Path:
    """The package's folder."""
    files = ros2_package(body, urdf(body))
    for path, text in files.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
    (package,) = folder.iterdir()
    return package


@pytest.mark.parametrize(
    ("robot", "name"),
    [
        ("my robot & I", "my_robot_i_description"),
        ("__R2--D2__", "r2_d2_description"),
        ("3pö", "p_description"),
        ("机器人", "robot_description"),
    ],
)
def test_it_is_named_after_the_robot(tmp_path: Path, robot: str, name: str) -> None:
    package = written(tmp_path, described(robot))
    root = ElementTree.parse(package / "package.xml").getroot()
    described_as = root.findtext("description") or ""
    assert package.name == root.findtext("name") == name
    assert robot in described_as


def test_what_is_installed_can_be_launched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package, prefix, stand_in = (tmp_path / name for name in ("src", "install", "ament"))
    package = written(package, described())
    stand_in.mkdir()
    (stand_in / "ament_cmakeConfig.cmake").write_text(AMENT)
    for command in (
        ["-S", str(package), "-B", str(tmp_path / "build"), f"-Dament_cmake_DIR={stand_in}"],
        ["--install", str(tmp_path / "build"), "--prefix", str(prefix)],
    ):
        subprocess.run(["cmake", *command], check=True, capture_output=True, timeout=120)
    share = prefix / "share" / "my_robot_i_description"
    installed = {str(path.relative_to(share)) for path in share.rglob("*") if path.is_file()}
    files = {"launch/display.launch.py", "rviz/robot.rviz", "urdf/robot.urdf"}
    assert installed == {"package.xml", *files}
    subprocess.run(["check_urdf", share / "urdf" / "robot.urdf"], check=True, capture_output=True)
    nodes = launched(share / "launch" / "display.launch.py", monkeypatch)
    needs = ElementTree.parse(share / "package.xml").getroot().findall("exec_depend")
    assert {node.package for node in nodes} | {"launch_ros"} == {need.text for need in needs}
    by_package = {node.package: node for node in nodes}
    ((parameter,),) = (by_package["robot_state_publisher"].parameters,)
    assert parameter["robot_description"].value == urdf(described())
    assert parameter["robot_description"].value_type is str
    settings = yaml.safe_load(Path(by_package["rviz2"].arguments[1]).read_text())
    assert settings["Visualization Manager"]["Global Options"]["Fixed Frame"] == "body"


def launched(file: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The nodes of a launch file."""
    stand_ins: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": list},
        "launch_ros": {},
        "launch_ros.actions": {"Node": SimpleNamespace},
        "launch_ros.parameter_descriptions": {
            "ParameterValue": lambda value, value_type: SimpleNamespace(
                value=value, value_type=value_type
            )
        },
    }
    for name, members in stand_ins.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    nodes: list[Any] = runpy.run_path(str(file))["generate_launch_description"]()
    return nodes
