"""``docs/your-robot.md`` can be followed: its commands, in order, on emulated chips."""

from __future__ import annotations

import logging
import os
import re
import shlex
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from protocol.__main__ import main as protocol_main
from protocol.transport.client import RobotClient
from protocol.wire.messages import ObservationReply
from robot.cli.command_line import main
from robot.drivers.buses import Buses
from robot.trial.session import QUIT
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from tests.docs.pages import page
from tests.free_ports import free_address
from tests.robot.clocks import InstantClock

PAGE = page("your-robot").partition("\n## Calibration\n")[0]
COMMANDS = re.findall(r"^robot\$ (.+)$", PAGE, re.MULTILINE)
(TABLE,) = re.findall(r"### A Raspberry Pi.+?\n(\|.+?)\n\n", PAGE, re.DOTALL)
ADDRESSES = {
    chip: int(address, 16) for chip, address in re.findall(r"(\S+) board \| `(0x..)`", TABLE)
}
HIP = ["", "1", "u 20", "10.8", "done", "", "yes"]  # 20 counts are 9.8°


class Wired:
    """The chips of the page's table, at its addresses, on a robot that lies on its belly."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.pwm = PCA9685Emulator(self.clock, address=ADDRESSES["PCA9685"])
        bus = I2CBus(
            [
                self.pwm,
                MPU6050Emulator(lambda: (0.0, 0.0, 1.0), self.clock, address=ADDRESSES["MPU-6050"]),
                ADS1115Emulator(lambda channel: 0.2, self.clock, address=ADDRESSES["ADS1115"]),
                VL6180XEmulator(lambda: 10.0, self.clock),
            ],
            self.clock,
        )
        self.buses = Buses(clock=self.clock, open_i2c=lambda path: bus)


class Fingers:
    """Presses keys, one a turn; what was shown last is kept."""

    def __init__(self, keys: Sequence[str]):
        self._keys = list(keys)
        self.shown = ""

    def key(self) -> str | None:
        return self._keys.pop(0) if self._keys else QUIT

    def show(self, text: Sequence[str], rows: Sequence[str], *, keep: int) -> None:
        del keep
        self.shown = "\n".join([*text, *rows])


@pytest.fixture
def wired(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Wired:
    robot = Wired()
    monkeypatch.chdir(tmp_path)
    for module in ("doctor", "calibrate", "try_out", "run"):
        monkeypatch.setattr(f"robot.cli.{module}.WallClock", lambda: robot.clock)
        monkeypatch.setattr(f"robot.cli.{module}.Buses", lambda clock: robot.buses)
    return robot


@contextmanager
def serving(log: logging.Handler) -> Iterator[None]:
    logging.getLogger("robotd").addHandler(log)
    yield
    logging.getLogger("robotd").removeHandler(log)


class Started(logging.Handler):
    """Notices that the daemon serves."""

    def __init__(self) -> None:
        super().__init__()
        self.event = threading.Event()

    def emit(self, record: logging.LogRecord) -> None:
        if "serving" in record.getMessage():
            self.event.set()


def measure_the_oscillator(
    calibrate: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answers = iter(["", "50.0"])  # hertz, at an output without a servo
    monkeypatch.setattr("builtins.input", lambda prompt: next(answers))
    assert main(calibrate) == 1
    assert "Write oscillator_mhz = 24.99 below [servos]" in capsys.readouterr().err
    config = Path("robot.toml")
    text = config.read_text(encoding="utf-8")
    config.write_text(
        text.replace("# oscillator_mhz = 26.9 ", "oscillator_mhz = 24.99"), encoding="utf-8"
    )


def test_the_page_can_be_followed(
    wired: Wired, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    robotd = [shlex.split(one)[1:] for one in COMMANDS if one.startswith("robotd ")]
    new, doctor, try_out, calibrate, run = robotd
    assert [words[0] for words in robotd] == ["new", "doctor", "try", "calibrate", "run"]

    assert main(new) == 0
    assert main(doctor) == 0  # nothing is bad; the servos are off
    findings = capsys.readouterr().out
    assert "limp" in findings
    assert "BAD" not in findings
    assert set(wired.pwm.pulses()) == {0}

    fingers = Fingers(["h", "h", *["down", "h", "h"] * 7, *["up"] * 7, "right", *["wait"] * 200])

    @contextmanager
    def keyboard() -> Iterator[Fingers]:
        yield fingers

    monkeypatch.setattr("robot.cli.try_out.keyboard", keyboard)
    assert main(try_out) == 0
    for words in ("z +1.0", "mm below the belly", "N, free", "> hip_left"):
        assert words in fingers.shown
    pulses = wired.pwm.pulses()
    assert 0 not in pulses[:8]
    assert set(pulses[8:]) == {0}

    assert main(run) == 1
    assert "robotd calibrate --config robot.toml" in capsys.readouterr().err

    measure_the_oscillator(calibrate, monkeypatch, capsys)
    answers = iter(HIP)
    monkeypatch.setattr("builtins.input", lambda prompt: next(answers, "q"))
    assert main(calibrate) == 1  # left after the first part
    assert "calibration.toml has hip_left" in capsys.readouterr().err

    uri, started = free_address(), Started()
    seen: list[object] = []

    def client() -> None:
        try:
            assert started.event.wait(120)
            hold = shlex.split(COMMANDS[-1])[4:]
            seen.append(protocol_main([uri, *hold]))
            with RobotClient(uri, timeout=120) as robot:
                robot.acquire()
                targets = {joint.name: 0.1 for joint in robot.capabilities.joints}
                seen.append(robot.perform(targets))
        finally:
            os.kill(os.getpid(), signal.SIGTERM)

    helper = threading.Thread(target=client)
    with serving(started):
        helper.start()
        assert main([*run, "--bind", uri]) == 0
    helper.join()
    code, observation = seen
    assert code == 0
    assert isinstance(observation, ObservationReply)
    assert observation.clearance == pytest.approx(0.0, abs=2e-3)


def test_each_chip_of_the_table_is_where_robotd_new_looks_for_it(wired: Wired) -> None:
    del wired
    assert (
        main(
            [
                *shlex.split(next(one for one in COMMANDS if one.startswith("robotd new")))[1:-1],
                "robot.toml",
            ]
        )
        == 0
    )
    text = Path("robot.toml").read_text(encoding="utf-8")
    written = re.findall(r"^address = (0x..)", text, re.MULTILINE)
    assert {int(one, 16) for one in written} == set(ADDRESSES.values())
    assert len(ADDRESSES) == 4
