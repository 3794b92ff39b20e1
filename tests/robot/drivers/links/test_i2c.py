"""A bus that loses acknowledges, is unplugged, or is not there."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from smbus2 import I2cFunc, SMBus, i2c_msg

from robot.drivers.buses import Buses
from robot.drivers.links.i2c import ATTEMPTS, I2CLink, I2CRegisters, no_such_bus, open_i2c
from robot.drivers.links.i2c import I2CBus as I2CBusLike
from robot.errors import DeviceMissingError, DeviceTimeoutError
from sim_robot.electronics.i2c_bus import I2CBus, I2CDevice
from tests.robot.clocks import InstantClock


class Counter(I2CDevice):
    """A chip that counts what is written to it, and sends the count."""

    def __init__(self, clock: InstantClock):
        super().__init__(clock)
        self.count = 0

    def answers(self, address: int) -> bool:
        return address == 0x30

    def receive(self, data: bytes) -> bool:
        self.count += len(data) > 1
        return True

    def send(self, count: int) -> bytes:
        return bytes((self.count,)) * count


class Bench:
    def __init__(self) -> None:
        self.clock = InstantClock()
        self.chip = Counter(self.clock)
        self.bus = I2CBus([self.chip], self.clock)
        self.link = Buses(clock=self.clock, open_i2c=self.bus.open).i2c(7)
        self.registers = I2CRegisters(self.link, 0x30, "counter")
        self.link.open()

    def count(self) -> int:
        return self.registers.read(0)[0]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@given(every=st.integers(2, 40), fault=st.sampled_from(["nak", "unheard"]))
def test_a_lost_acknowledge_costs_a_repeat(every: int, fault: str) -> None:
    bench = Bench()
    bench.chip.inject(fault, every)
    for _ in range(60):
        bench.registers.read(0)
    assert (bench.link.transfers, bench.link.repeats) == (60, (60 - 1) // (every - 1))


def test_a_device_that_never_acknowledges_is_asked_three_times(bench: Bench) -> None:
    bench.chip.inject("nak")
    before = bench.clock.now()
    with pytest.raises(
        DeviceMissingError, match=r"Nothing acknowledges at I²C address 0x30 \(counter\)"
    ):
        bench.count()
    assert (bench.link.transfers, bench.link.repeats) == (1, ATTEMPTS - 1)
    assert bench.clock.now() - before == pytest.approx(ATTEMPTS * 100e-6)


def test_what_may_not_be_done_twice_is_not(bench: Bench) -> None:
    bench.chip.inject("unheard", 2)
    bench.count()
    bench.registers.write(0, 1, done=lambda: bench.count() > 0)
    assert bench.chip.count == 1
    assert bench.link.repeats == 0
    bench.chip.mend()
    bench.chip.inject("nak", 5)  # the fifth is the second of these two
    bench.count()
    bench.registers.write(0, 1, done=lambda: bench.count() > 1)
    assert bench.chip.count == 2
    assert bench.link.repeats == 1


def test_a_bus_that_hangs_is_not_asked_again(bench: Bench) -> None:
    bench.chip.inject("hang")
    with pytest.raises(DeviceTimeoutError, match="The I²C bus hangs at I²C address 0x30"):
        bench.count()
    assert bench.link.repeats == 0


def test_an_adapter_that_was_plugged_in_again_is_another(bench: Bench) -> None:
    bench.bus.inject("unplugged")
    for _ in range(2):
        with pytest.raises(DeviceMissingError) as caught:
            bench.count()
        assert "The adapter of the I²C bus /dev/i2c-7 is gone" in str(caught.value)
        assert "Plug it in again." in str(caught.value)
        with pytest.raises(DeviceMissingError, match="/dev/i2c-7 cannot be opened"):
            bench.link.open()
    assert bench.link.repeats == 0
    bench.bus.mend()
    for _ in range(3):
        bench.link.open()
    assert bench.count() == 0
    assert len(bench.bus.handles) == 1
    bench.link.close()
    assert not bench.bus.handles


def files() -> int:
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("functions", [I2cFunc.I2C | I2cFunc.SMBUS_QUICK, I2cFunc.SMBUS_QUICK])
def test_a_bus_must_do_combined_transfers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, functions: I2cFunc
) -> None:
    plain = tmp_path / "i2c-0"
    plain.touch()
    before = files()
    monkeypatch.setattr(SMBus, "_get_funcs", lambda self: functions)
    monkeypatch.setattr("fcntl.ioctl", lambda *_: 0)
    if I2cFunc.I2C in functions:
        open_i2c(str(plain)).close()
    else:
        with pytest.raises(DeviceMissingError, match="speaks only SMBus"):
            open_i2c(str(plain))
    assert files() == before


def test_a_file_that_is_no_bus_is_closed_again(tmp_path: Path) -> None:
    plain = tmp_path / "i2c-0"
    plain.touch()
    before = files()
    with pytest.raises(DeviceMissingError, match="such as /dev/i2c-1"):
        open_i2c(str(plain))
    assert files() == before


def test_a_bus_that_is_not_there_names_those_that_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robot.drivers.links.i2c._NAMES", tmp_path / "sys")
    (tmp_path / "sys" / "i2c-13").mkdir(parents=True)
    (tmp_path / "sys" / "i2c-13" / "name").write_text("ddc 0\n")
    wanted = str(tmp_path / "i2c-1")
    with pytest.raises(DeviceMissingError) as caught:
        open_i2c(wanted)
    assert "There is none: switch it on (on a Raspberry Pi: sudo raspi-config" in str(caught.value)
    for name in ("i2c-14", "i2c-13", "i2c-ten", "gpiochip0"):
        (tmp_path / name).touch()
    with pytest.raises(DeviceMissingError) as caught:
        open_i2c(wanted)
    sentence = str(caught.value)
    assert (
        f"There are {tmp_path}/i2c-13 (ddc 0), {tmp_path}/i2c-14: name the right one as bus"
        in sentence
    )
    assert "sudo raspi-config nonint do_i2c 0" in sentence


def test_a_bus_that_is_not_ours_to_use_names_its_group(tmp_path: Path) -> None:
    bus = tmp_path / "i2c-1"
    bus.touch()
    error = OSError(errno.EACCES, os.strerror(errno.EACCES))
    os.chown(bus, -1, os.getgid())
    own = "i2c" if os.getgid() == 0 else "the group "
    sentence = str(no_such_bus(str(bus), error))
    assert "Permission denied. Add the user to the group " in sentence
    assert own in sentence
    assert "raspi-config" not in sentence


class Dead:
    """A bus whose file the kernel no longer knows, not even to close it."""

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))

    def close(self) -> None:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))


def test_a_file_that_cannot_be_closed_does_not_keep_the_bus_from_being_opened() -> None:
    clock = InstantClock()
    handles: list[I2CBusLike] = [Dead(), I2CBus([Counter(clock)], clock)]
    link = I2CLink(lambda path: handles.pop(0), "/dev/i2c-7")
    link.open()
    with pytest.raises(DeviceMissingError, match="is gone"):
        I2CRegisters(link, 0x30, "counter").read(0)
    link.open()
    assert I2CRegisters(link, 0x30, "counter").read(0) == b"\0"
