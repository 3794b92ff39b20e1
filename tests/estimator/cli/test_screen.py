import io
import math

import pytest
from rich.console import Console

from estimator.cli.screen import Screen
from estimator.readings.observation import Observation
from protocol.errors import RobotError

NOT_PLANAR = RobotError("not_planar", "It leans.")


def make(*, terminal: bool = False) -> tuple[Console, io.StringIO]:
    text = io.StringIO()
    return Console(file=text, force_terminal=terminal, width=100), text


def answer(monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    waiting = list(lines)

    def line(*_: object) -> str:
        if not waiting:
            raise EOFError
        return waiting.pop()

    monkeypatch.setattr("builtins.input", line)


def test_a_person_reads_the_advice_and_presses_enter(monkeypatch: pytest.MonkeyPatch) -> None:
    answer(monkeypatch, "")
    console, text = make(terminal=True)
    with Screen(console, interactive=True) as screen:
        assert screen.may_retry(NOT_PLANAR)
    assert "It leans. Put the robot back as it lay or stood at first" in text.getvalue()


def test_without_a_person_nobody_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    answer(monkeypatch, "")
    console, text = make()
    with Screen(console, interactive=False) as screen:
        assert not screen.may_retry(NOT_PLANAR)
    assert not text.getvalue()


def test_the_end_of_input_is_a_no(monkeypatch: pytest.MonkeyPatch) -> None:
    answer(monkeypatch)
    console, _ = make()
    with Screen(console, interactive=True) as screen:
        assert not screen.may_retry(NOT_PLANAR)


def test_a_movement_comes_with_its_reason_and_what_it_is_expected_to_tell() -> None:
    console, text = make()
    with Screen(console) as screen:
        screen.chosen(2, "tells apart: front leg on its left or right side", 3.14)
        screen.chosen(3, "was recorded", None)
    first, second = text.getvalue().splitlines()
    assert first == (
        "Interaction 3 tells apart: front leg on its left or right side; expected 3.1 bits."
    )
    assert second == "Interaction 4 was recorded."


def test_an_observation_reads_in_degrees_and_millimetres() -> None:
    console, text = make()
    with Screen(console) as screen:
        screen.observed(
            0,
            Observation(
                angles=(0.0,),
                touch=(True, None, False),
                tilt=(math.radians(-12.34), None),
                clearance=0.0567,
            ),
        )
    assert text.getvalue() == "Interaction 1: touch 1?0, tilt -12.3°, ?, 57 mm clear.\n"


def test_a_terminal_shows_how_far_the_work_is() -> None:
    console, text = make(terminal=True)
    with Screen(console) as screen:
        screen.expect(200, 50)
        screen.worked(50, "generation 3")
        screen.moving(0, "settling", 0.5)
    assert "50%" in text.getvalue()
    assert "interaction 1: settling" in text.getvalue()
    assert "left" in text.getvalue()
