"""Oscillators of servo boards, measured at an output that no servo hears."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from robot.calibration.oscillators import measure_oscillators
from robot.calibration.questions import Questions
from robot.drivers.buses import Buses
from robot.drivers.servos.pca9685 import PCA9685Settings
from robot.drivers.servos.sv203 import SV203Settings
from robot.errors import AbandonedError
from robot.toml_sections import toml_section
from sim_robot.electronics.i2c_bus import I2CBus
from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.calibration.desk import Answer, Script
from tests.robot.clocks import InstantClock

TRUE_MHZ = (26.94, 23.41)


class Desk:
    """Two boards whose oscillators nobody knows, and their driver."""

    def __init__(self, text: str = "") -> None:
        clock = InstantClock()
        self.boards = [
            PCA9685Emulator(clock, address=address, oscillator_mhz=mhz)
            for address, mhz in zip((0x40, 0x41), TRUE_MHZ, strict=True)
        ]
        bus = I2CBus(self.boards, clock)
        self.settings = PCA9685Settings.read(
            toml_section(f"[servos]\naddress = [0x40, 0x41]\n{text}", "").table("servos")
        )
        self.servos = self.settings.open(Buses(clock=clock, open_i2c=lambda path: bus))

    def measure(self, used: range, *answers: Answer) -> Script:
        script = Script(*answers)
        measure_oscillators(self.settings, used, self.servos, Questions(script))
        return script

    def meter(self, board: int, output: int) -> Answer:
        """What a frequency meter shows, where there are pulses."""

        def look() -> None:
            assert self.boards[board].pulses()[output] % 4096

        return look, f"{TRUE_MHZ[board] * 1e6 / 4096 / (self.settings.prescale + 1):.1f}"


def test_the_pulses_of_an_output_without_a_servo_tell_the_oscillator() -> None:
    desk = Desk()
    with pytest.raises(AbandonedError) as caught:
        desk.measure(range(8), "", desk.meter(0, 15), "", desk.meter(1, 15))
    line = str(caught.value).removeprefix("Write ").partition(" below [servos]")[0]
    known = Desk(line).settings.oscillators_mhz
    assert known == pytest.approx(TRUE_MHZ, rel=1e-3)
    assert [board.pulses() for board in desk.boards] == [(0,) * 16] * 2
    assert Desk(line).measure(range(8)).prompts == []  # nobody is asked again


def test_a_servo_that_holds_goes_on_holding_where_no_output_is_free() -> None:
    desk = Desk()
    desk.servos.read_counts([15])
    desk.servos.set_counts({15: 200})
    script = desk.measure(range(32), "", desk.meter(0, 15), "skip")
    assert "output 15, its servo unplugged" in script.prompts[0]
    assert desk.boards[0].pulses()[15] == 200


def test_what_no_oscillator_does_is_asked_again_and_who_leaves_leaves_no_pulses() -> None:
    desk = Desk()
    with pytest.raises(AbandonedError, match="You left"):
        desk.measure(range(8), "", "500", "q")
    assert desk.boards[0].pulses() == (0,) * 16
    assert desk.measure(range(8), "skip").left == 0


def test_a_board_that_is_reset_before_it_pulses_is_tried_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    desk = Desk()

    def reset_and_set(counts: Mapping[int, int]) -> None:
        monkeypatch.undo()
        desk.boards[0].inject("reset")
        desk.servos.set_counts(counts)

    monkeypatch.setattr(desk.servos, "set_counts", reset_and_set)
    script = desk.measure(range(8), "", "", desk.meter(0, 15), "skip")
    assert script.heard("was reset")
    assert script.prompts[1] == "Enter tries again"
    assert script.left == 0
    assert desk.boards[0].pulses() == (0,) * 16


@pytest.mark.parametrize("leaves", [False, True])
def test_an_output_that_pulses_unheard_does_not_go_on_pulsing(leaves: bool) -> None:
    desk = Desk()
    board = desk.boards[0]
    board.on_pulse = lambda *_: board.inject("unheard")
    answers = [desk.meter(0, 15)] if not leaves else []

    def mend() -> None:
        assert board.pulses()[15]
        board.on_pulse = lambda *_: None
        board.mend()

    with pytest.raises(AbandonedError):
        desk.measure(range(8), "", (mend, "q" if leaves else ""), *answers)
    assert board.pulses() == (0,) * 16


def test_other_boards_have_none() -> None:
    settings = SV203Settings(port="", baud=9600, boards=(1,), line_gap=0.003)
    script = Script()
    measure_oscillators(settings, (), Desk().servos, Questions(script))
    assert not script.said
