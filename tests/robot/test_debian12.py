"""The robot's side runs on Debian 12's own package versions: all that a 32-bit PC-104 can install.

They are installed into an environment of their own, and this project from the source distribution
of ``make wheel``, which holds what its wheel holds; a daemon there serves a client there, and the
workstation's commands say what they lack.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import venv
from collections.abc import Iterable
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).parents[2]
DEBIAN_12 = ("pyzmq==24.0.1", "msgpack==1.0.3", "pyserial==3.5", "smbus2==0.4.2")

SCRIPT = """
import logging, sys, threading
sys.path.append(sys.argv[1])  # has bench; what was installed comes first
from importlib import resources
from protocol.transport.client import RobotClient
from protocol.security.keys import ROBOT, KeyDirectory, KnownPeer, read_public
from protocol.transport.server import Server
from protocol.transport.telemetry import TelemetrySubscriber
from robot.host.clock import WallClock
from bench.still_robot import still_robot

ours, theirs = KeyDirectory("robot-keys"), KeyDirectory("client-keys")
name, robot_key = read_public(ours.create("robot"))
theirs.create("ann")
theirs.add(KnownPeer(name=name, public=robot_key, role=ROBOT))
ours.add(KnownPeer(name="ann", public=theirs.pair().public, role="controller"))

log = logging.getLogger("robotd")
with still_robot(WallClock(), housekeeping=None, log=log) as robot:
    with Server(robot.controller, bind="tcp://127.0.0.1:*", keys="robot-keys", log=log) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        robot.controller.start()
        with RobotClient(server.endpoint, keys="client-keys") as client:
            client.acquire()
            targets = {joint.name: 0.1 for joint in client.capabilities.joints}
            seen = client.perform(targets)
            place = client.capabilities.telemetry
            with TelemetrySubscriber(place, keys="client-keys") as telemetry:
                print(telemetry.next(timeout=120).state)
        robot.controller.shut_down()
        server.request_stop()
        thread.join()
assert seen.settled and len(seen.angles) == 8, seen
assert not {"numpy", "pybullet", "pydantic"} & sys.modules.keys()
assert resources.files("robot").joinpath("systemd", "robotd.service").is_file()
print("good")
"""


def modules_and_data(files: Iterable[str]) -> set[str]:
    return {name for name in files if not re.match(r"\.\.|[^/]*dist-info/", name)}


def test_a_daemon_and_a_client_run_on_debian_12_versions(tmp_path: Path) -> None:
    venv.create(tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet"]
    pip += ["--disable-pip-version-check", "--no-compile"]
    subprocess.run([*pip, *DEBIAN_12, "setuptools>=77"], check=True)
    source = tmp_path / "source"  # building leaves files behind, which are not for the checkout
    ignored = shutil.ignore_patterns(".*", "build", "*.egg-info", "tests", "docs")
    shutil.copytree(ROOT, source, ignore=ignored)
    make = ["make", "wheel", f"PYTHON={sys.executable}"]  # also tries what it builds
    subprocess.run(make, cwd=source, check=True, stdout=subprocess.DEVNULL)
    (wheel,), (sdist,) = source.glob("dist/*.whl"), source.glob("dist/*.tar.gz")
    subprocess.run([*pip, "--no-deps", "--no-build-isolation", sdist], check=True)
    record = next((tmp_path / "venv").rglob("bodyschema-*/RECORD")).read_text("utf-8")
    installed = [line.split(",")[0] for line in record.splitlines()]
    assert modules_and_data(installed) == modules_and_data(ZipFile(wheel).namelist())
    for command, extra in (("estimator", "[estimator]"), ("sim-robotd", "[sim]"), ("robotd", "")):
        version, usage = (
            subprocess.run(
                [python.with_name(command), option], capture_output=True, text=True, check=False
            )
            for option in ("--version", "--help")
        )
        assert version.stdout.startswith(f"{command} (bodyschema) ")
        assert usage.returncode == bool(extra)
        assert f"pip install '{sdist}{extra}'" in usage.stderr or not extra
    # -I: nothing of this checkout or of this environment is visible, only what was installed.
    done = subprocess.run(
        [str(python), "-I", "-W", "error", "-c", SCRIPT, str(source)],
        capture_output=True,
        text=True,
        timeout=300,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["holding", "good"]
    assert sys.version_info[:2] == (3, 11)  # Debian 12's Python
