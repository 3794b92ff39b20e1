"""The board and the joints: what they stand at, and what a small move does to the supply."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot.configuration.joint_calibration import JointScale
from robot.diagnosis.findings import Finding, Severity
from robot.diagnosis.servos import QUERIES, check_board, check_joints, move_joints
from robot.drivers.servos.sv203 import SV203Settings
from tests.robot.calibration.desk import Board
from tests.robot.diagnosis.clinic import Clinic


def joint(clinic: Clinic, count: int) -> Finding:
    (finding,) = check_joints(clinic.config.joints[:1], {1: count}, Board())
    return finding


def test_a_joint_shows_where_it_stands_and_how_far_it_goes(clinic: Clinic) -> None:
    finding = joint(clinic, 144)
    assert finding.verdict is Severity.OK
    for words in ("count 144", "-0.1°", "-96.0° to 74.0°", "0.68° a count"):
        assert words in finding.text


def test_a_limp_joint_is_no_fault(clinic: Clinic) -> None:
    finding = joint(clinic, 0)
    assert finding.verdict is Severity.LOOK
    assert "python -m protocol tcp://127.0.0.1:5750 hold" in finding.advice


def test_a_joint_outside_its_limits_is_one(clinic: Clinic) -> None:
    narrow = replace(clinic.config.joints[0], upper_limit=0.1)
    (finding,) = check_joints([narrow], {1: 200}, Board())
    assert finding.verdict is Severity.BAD
    assert finding.part == "hip_left"


def test_an_unusual_scale_is_mentioned(clinic: Clinic) -> None:
    flat = replace(clinic.config.joints[0], scale=JointScale(((1, -0.5), (255, 0.5))))
    (finding,) = check_joints([flat], {1: 128}, Board())
    assert finding.verdict is Severity.LOOK


def test_a_board_at_neutral_was_just_switched_on(clinic: Clinic) -> None:
    def boards() -> list[str]:
        return [one.text for one in clinic.examine() if one.subject == "servo board"]

    assert any("switching on" in text for text in boards())
    clinic.robot.servo_board.power_cycle()
    port = clinic.config.servos.open(clinic.robot.buses)
    port.read_counts([1])
    port.set_counts({1: 100})
    port.close()
    assert not any("switching on" in text for text in boards())


def test_servos_that_cannot_be_read_back_are_worth_a_look(clinic: Clinic) -> None:
    class Mute(SV203Settings):
        reads_back = False

    (finding,), counts = check_board(
        Board(), Mute(port="", baud=9600, boards=(1,), line_gap=0.003), [1], clinic.clock
    )
    assert finding.verdict is Severity.LOOK
    assert "cannot be read back" in finding.text
    assert not counts


def test_one_repeated_query_is_worth_a_look_and_does_not_keep_the_joints_still(
    clinic: Clinic,
) -> None:
    clinic.robot.servo_board.inject("garbage", QUERIES)
    findings = clinic.examine(move=True)
    (board,) = (one for one in findings if "had to be repeated" in one.text)
    assert board.verdict is Severity.LOOK
    assert f"1 of {QUERIES + 1} queries" in board.text
    assert sum(one.subject.startswith("move ") for one in findings) == len(clinic.config.joints)


def test_moves_are_small_slow_one_after_another_and_back(clinic: Clinic) -> None:
    board = Board()
    before = dict(board.counts)
    findings = list(move_joints(clinic.config.joints, board.counts | {}, board, board.clock))
    assert [one.verdict for one in findings] == [Severity.OK] * 8
    assert board.counts == before
    outputs = [output for _, output, _ in board.sent]
    assert outputs == sorted(outputs)
    for output in range(1, 9):
        counts = [128, *(count for _, at, count in board.sent if at == output)]
        assert max(counts) - min(counts) == 7  # 5° of 0.68° or 0.76°
        assert {abs(b - a) for a, b in zip(counts[1:], counts, strict=False)} == {1}


def test_a_joint_at_its_upper_end_is_moved_down(clinic: Clinic) -> None:
    board = Board(counts={1: 253})
    list(move_joints(clinic.config.joints[:1], {1: 253}, board, board.clock))
    assert min(count for _, _, count in board.sent) < 253
    assert max(count for _, _, count in board.sent) == 253


@pytest.mark.parametrize("count", [0, 255])
def test_a_joint_that_is_limp_or_outside_is_not_moved(clinic: Clinic, count: int) -> None:
    narrow = replace(clinic.config.joints[0], upper_limit=0.1)
    board = Board(counts={1: count})
    (finding,) = move_joints([narrow], {1: count}, board, board.clock)
    assert finding.verdict is Severity.LOOK
    assert not board.sent


def test_a_supply_that_drops_under_load_is_found_and_ends_the_moves(clinic: Clinic) -> None:
    class Weak(Board):
        def set_counts(self, counts: object) -> None:
            super().set_counts(counts)  # type: ignore[arg-type]
            if self.counts[3] > 132:
                self.counts = dict.fromkeys(self.counts, 128)

    board = Weak()
    before = board.counts | {1: 100}
    board.counts[1] = 100
    findings = list(move_joints(clinic.config.joints, before, board, board.clock))
    assert [one.verdict for one in findings] == [Severity.OK, Severity.OK, Severity.BAD]
    assert "supply" in findings[-1].advice


def test_nothing_moves_over_a_line_that_loses_bytes(clinic: Clinic) -> None:
    clinic.robot.servo_board.inject("garbage", 3)
    findings = clinic.examine(move=True)
    assert not any(one.subject.startswith("move ") for one in findings)
    assert "moves" in {one.subject for one in findings}
    assert clinic.robot.servo_board.pulses() == (128,) * 8
