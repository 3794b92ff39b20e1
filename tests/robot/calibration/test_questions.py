"""Answers that make no sense are asked for again; everything can be left."""

from __future__ import annotations

import pytest

from robot.calibration.questions import Console, Questions, number
from robot.errors import AbandonedError, DeviceTimeoutError
from tests.robot.calibration.desk import Script


@pytest.mark.parametrize(
    ("text", "value"),
    [("-12.5", -12.5), ("12,5", 12.5), ("+3", 3.0), ("", None), ("nan", None), ("inf", None),
     ("1e99", None), ("five", None)],
)  # fmt: skip
def test_a_number_may_have_a_comma(text: str, value: float | None) -> None:
    assert number(text) == value


def test_a_number_is_asked_for_until_it_is_one() -> None:
    script = Script("many", "-1", "1000", " 7,5 ")
    assert Questions(script).number("how many", 0, 10) == 7.5
    assert len(script.prompts) == 4
    assert script.heard("0 to 10")


def test_a_choice_may_be_shortened_as_long_as_it_is_clear() -> None:
    script = Script("s", "x", "", "SK")
    assert Questions(script).choose("which", "six", "skip") == "skip"
    assert len(script.prompts) == 4


def test_enter_is_a_choice_only_where_it_is_offered() -> None:
    assert Questions(Script("")).choose("go on", "", "skip") == ""
    assert Questions(Script("", "yes")).choose("sure", "yes", "no") == "yes"


@pytest.mark.parametrize("answers", [("q",), ("Quit",), ()])
def test_every_question_can_be_left(answers: tuple[str, ...]) -> None:
    with pytest.raises(AbandonedError):
        Questions(Script(*answers)).ask("?")
    with pytest.raises(AbandonedError):
        Questions(Script(*answers)).number("?", 0, 1)
    with pytest.raises(AbandonedError):
        Questions(Script(*answers)).choose("?", "yes", "no")


def test_a_failing_device_is_tried_again_and_its_advice_is_shown() -> None:
    failures = [DeviceTimeoutError("It is late.", "Look at the cable.")] * 2

    def measure() -> int:
        if failures:
            raise failures.pop()
        return 7

    script = Script("", "")
    assert Questions(script).attempt(measure) == 7
    assert script.heard("Look at the cable.")


def test_a_failing_device_can_be_left_alone() -> None:
    def fail() -> None:
        raise DeviceTimeoutError("It is late.", "Look at the cable.")

    with pytest.raises(AbandonedError):
        Questions(Script("", "", "q")).attempt(fail)


def test_the_console_is_standard_input_and_output(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: list[str] = []

    def type_five(prompt: str) -> str:
        shown.append(prompt)
        return "5"

    monkeypatch.setattr("builtins.input", type_five)
    Console().say("Hello")
    assert Console().ask("how many") == "5"
    assert shown == ["how many > "]
    assert capsys.readouterr().out == "Hello\n"
