"""The shipped unit fits the daemon that it starts."""

from __future__ import annotations

import argparse
import re
from importlib import resources
from pathlib import Path

import pytest

from robot.cli.command_line import COMMANDS
from robot.cli.run import add_arguments

UNIT = resources.files("robot").joinpath("systemd/robotd.service").read_text(encoding="utf-8")
GUIDE = (Path(__file__).parents[3] / "docs" / "your-robot.md").read_text(encoding="utf-8")
SETTINGS: list[tuple[str, str]] = re.findall(r"^(\w+)=(.*)$", UNIT, flags=re.MULTILINE)


def setting(name: str) -> str:
    (value,) = (value for key, value in SETTINGS if key == name)
    return value


@pytest.mark.parametrize("command", re.findall(r"^ExecStart=(.*robotd .+)$", UNIT + GUIDE, re.M))
def test_its_command_is_one_of_the_daemon(command: str) -> None:
    _, name, *words = command.split()
    assert name in COMMANDS
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_arguments(parser)
    parser.parse_args(words)


def test_it_waits_longer_than_the_daemon_needs() -> None:
    assert int(setting("TimeoutStopSec")) > 5  # a motion ends and the robot parks
    # The longest time between two signs of life: a sample a second, and a query thrice in vain.
    assert int(setting("WatchdogSec")) / 4 > 1.0
    assert setting("Type") == "notify"
    assert setting("KillSignal") == "SIGTERM"


def test_it_keeps_the_ports_within_reach() -> None:
    names = [name for name, _ in SETTINGS]
    assert "PrivateDevices" not in names
    assert "PrivateUsers" not in names
    assert setting("AmbientCapabilities") == setting("CapabilityBoundingSet") == "CAP_SYS_RAWIO"
    assert ("DeviceAllow", "/dev/port rw") in SETTINGS
    assert ("DeviceAllow", "char-gpiochip rw") in SETTINGS
    assert setting("ProcSubset") == "all"  # /proc/ioports
    # libzmq sets its threads' scheduling at the first connection, and aborts where it may not.
    assert not any("@resources" in value for key, value in SETTINGS if key == "SystemCallFilter")


@pytest.mark.parametrize("name", ["robotd.service", "robotd.sysusers.conf", "70-robotd.rules"])
def test_the_guide_installs_every_file(name: str) -> None:
    assert resources.files("robot").joinpath("systemd", name).is_file()
    assert re.search(rf"^# install -D -m 644 {re.escape(name)} /etc/", GUIDE, re.M)
