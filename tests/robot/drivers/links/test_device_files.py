"""I/O ports through ``/dev/port``, and who else has claimed them."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.drivers.links.device_files import (
    ClosedPorts,
    DevPort,
    claimed_by,
    open_dev_port,
)
from robot.errors import DeviceMissingError

IOPORTS = """\
0000-0cf7 : PCI Bus 0000:00
  0000-001f : dma1
  0300-030f : dmm32at
  03f8-03ff : serial
"""


@pytest.fixture
def claims(tmp_path: Path) -> str:
    file = tmp_path / "ioports"
    file.write_text(IOPORTS)
    return str(file)


@pytest.fixture
def ports(tmp_path: Path) -> str:
    file = tmp_path / "port"
    file.write_bytes(bytes(range(256)) * 4)
    return str(file)


def test_ports_are_offsets_in_the_file(ports: str) -> None:
    port_io = DevPort(ports)
    port_io.write(0x102, 0xAB)
    assert port_io.read(0x102) == b"\xab"
    assert port_io.read(0x101, 3) == b"\x01\xab\x03"
    port_io.close()


@pytest.mark.parametrize(
    ("base", "owner"),
    [(0x300, "dmm32at"), (0x2F1, "dmm32at"), (0x30F, "dmm32at"), (0x2F0, None), (0x310, None)],
)
def test_claims_of_the_kernel(claims: str, base: int, owner: str | None) -> None:
    assert claimed_by(base, 16, claims) == owner


def test_a_claimed_range_is_refused(claims: str, ports: str) -> None:
    with pytest.raises(DeviceMissingError, match="0x300-0x30f belong to the kernel driver dmm32at"):
        open_dev_port(0x300, path=ports, claims=claims)
    open_dev_port(0x280, path=ports, claims=claims).close()


def test_ports_that_cannot_be_opened_say_why(tmp_path: Path, claims: str) -> None:
    with pytest.raises(DeviceMissingError, match="CONFIG_DEVPORT"):
        open_dev_port(0x280, path=str(tmp_path / "none"), claims=claims)
    with pytest.raises(DeviceMissingError, match="CAP_SYS_RAWIO"):
        open_dev_port(0x280, path=str(tmp_path), claims=claims)
    assert claimed_by(0x280, 16, str(tmp_path / "none")) is None


def test_ports_that_are_not_open_cannot_be_used() -> None:
    ports = ClosedPorts()
    for access in (lambda: ports.read(0x300), lambda: ports.write(0x300, 1)):
        with pytest.raises(OSError, match="not open"):
            access()
    ports.close()
