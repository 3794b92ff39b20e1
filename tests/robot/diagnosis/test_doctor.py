"""Every fault of the emulated electronics is found and named, and hides no other."""

from __future__ import annotations

import logging
import math
import re

import pytest
import serial

from bench.still_robot import still_pi
from robot.diagnosis.doctor import Doctor
from robot.diagnosis.findings import Severity
from robot.drivers.links.device_files import open_serial
from robot.drivers.sensors.analogue import AnalogueAccelerometer, AnalogueGauge
from robot.drivers.sensors.dmm32 import DMM32Settings
from robot.drivers.sensors.vl6180x import VL6180X
from robot.drivers.servos.sv203 import SV203
from sim_robot.faults.fault_panel import FaultSpec
from sim_robot.simulator.daemon import emulation
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels
from tests.robot.clocks import InstantClock
from tests.robot.diagnosis.clinic import Clinic

ALL = {
    "servo board",
    *(f"joint {name}_{side}" for name in ("hip", "knee") for side in
      ("left", "front", "right", "back")),
    "analogue inputs",
    "accelerometer",
    *(f"touch lower_{side}" for side in ("left", "front", "right", "back")),
    "distance",
}  # fmt: skip


def test_a_sound_robot_is_found_sound_part_by_part(clinic: Clinic) -> None:
    findings = clinic.examine()
    assert {one.subject for one in findings} == ALL
    assert [one for one in findings if one.verdict is Severity.BAD] == []


@pytest.mark.parametrize(
    ("injected", "subject", "words"),
    [
        (("servo_board", "mute", 0), "servo board", "did not answer"),
        (("servo_board", "garbage", 3), "servo board", "repeated"),
        (("servo_board", "drop", 40), "servo board", "repeated"),
        (("servo_board", "corrupt", 40), "servo board", "repeated"),
        (("daq", "stuck_wait", 0), "analogue inputs", "DMM-32"),
        (("daq", "stuck_busy", 0), "analogue inputs", "DMM-32"),
        (("daq", "overflow", 0), "analogue inputs", "overflow"),
        (("daq", "lost_sample", 0), "analogue inputs", "fewer samples"),
        (("daq", "stuck_channel", 1), "accelerometer", "y axis, is stuck"),
        (("daq", "railed_channel", 2), "accelerometer", "z axis, is at the end"),
        (("daq", "stuck_channel", 5), "touch lower_right", "is stuck"),
        (("daq", "railed_channel", 3), "touch lower_left", "at the end"),
        (("distance", "nak", 0), "distance", "acknowledges"),
        (("distance", "hang", 0), "distance", "hangs"),
        (("distance", "busy", 0), "distance", "within"),
        (("distance", "frozen", 0), "distance", "frozen"),
        (("distance", "error", 3), "distance", "laser watchdog"),
    ],
)
def test_a_fault_is_found_where_it_is_and_nowhere_else(
    clinic: Clinic, injected: tuple[str, str, int], subject: str, words: str
) -> None:
    part, fault, value = injected
    emulator = getattr(clinic.robot, part)
    emulator.inject(fault, value)
    bad = clinic.bad()
    assert list(bad) == [subject]
    assert words in bad[subject].text, bad[subject].text
    emulator.mend()
    assert not clinic.bad()


def test_several_faults_are_all_found(clinic: Clinic) -> None:
    clinic.robot.servo_board.inject("mute")
    clinic.robot.daq.inject("absent")
    clinic.robot.distance.inject("nak")
    assert list(clinic.bad()) == ["servo board", "analogue inputs", "distance"]


