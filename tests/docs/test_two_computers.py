"""Two computers as in ``docs/your-robot.md``: the ten commands, on one machine in two folders."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

from protocol.sockets.zmq_sockets import Endpoint
from tests.docs.pages import ROOT, section
from tests.free_ports import free_address

COMMANDS = re.findall(
    r"^(robot|workstation)\$ (.+)$", section("your-robot", "Two computers"), re.MULTILINE
)
SHORT = " --method paper --population 8 --generations 1 --interactions 1 --jobs 1"
SCP = """#!/bin/bash -e
there() { [[ $1 == robot:* ]] && echo "../robot/${1#robot:}" || echo "$1"; }
cp "$(there "$1")" "$(there "$2")"
"""


def test_ten_commands_lead_to_the_first_identification(tmp_path: Path) -> None:
    assert len(COMMANDS) == 10
    uri = free_address()
    port = str(Endpoint.parse(uri).port)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    programs = tmp_path / "bin"
    for folder in (programs, tmp_path / "robot", tmp_path / "workstation"):
        folder.mkdir()
    (programs / "scp").write_text(SCP)
    (programs / "scp").chmod(0o755)
    path = f"{programs}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | {"PATH": path}
    serving = None
    try:
        for computer, command in COMMANDS:
            folder = tmp_path / computer
            if installed := re.match(r"pip install '(\S+)\[(\w+)\]'", command):
                assert installed[1] == f"bodyschema-{project['version']}-py3-none-any.whl"
                assert installed[2] in project["optional-dependencies"]
                continue
            here = command.replace("tcp://robot:5750", uri).replace("5750", port)
            if "sim-robotd" in here:
                serving = subprocess.Popen(
                    here.split(), cwd=folder, env=environment, stderr=subprocess.PIPE, text=True
                )
                assert serving.stderr is not None
                assert any("serving" in line for line in serving.stderr)
                continue
            done = subprocess.run(
                ["bash", "-ec", here + (SHORT if "identify" in here else "")],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                timeout=300,
                check=False,
            )
            assert done.returncode == 0, (command, done.stdout, done.stderr)
        assert (tmp_path / "workstation" / "runs" / "first" / "result.json").exists()
    finally:
        if serving is not None:
            serving.send_signal(signal.SIGTERM)
            serving.communicate(timeout=120)


def test_the_image_is_built_from_the_package_index_alone() -> None:
    """As far as that can be told without a container engine."""
    steps = re.findall(r"^([A-Z]+) (.+)$", (ROOT / "Containerfile").read_text(), re.MULTILINE)
    assert [name for name, _ in steps][:3] == ["FROM", "COPY", "RUN"]
    assert f"python:{sys.version_info.major}.{sys.version_info.minor}-slim" in steps[0][1]
    for name, text in steps[3:]:
        assert name not in ("ADD", "COPY")
        assert not re.search(r"pip|apt|curl|wget|git|https?:", text)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lines = (ROOT / ".dockerignore").read_text().splitlines()
    kept = {line.removeprefix("!") for line in lines if line.startswith("!")}
    setuptools = project["tool"]["setuptools"]
    packages = setuptools["packages"]["find"]["include"]
    modules = {f"{module}.py" for module in setuptools["py-modules"]}
    needed = {"pyproject.toml", project["project"]["readme"], *project["project"]["license-files"]}
    needed |= modules | {package.rstrip("*") for package in packages} | {"constraints.txt"}
    assert kept == needed
    install = re.fullmatch(
        r'python -m pip install --no-cache-dir -c /src/constraints.txt "/src\[([\w,]+)\]"',
        steps[2][1],
    )
    assert install is not None
    pins = [
        Requirement(line)
        for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    ]
    pinned = {pin.name.lower(): str(pin.specifier).removeprefix("==") for pin in pins}
    wanted = [*project["project"]["dependencies"]]
    for extra in install[1].split(","):
        wanted += project["project"]["optional-dependencies"][extra]
    for requirement in map(Requirement, wanted):
        assert requirement.specifier.contains(pinned[requirement.name.lower()]), requirement
