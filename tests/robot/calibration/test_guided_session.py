"""The whole session on emulated electronics: it can be left anywhere, and skipping keeps."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from bench.still_robot import StillRobot, still_robot
from robot.calibration.guided_session import GuidedSession, parts
from robot.calibration.questions import Questions, Terminal
from robot.cli.calibrate import calibrate
from robot.configuration.calibration_file import (
    Calibration,
    DistanceCalibration,
    read_calibration,
    save_calibration,
)
from robot.devices import Devices, revive
from robot.drivers.sensors.vl6180x import VL6180X
from robot.drivers.servos.sv203 import COUNTS, SV203
from robot.errors import AbandonedError, CommandError
from tests.robot.calibration.desk import Answer, Script
from tests.robot.clocks import InstantClock

ONLY = ("hip_left", "accelerometer", "lower_left", "distance")


@dataclass
class Desk:
    robot: StillRobot
    clock: InstantClock
    devices: Devices

    def session(self, terminal: Terminal, *only: str) -> GuidedSession:
        config = self.robot.config
        dialogue = Questions(terminal, reconnect=partial(revive, config, self.devices))
        return GuidedSession(config, self.devices, clock=self.clock, dialogue=dialogue, only=only)

    def measured(self, before: Calibration, script: Script, *only: str) -> Calibration:
        """What a session that is not left comes to."""
        saved = [before]
        self.session(script, *only).run(before, lambda name, calibration: saved.append(calibration))
        return saved[-1]

    def pulses(self) -> tuple[int, ...]:
        board = self.robot.servo_board
        assert board.wait_until_read(self.robot.servos.bytes_written, 10)
        return board.pulses()

    def start_again(self) -> None:
        """Every servo at 128, as after switching on, and no load on the foot."""
        self.pulses()
        self.robot.world.volts[3] = 0.2
        self.robot.servo_board.power_cycle()
        self.robot.servos.forget()

    def answers(self) -> list[Answer]:
        """What calibrates ``ONLY``; count 128 is −20°, and 0.6° a count."""
        world = self.robot.world

        def load() -> None:
            world.volts[3] = 0.6

        def raise_plate() -> None:
            world.distance_mm = 108.0

        def lower_plate() -> None:
            world.distance_mm = 8.0

        return [
            "", "-20", "u 20", "u 20", "4", "done", "0", "yes",
            "level", "", "", "", "", "yes",
            "", (load, "2"), "yes",
            "", (lower_plate, ""), "", "", "done", "98", (raise_plate, ""), "", "", "done", "yes",
        ]  # fmt: skip


@pytest.fixture
def desk() -> Iterator[Desk]:
    clock = InstantClock()
    with still_robot(clock, housekeeping=None, log=logging.getLogger("test")) as robot:
        yield Desk(robot, clock, robot.devices)


def test_it_measures_what_is_asked_for_and_keeps_the_rest(desk: Desk) -> None:
    before = Calibration(robot="quadruped", distance=DistanceCalibration(zero=0.02, scale=1.1))
    script = Script(*desk.answers())
    calibration = desk.measured(before, script, *ONLY)
    assert script.left == 0
    assert list(calibration.joints) == ["hip_left"]
    assert calibration.joints["hip_left"].scale.count(0.0) == 161
    assert calibration.accelerometer is not None
    assert calibration.gauges["lower_left"].volts_per_newton == pytest.approx(0.2, rel=0.01)
    assert calibration.distance is not None
    assert calibration.distance.zero == pytest.approx(0.008)
    assert calibration.distance.scale == pytest.approx(0.98)
    only_joint = Script("", "-20", "u 20", "u 20", "4", "done", "0", "yes")
    assert desk.measured(before, only_joint, "hip_left").distance == before.distance
    desk.robot.world.volts[0] += 0.01
    only_level = Script("level", "", "", "", "", "yes")
    kept = desk.measured(calibration, only_level, "accelerometer")
    assert (kept.joints, kept.gauges, kept.distance) == (
        calibration.joints,
        calibration.gauges,
        calibration.distance,
    )


def test_everything_is_asked_for_when_nothing_is_said(desk: Desk) -> None:
    script = Script("", *["skip"] * 14)
    before = Calibration(robot="quadruped")
    assert desk.measured(before, script) is before
    assert script.left == 0
    names = parts(desk.robot.config)
    assert len(names) == 8 + 1 + 4 + 1
    for name in names:
        assert any(prompt.startswith(name) for prompt in script.prompts), name


def test_an_unknown_part_is_named(desk: Desk) -> None:
    with pytest.raises(CommandError, match=r"wing.*hip_left"):
        desk.session(Script(), "wing")


class Leaving(Script):
    """Answers, and then leaves in one of the ways that there are."""

    def __init__(self, way: str, *answers: Answer):
        super().__init__(*answers)
        self.way = way

    def ask(self, prompt: str) -> str:
        if self.left:
            return super().ask(prompt)
        self.prompts.append(prompt)
        if self.way == "interrupt":
            raise KeyboardInterrupt
        if self.way == "end":
            raise EOFError
        return self.way


@pytest.mark.parametrize("way", ["q", "interrupt", "end"])
def test_it_can_be_left_at_every_question(desk: Desk, tmp_path: Path, way: str) -> None:
    file = tmp_path / "calibration.toml"
    save_calibration(file, Calibration(robot="quadruped", revision=1, made="once"), COUNTS)
    before = file.read_bytes()
    whole = Script(*desk.answers())
    desk.measured(Calibration(robot="quadruped"), whole, *ONLY)
    for length in range(len(desk.answers())):
        desk.start_again()
        file.write_bytes(before)
        file.with_name("calibration.toml.1").unlink(missing_ok=True)
        script = Leaving(way, *desk.answers()[:length])
        written = ONLY[: desk.answers()[:length].count("yes")]
        kept = f"has {', '.join(written)}" if written else "is as it was"
        with pytest.raises(AbandonedError, match=rf"holds; .*calibration.toml {kept}\."):
            calibrate(
                desk.robot.config,
                read_calibration(file, COUNTS),
                desk.devices,
                clock=desk.clock,
                terminal=script,
                file=file,
                only=ONLY,
            )
        assert script.prompts == whole.prompts[: length + 1]
        names = ["calibration.toml"]
        if written:  # and so no measurement is lost but that of the part at which it was left
            calibration = read_calibration(file, COUNTS)
            assert calibration.revision == 2
            parts_now = (
                calibration.joints,
                calibration.accelerometer,
                calibration.gauges,
                calibration.distance,
            )
            assert [bool(part) for part in parts_now] == [n < len(written) for n in range(4)]
            names.append("calibration.toml.1")
            assert (tmp_path / names[1]).read_bytes() == before
        else:
            assert file.read_bytes() == before
        assert sorted(path.name for path in tmp_path.iterdir()) == names
        held = desk.pulses()
        assert all(held)  # nothing is limp
        assert held[1:] == (128,) * 7  # and only the joint in question ever moved


def test_an_interrupt_in_mid_motion_leaves_the_joint_where_it_is(desk: Desk) -> None:
    class Impatient(InstantClock):
        def sleep(self, seconds: float) -> None:
            super().sleep(seconds)
            if self.now() > 1:
                raise KeyboardInterrupt

    clock = Impatient()
    session = GuidedSession(
        desk.robot.config,
        desk.devices,
        clock=clock,
        dialogue=Questions(Script("", "u 20", "u 20", "u 20")),
        only=["hip_left"],
    )
    with pytest.raises(AbandonedError):
        session.run(Calibration(robot="quadruped"), lambda name, calibration: None)
    assert 128 < desk.pulses()[0] < 188


def test_no_is_no(desk: Desk) -> None:
    answers = [*desk.answers()[:-1], "no"]
    calibration = desk.measured(Calibration(robot="quadruped"), Script(*answers), *ONLY)
    assert calibration.distance is None
    assert calibration.gauges


def test_what_could_not_be_read_again_is_not_taken(desk: Desk) -> None:
    desk.robot.world.volts[3] = 0.2

    def load() -> None:
        desk.robot.world.volts[3] = 4.7  # 0.05 N: that would be 90 V a newton

    before = Calibration(robot="quadruped")
    script = Script("", (load, "0.05"))
    assert desk.measured(before, script, "lower_left") is before
    assert script.heard("lower_left is not taken")
    assert script.heard("volts_per_newton")


def test_a_cable_that_comes_back_goes_on_with_the_part(desk: Desk) -> None:
    board = desk.robot.servo_board

    def pull() -> None:
        desk.pulses()
        board.unplug()

    script = Script(
        "", "-20", "u 20", (pull, "u 20"), (board.replug, ""), "4", "done", "0", "yes"
    )  # fmt: skip
    calibration = desk.measured(Calibration(robot="quadruped"), script, "hip_left")
    assert script.heard("Check that the adapter is plugged in")
    assert script.left == 0
    assert calibration.joints["hip_left"].scale.count(0.0) == 161


def test_a_reading_that_is_no_number_is_not_taken(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    distance, bad = VL6180X.distance, [math.nan, math.inf]
    monkeypatch.setattr(VL6180X, "distance", lambda it: bad.pop() if bad else distance(it))
    tries = ["", ""]  # each bad reading is said, and Enter tries again
    first, *answers = desk.answers()[-11:]
    script = Script(first, answers[0], *tries, *answers[1:])
    ruler = desk.measured(Calibration(robot="quadruped"), script, "distance").distance
    assert script.left == 0
    assert ruler is not None
    assert ruler.zero == pytest.approx(0.008)
    assert sum("no finite number" in text for text in script.said) == 2


def test_a_driver_that_would_end_the_program_is_tried_again(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    verify, calls = SV203.verify, []

    def leave_once(servos: SV203, expected: Mapping[int, int]) -> list[int]:
        calls.append(expected)
        if len(calls) == 2:
            raise SystemExit(0)
        return verify(servos, expected)

    monkeypatch.setattr(SV203, "verify", leave_once)
    answers = ["", "-20", "u 20", "", "u 20", "4", "done", "0", "yes"]
    script = Script(*answers)
    calibration = desk.measured(Calibration(robot="quadruped"), script, "hip_left")
    assert script.heard("SV203 failed in verify: SystemExit: 0")
    assert calibration.joints["hip_left"].scale.count(0.0) == 161