@pytest.mark.parametrize(
    ("every", "verdict"), [(0, Severity.OK), (150, Severity.LOOK), (10, Severity.BAD)]
)
def test_transfers_that_had_to_be_repeated_are_counted(every: int, verdict: Severity) -> None:
    with still_pi(InstantClock(), housekeeping=None, log=logging.getLogger("test")) as robot:
        for chip in ("accelerometer", "adc", "distance"):
            if every:
                robot.panel.order(FaultSpec.parse(f"{chip}.nak={every}"))
        doctor = Doctor(robot.config, robot.buses, move=False)
        found = {one.subject: one for one in doctor.examine()}
    for subject in ("accelerometer", "analogue inputs", "distance"):
        assert found[subject].verdict is verdict, found[subject]
        counted = re.search(r"(\d+) of (\d+) transfers repeated", found[subject].text)
        assert counted is not None
        repeats, transfers = map(int, counted.groups())
        assert repeats == pytest.approx(transfers / every if every else 0, rel=0.2, abs=1.0)
        assert ("Acknowledges are lost" in found[subject].advice) == bool(every)


def test_an_unplugged_adapter_is_found(clinic: Clinic) -> None:
    clinic.robot.servo_board.unplug()
    bad = clinic.bad()
    assert list(bad) == ["servo board"]
    assert "cannot be opened" in bad["servo board"].text


def test_a_robot_that_another_program_drives_is_left_alone(clinic: Clinic) -> None:
    before = clinic.clock.now()
    with open_serial(clinic.robot.servo_board.port, 9600):
        findings = clinic.examine(move=True)
    assert [one.verdict for one in findings] == [Severity.BAD, Severity.LOOK]
    assert "other program" in findings[0].advice
    assert clinic.clock.now() == before  # every access to a device would have taken time


def test_nothing_moves_unless_it_is_told_to(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[bytes] = []
    write = serial.Serial.write

    def record(port: serial.Serial, data: bytes) -> int | None:
        written.append(data)
        return write(port, data)

    monkeypatch.setattr(serial.Serial, "write", record)
    clinic.examine()
    assert written
    assert all(re.fullmatch(rb"(BD1)?RR5[1-8]\r", line) for line in written)
    clinic.examine(move=True)
    assert any(b"M" in line for line in written)


def test_a_noisy_simulated_robot_is_sound_and_a_miscalibrated_one_is_not() -> None:
    body = load_body(default_body_path())
    worst = {}
    for wrong in (None, 2):
        with emulation(
            body,
            seed=1,
            levels=NoiseLevels(),
            real_time=False,
            log=logging.getLogger("test"),
            wrong=wrong,
        ) as parts:
            parts.devices.servos.close()  # one program at a time has the line
            doctor = Doctor(parts.config, parts.buses, move=True)
            worst[wrong] = [one for one in doctor.examine() if one.verdict is Severity.BAD]
    assert not worst[None]
    assert any(one.part for one in worst[2])


def test_an_examination_takes_seconds(clinic: Clinic) -> None:
    before = clinic.clock.now()
    clinic.examine()
    assert 2 < clinic.clock.now() - before < 10


def leave(*_: object) -> None:
    raise SystemExit(0)


@pytest.mark.parametrize(
    ("where", "method", "subject"),
    [
        (VL6180X, "start", "distance"),
        (VL6180X, "distance", "distance"),
        (AnalogueAccelerometer, "acceleration", "accelerometer"),
        (AnalogueGauge, "check", "touch lower_left"),
        (DMM32Settings, "open", "analogue inputs"),
        (SV203, "read_counts", "servo board"),
    ],
)
def test_a_driver_that_leaves_the_program_is_a_finding(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch, where: type, method: str, subject: str
) -> None:
    monkeypatch.setattr(where, method, leave)
    finding = clinic.bad()[subject]
    assert f"failed in {method}: SystemExit: 0" in finding.text


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_is_a_finding(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch, bad: float
) -> None:
    monkeypatch.setattr(VL6180X, "distance", lambda _: bad)
    monkeypatch.setattr(AnalogueAccelerometer, "acceleration", lambda _: (0.0, bad, 1.0))
    monkeypatch.setattr(AnalogueGauge, "load", lambda _: bad)
    bad_ones = clinic.bad()
    subjects = {"distance", "accelerometer"} | {f"touch {p.name}" for p in clinic.config.touch}
    assert bad_ones.keys() == subjects
    assert all("no finite number" in one.text for one in bad_ones.values())
