"""The simulated person measures the world, not the electronics; at --console a real one does."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from robot.configuration.calibration_file import read_calibration
from robot.configuration.robot_config import with_calibration
from robot.drivers.servos.pca9685 import PCA9685Settings
from robot.drivers.servos.sv203 import COUNTS
from robot.errors import CommandError, ConfigError
from sim_robot.simulator.daemon import Emulation, emulation
from sim_robot.simulator.electronics_sets import pi
from sim_robot.simulator.person import PROTRACTOR, UNEVEN, RehearsalConsole, SimulatedPerson
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels
from tests.terminal_window import TerminalWindow

BODY = load_body(default_body_path())
LOG = logging.getLogger("test")
COMMAND = [sys.executable, "-m", "sim_robot", "--console", "--miscalibrated", "7", "--calibration"]


@pytest.fixture
def parts() -> Iterator[Emulation]:
    with emulation(
        BODY, seed=0, levels=NoiseLevels(), real_time=False, log=LOG, wrong=7
    ) as emulated:
        yield emulated


@pytest.fixture
def person(parts: Emulation) -> SimulatedPerson:
    return SimulatedPerson(parts, seed=1, echo=lambda text: None)


def test_the_protractor_shows_the_real_angle(parts: Emulation, person: SimulatedPerson) -> None:
    person.ask("on the stand: Enter")
    parts.devices.servos.read_counts([3])
    parts.devices.servos.set_counts({3: 150})
    readings = [
        float(person.ask("hip_right at its new 0°: the angle measured, or Enter"))
        for _ in range(20)
    ]
    real = math.degrees(parts.world.angles()[2])
    assert real == pytest.approx(math.degrees(parts.truth.joints[2].scale.angle(150)), abs=0.01)
    assert all(abs(reading - real) <= PROTRACTOR + 1e-9 for reading in readings)
    assert len(set(readings)) > 1


@pytest.mark.parametrize(
    ("position", "up"),
    [("nose up", (1, 0, 0)), ("left side down", (0, -1, 0)), ("upside down", (0, 0, -1))],
)
def test_the_body_is_held_as_asked(
    parts: Emulation, person: SimulatedPerson, position: str, up: tuple[float, ...]
) -> None:
    person.ask(f"{position}, hold it still, then Enter")
    leans = math.degrees(math.acos(sum(a * b for a, b in zip(parts.world.up(), up, strict=True))))
    assert 0 < leans < math.hypot(UNEVEN, UNEVEN)


def test_only_the_foot_in_question_is_loaded(parts: Emulation, person: SimulatedPerson) -> None:
    person.ask("lower_front free of any load: Enter or skip")
    assert not any(parts.world.loads())
    assert person.ask("lower_front with a known load: newtons, or grams as in '100 g'") == "200 g"
    assert parts.world.loads() == pytest.approx((0, 1.962, 0, 0))


def test_plate_and_ground(parts: Emulation, person: SimulatedPerson) -> None:
    person.ask("plate at 80 mm, 1 of 16: Enter")
    assert parts.world.belly_ray() == pytest.approx(0.08, abs=1e-4)


def test_what_was_never_asked_is_not_understood(person: SimulatedPerson) -> None:
    with pytest.raises(CommandError, match="favourite colour"):
        person.ask("your favourite colour")


def typed(
    parts: Emulation, file: Path | None, monkeypatch: pytest.MonkeyPatch, *lines: str
) -> None:
    """Types lines, in virtual time; after them the input ends."""
    left = list(lines)

    def line(prompt: str) -> str:
        if not left:
            raise EOFError
        return left.pop(0)

    monkeypatch.setattr("builtins.input", line)
    RehearsalConsole(parts, seed=1, file=file).run()
    assert not left


def test_a_doctor_a_session_and_a_doctor_again(
    parts: Emulation,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / "calibration.toml"
    typed(
        parts, file, monkeypatch,
        "doctor", "calibrate --only accelerometer", "six", *[""] * 6, "yes",
        "fault distance.nak", "doctor", "mend", "stand", "doctor --move", "ground",
    )  # fmt: skip
    said = capsys.readouterr().out
    assert "(simulated: six)" in said
    assert "accelerometer is written" in said
    assert said.count("\nBAD   distance") == 1
    assert " calibrate --only accelerometer\n" in said
    assert "robotd calibrate" not in said
    assert "move knee_back" in said
    calibrated, truth = read_calibration(file, COUNTS).accelerometer, parts.truth.axes
    assert calibrated is not None
    assert truth is not None
    assert calibrated.zero == pytest.approx(truth.zero, abs=0.02)
    assert calibrated.per_g == pytest.approx(truth.per_g, abs=0.02)


def test_what_it_does_not_know_is_answered_with_what_it_does(
    parts: Emulation, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    typed(
        parts, None, monkeypatch, "dance", 'doctor "', "calibrate --only", "calibrate",
        "fault daq", "try", "quit",
    )  # fmt: skip
    said = capsys.readouterr().out
    assert said.count("doctor [--move]") == 3  # at the beginning, after "dance" and "--only"
    assert "No closing quotation" in said
    assert "--calibration FILE" in said
    assert "'daq' is no fault" in said
    assert "run it in a terminal" in said


def test_what_the_hands_do_not_know_is_for_the_person_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with emulation(
        BODY, seed=0, levels=NoiseLevels(), real_time=False, log=LOG, electronics="feetech"
    ) as parts:
        typed(
            parts, tmp_path / "calibration.toml", monkeypatch,
            "calibrate --only hip_left", "", "hold", "limp", "", "q",
        )  # fmt: skip
        assert not any(parts.electronics.pulses())
    assert "! You left the session" in capsys.readouterr().out


def test_a_simulated_person_has_no_instrument_for_an_oscillator(tmp_path: Path) -> None:
    own = pi(BODY, NoiseLevels())
    assert isinstance(own.servos, PCA9685Settings)
    servos = replace(own.servos, oscillators_mhz=None)
    own = replace(own, servos=servos)
    file = tmp_path / "calibration.toml"
    with emulation(BODY, seed=0, levels=NoiseLevels(), real_time=False, log=LOG, own=own) as parts:
        person = SimulatedPerson(parts, seed=1, echo=lambda text: None)
        person.calibrate(parts.devices, file, ["hip_left"])
        calibration = read_calibration(file, own.servos.known_counts)
        assert list(calibration.joints) == ["hip_left"]
    measured = replace(servos, oscillators_mhz=(26.9,), widths_us=(600.0, 2400.0))
    assert measured.counts != servos.counts
    later, _ = with_calibration(replace(own, servos=measured), file)
    assert later.joints[0].scale.points == calibration.joints["hip_left"].scale.points
    faster = replace(own, servos=replace(servos, prescale=101))
    with pytest.raises(ConfigError, match=r"\(hip_left\)\.counts: .* 91 to 573.* 108 to 686"):
        with_calibration(faster, file)


def test_joints_are_tried_by_hand_where_servos_say_where_they_are() -> None:
    window = TerminalWindow(
        [sys.executable, "-m", "sim_robot", "--console", "--electronics", "feetech"]
    )
    try:
        window.until("simulated robot > ")
        window.press("try --limp\n")
        window.until("g, and g again: lets the joint go")
        window.press("q")
        window.until("simulated robot > ")
    finally:
        window.close()


def test_a_lost_connection_costs_one_part_at_most(tmp_path: Path) -> None:
    file = tmp_path / "calibration.toml"
    window = TerminalWindow([*COMMAND, str(file)])
    try:
        window.until("simulated robot > ")
        window.press("try\n")
        window.until("> hip_left")
        window.press("q")
        window.until("simulated robot > ")
        window.press("calibrate --only hip_left hip_front\n")
        window.until("on the stand")
        window.press("\n")
        for answer in ("u 15", "done"):
            shown = window.until(r"protractor shows (-?[\d.]+)°\)\r\nhip_left: .* measured > ")
            angle = shown.rsplit("shows ", 1)[1].split("°")[0]
            window.press(f"{angle}\n")
            window.until("measured > ")
            window.press(f"{answer}\n")
        window.until("at its new 0")
        window.press("\n")
        window.until("write this")
        window.press("yes\n")
        window.until("hip_left is written(.|\n)*hip_front: .* measured > ")
        window.hang_up()
    finally:
        window.close()
    assert list(read_calibration(file, COUNTS).joints) == ["hip_left"]
