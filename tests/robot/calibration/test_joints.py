"""One joint: it moves slowly and only as told, and only a sound table comes out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import pytest

from robot.calibration.joints import Mover, calibrate_joint
from robot.calibration.questions import Questions
from robot.configuration.calibration_file import JointCalibration
from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.drivers.buses import Buses
from robot.drivers.servos.pca9685 import PCA9685Settings
from robot.drivers.servos.servo_bus import ServoState
from robot.drivers.servos.sv203 import COUNTS
from robot.errors import AbandonedError, DeviceDataError
from sim_robot.electronics.pca9685 import PCA9685Emulator
from tests.robot.calibration.desk import Answer, Board, Script
from tests.robot.clocks import InstantClock

JOINT = DrivenJoint(
    name="hip",
    output=2,
    lower_limit=math.radians(-96),
    upper_limit=math.radians(74),
    part_radius=0.01,
    counts=COUNTS,
    scale=JointScale(((3, math.radians(-96)), (253, math.radians(74)))),
)
# A servo that turns the other way, 0.75° a count, with its zero at count 108.
GOOD: tuple[Answer, ...] = ("-15", "u 20", "u 20", "-45", "d 20", "d 20", "d 20", "d 20", "15")


def run(board: Board, script: Script) -> JointCalibration | None:
    return calibrate_joint(JOINT, Mover(board, JOINT, board.clock), Questions(script))


def test_a_swapped_shifted_and_stretched_joint_is_put_right() -> None:
    board, script = Board(), Script(*GOOD, "done", "")
    calibration = run(board, script)
    assert calibration is not None
    assert calibration.scale.count(0.0) == 108
    assert math.degrees(calibration.scale.angle(148)) == pytest.approx(-30)
    assert script.heard("other way")
    assert board.counts[2] == 108  # where it shows its new zero
    assert math.degrees(calibration.upper_limit) == pytest.approx(74)  # nobody marked another one


def test_it_moves_one_count_at_a_time_and_slower_than_the_servo_may() -> None:
    board, script = Board(), Script("u 20", "d", "u", "q")
    with pytest.raises(AbandonedError):
        run(board, script)
    counts = [128, *(count for _, _, count in board.sent)]
    assert {abs(b - a) for a, b in pairwise(counts)} == {1}
    assert counts[-1] == 128 + 20 - 5 + 5
    times = [time for time, _, _ in board.sent]
    fastest = min(b - a for a, b in pairwise(times))
    assert 1.5 / fastest < 60  # degrees per second, even if a count were 1.5°
    assert {output for _, output, _ in board.sent} == {2}


@pytest.mark.parametrize("answer", ["u 21", "d 0", "u 999", "up", "wave", "5 up", "drop"])
def test_nothing_moves_on_an_answer_that_is_not_understood(answer: str) -> None:
    board, script = Board(), Script(answer)
    with pytest.raises(AbandonedError):
        run(board, script)
    assert not board.sent
    assert len(script.said) == 2


def test_it_stays_within_the_boards_counts() -> None:
    board = Board()
    board.counts[2] = 250
    with pytest.raises(AbandonedError):
        run(board, Script("u 6", "u 5", "u 1"))
    assert board.counts[2] == 255


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        (("-15", "u 5", "-19"), "at least 10 counts"),
        (("-15", "u 20", "-15.1"), "at a stop"),  # the servo turned, the joint did not
        (("-15", "u 20", "45"), "mistyped"),
        (("-15", "u 20", "-29", "u 20", "-10"), "rise or fall"),
    ],
)
def test_an_angle_that_cannot_be_is_not_taken(answers: tuple[str, ...], words: str) -> None:
    script = Script(*answers)
    with pytest.raises(AbandonedError):
        run(Board(), script)
    assert "is not taken" in script.said[-1]
    assert words in script.said[-1]


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ((), "two points"),
        (("-15",), "two points"),
        (("80", "u 20", "90"), "zero pose"),  # 0.5° a count: zero would be at count −32
    ],
)
def test_too_little_is_not_enough(answers: tuple[str, ...], words: str) -> None:
    script = Script(*answers, "done")
    with pytest.raises(AbandonedError):
        run(Board(), script)
    assert words in script.said[-1]


def test_an_angle_can_be_measured_again_or_dropped() -> None:
    script = Script("-14", "-15", "u 20", "-31", "drop", "-30", "done", "")
    calibration = run(Board(), script)
    assert calibration is not None
    assert [round(math.degrees(angle), 1) for _, angle in calibration.scale.points] == [-15, -30]


def test_a_wrong_table_shows_at_its_zero() -> None:
    # 0.5° and 1.4° a count: one of them was misread, and the new zero is not level.
    script = Script("-15", "u 20", "-25", "done", "6", "drop", "-30", "done", "0.3")
    board = Board()
    calibration = run(board, script)
    assert script.heard("It should be 0° and is 6°")
    assert calibration is not None
    assert len(calibration.scale.points) == 2


@pytest.mark.parametrize(
    ("answers", "zero", "error"),
    [
        ((*GOOD, "done", ""), 0.3, 0.3),  # on a line, as a protractor is read
        ((*GOOD, "done", "-1.2"), 1.2, 0.3),  # and the new 0° is off
        (("-14.7", "u 20", "-29.7", "done", "-0.6"), 0.9, 0.3),  # by what its count is 0.3° for
        ((*GOOD, "u 20", "-3", "done", ""), 1.757, 1.757),  # 3° off the line of others
        (("-15", "u 20", "-30", "done", ""), 0.3, 0.3),  # two are always on a line
    ],
)
def test_how_well_it_is_known_is_what_the_readings_scatter(
    answers: tuple[str, ...], zero: float, error: float
) -> None:
    calibration = run(Board(), Script(*answers))
    assert calibration is not None
    angles = [math.degrees(angle) for _, angle in calibration.scale.points]
    known = calibration.uncertainty
    assert known.zero == pytest.approx(math.radians(zero), rel=1e-2)
    assert known.gain == pytest.approx(math.sqrt(2) * error / (max(angles) - min(angles)), rel=1e-2)


def test_marked_limits_are_taken_over() -> None:
    script = Script(*GOOD, "upper", "u 20", "u 20", "u 20", "lower", "done", "")
    calibration = run(Board(), script)
    assert calibration is not None
    assert math.degrees(calibration.upper_limit) == pytest.approx(15)
    assert math.degrees(calibration.lower_limit) == pytest.approx(-30)


def test_limits_that_were_mixed_up_are_refused() -> None:
    script = Script(*GOOD, "lower", "u 20", "u 20", "u 20", "upper", "done")
    with pytest.raises(AbandonedError):
        run(Board(), script)
    assert "mark them again" in script.said[-1]


def test_a_short_table_says_what_is_a_guess() -> None:
    script = Script("-15", "u 20", "-30", "done", "")
    run(Board(), script)
    assert script.heard("a guess")


def test_a_skipped_joint_goes_back_to_where_it_was() -> None:
    board = Board()
    assert run(board, Script("u 20", "u 20", "skip")) is None
    assert board.counts[2] == 128


def test_leaving_holds_where_it_is() -> None:
    board = Board()
    with pytest.raises(AbandonedError):
        run(board, Script("u 20", "q"))
    assert board.counts[2] == 148


def test_a_limp_joint_is_only_driven_with_notice() -> None:
    board = Board()
    board.counts[2] = 0
    script = Script("")
    with pytest.raises(AbandonedError):
        run(board, script)
    assert "limp" in script.prompts[0]
    assert [count for _, _, count in board.sent] == [128]


def test_a_limp_joint_that_is_skipped_is_not_driven() -> None:
    board, script = Board(), Script("skip")
    board.counts[2] = 0
    assert run(board, script) is None
    assert not board.sent


def test_a_limp_joint_that_is_skipped_later_is_limp_again() -> None:
    board, script = Board(), Script("", "u 20", "skip")
    board.counts[2] = 0
    assert run(board, script) is None
    assert board.sent
    assert board.counts[2] == 0


def test_a_board_that_was_reset_is_noticed_and_does_not_jump() -> None:
    board = Board()
    mover = Mover(board, JOINT, board.clock)
    mover.go(160)
    board.counts[2] = 128  # brown-out: the servo is at neutral now
    board.sent.clear()
    with pytest.raises(DeviceDataError, match="reset"):
        mover.go(170)
    mover.go(130)
    assert [count for _, _, count in board.sent] == [129, 130]


@pytest.mark.parametrize("event", ["reset", "doze", "mode2", "full_on"])
def test_a_pca9685_that_was_altered_is_set_up_anew_and_the_next_try_starts_there(
    event: str,
) -> None:
    clock = InstantClock()
    board = PCA9685Emulator(clock)
    settings = PCA9685Settings(bus=1, boards=(0x40,), prescale=121, widths_us=(500.0, 2500.0))
    servos = settings.open(Buses(clock=clock, open_i2c=lambda path: board))
    points = ((106, JOINT.lower_limit), (509, JOINT.upper_limit))
    joint = replace(JOINT, counts=settings.counts, scale=JointScale(points))
    mover = Mover(servos, joint, clock)
    mover.go(300)
    board.inject(event, 2 if event == "full_on" else 0)
    with pytest.raises(DeviceDataError):
        mover.go(310)
    assert mover.count == board.pulses()[2] == 0
    mover.go(310)
    assert mover.count == board.pulses()[2] == 310


def test_an_angle_measured_before_a_reset_is_not_taken() -> None:
    board = Board()

    def brown_out() -> None:
        board.counts[2] = 128

    script = Script("u 20", (brown_out, "-30"), "")
    with pytest.raises(AbandonedError):
        run(board, script)
    assert script.heard("it was reset")
    assert "measure once more" in script.said[-1]
    assert "0 angles measured" in script.prompts[-1]


def test_a_line_that_fails_in_mid_motion_goes_on_from_there() -> None:
    board, script = Board(failures=1), Script("u 3", "", "q")
    with pytest.raises(AbandonedError):
        run(board, script)
    assert [count for _, _, count in board.sent] == [129, 130, 131]
    assert script.heard("Look at it.")


class AnsweringBoard(Board):
    """Its servos say where they are; a hand puts one somewhere."""

    hand = 128.0

    def read_states(self, outputs: Sequence[int]) -> dict[int, ServoState]:
        return {
            output: ServoState(
                position=self.counts[output] or self.hand, driven=bool(self.counts[output])
            )
            for output in outputs
        }


def test_a_joint_whose_servo_says_where_it_is_is_moved_by_hand() -> None:
    board = AnsweringBoard()
    board.counts[2] = 0

    def put(count: float) -> None:
        board.hand = count

    script = Script(
        (lambda: put(128.4), "-15"),
        (lambda: put(168), "-45"),
        (lambda: put(88), "15"),
        "hold",
        "u 5",
        "limp",
        "",
        (lambda: put(60.0), "upper"),
        "done",
        "",
    )
    calibration = run(board, script)
    assert calibration is not None
    assert calibration.scale.count(0.0) == 108
    assert not any("drives it to its middle" in prompt for prompt in script.prompts)
    counts = [count for _, _, count in board.sent]
    assert counts[:6] == [88, 89, 90, 91, 92, 93]  # held where the hand left it, then up
    assert counts[6] == 60  # and again
    assert calibration.scale.count(calibration.upper_limit) == 60
