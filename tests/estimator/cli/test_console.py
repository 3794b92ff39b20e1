"""No text from elsewhere does anything at a terminal but be read."""

import io
import json
import math
import shlex
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from estimator.cli.console import Terminal, errors_as_sentences, fail, print_json
from estimator.cli.screen import Screen
from estimator.readings.observation import Observation
from protocol.errors import RobotError
from tests.estimator.report.made_runs import made_run

EVIL = "knee[/x]\x1b]0;owned\x07\x1b[31m\x9b2J\u202e:smile:"
SHOWN = r"knee[/x]\x1b]0;owned\x07\x1b[31m\x9b2J\u202e:smile:"


def make() -> tuple[Terminal, io.StringIO]:
    text = io.StringIO()
    return Terminal(file=text, width=200, force_terminal=True, color_system="standard"), text


def test_brackets_are_text_and_control_characters_are_escapes() -> None:
    console, text = make()
    table = Table(EVIL)
    table.add_row(EVIL)
    console.print(EVIL, highlight=False)
    console.print(Text.assemble((EVIL, "red")))
    console.print(table)
    said = text.getvalue()
    assert said.count(r"\x1b]0;owned") == 4
    assert SHOWN.replace(r"\x07", "") in said  # rich itself drops the bell
    for raw in ("\x07", "\x9b", "\u202e", "\x1b]", "😄"):
        assert raw not in said
    assert "\x1b[31m" in said  # our own colour still works


def test_what_a_robot_says_during_a_run_is_only_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("builtins.input", lambda *_: "")
    console, text = make()
    with Screen(console, interactive=True) as screen:
        screen.say(EVIL)
        screen.moving(0, EVIL, 0.5)
        screen.worked(1.0, EVIL)
        assert screen.may_retry(RobotError("fault", EVIL, advice=EVIL))
    said = text.getvalue()
    assert said.count(r"knee[/x]\x1b]0;owned") >= 3
    assert "\x1b]" not in said
    assert "\x9b" not in said


def test_json_stays_json(capsys: pytest.CaptureFixture[str]) -> None:
    whole = {"joint": EVIL + "\U000e0001é"}
    print_json(json.dumps(whole, ensure_ascii=False, indent=2))
    said = capsys.readouterr().out
    assert json.loads(said) == whole
    assert all(char.isprintable() or char == "\n" for char in said)
    assert "é" in said


def test_how_to_go_on_can_be_typed_whatever_the_run_is_called(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = made_run(tmp_path / "my run", "parametric", "paper", complete=False)
    with pytest.raises(typer.Exit):
        fail("interrupted", place)
    _, command = capsys.readouterr().err.split("Go on with: ")
    assert shlex.split(command) == ["estimator", "resume", str(place)]


@pytest.mark.parametrize(
    ("pragma", "text", "advice"),
    [
        ("max_page_count = 2", "x" * 100_000, "is full. Look whether the disk is full."),
        ("query_only = 1", "", "database. Look whether its directory can be written."),
        ("foreign_keys = 1", None, "NOT NULL constraint failed: only.text."),
    ],
)
def test_the_disk_is_looked_at_only_where_it_may_be_the_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], pragma: str, text: str | None, advice: str
) -> None:
    with closing(sqlite3.connect(tmp_path / "run.sqlite")) as database:
        database.execute("CREATE TABLE only (text TEXT NOT NULL)")
        database.execute(f"PRAGMA {pragma}")
        with pytest.raises(typer.Exit), errors_as_sentences(None):
            database.execute("INSERT INTO only VALUES (?)", (text,))
    said = capsys.readouterr().err
    assert said.startswith("estimator: the run's database cannot be written: ")
    assert said.endswith(f"{advice}\n")


NOT_PLANAR = RobotError("not_planar", "It leans.")


def plain_console(*, terminal: bool = False) -> tuple[Console, io.StringIO]:
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
    console, text = plain_console(terminal=True)
    with Screen(console, interactive=True) as screen:
        assert screen.may_retry(NOT_PLANAR)
    assert "It leans. Put the robot back as it lay or stood at first" in text.getvalue()


def test_without_a_person_nobody_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    answer(monkeypatch, "")
    console, text = plain_console()
    with Screen(console, interactive=False) as screen:
        assert not screen.may_retry(NOT_PLANAR)
    assert not text.getvalue()


def test_the_end_of_input_is_a_no(monkeypatch: pytest.MonkeyPatch) -> None:
    answer(monkeypatch)
    console, _ = plain_console()
    with Screen(console, interactive=True) as screen:
        assert not screen.may_retry(NOT_PLANAR)


def test_a_movement_comes_with_its_reason_and_what_it_is_expected_to_tell() -> None:
    console, text = plain_console()
    with Screen(console) as screen:
        screen.chosen(2, "tells apart: front leg on its left or right side", 3.14)
        screen.chosen(3, "was recorded", None)
    first, second = text.getvalue().splitlines()
    assert first == (
        "Interaction 3 tells apart: front leg on its left or right side; it is expected to leave "
        "one possibility in 9."
    )
    assert second == "Interaction 4 was recorded."


def test_an_observation_reads_in_degrees_and_millimetres() -> None:
    console, text = plain_console()
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


def test_ground_beyond_the_distance_sensor_is_said_to_be_farther() -> None:
    console, text = plain_console()
    with Screen(console) as screen:
        screen.observed(0, Observation(angles=(0.0,), clearance=0.2, clearance_saturated=True))
    assert text.getvalue() == "Interaction 1: touch ?, tilt ?, ?, at least 200 mm clear.\n"


def test_a_terminal_shows_how_far_the_work_is() -> None:
    console, text = plain_console(terminal=True)
    with Screen(console) as screen:
        screen.expect(200, 50)
        screen.worked(50, "generation 3")
        screen.moving(0, "settling", 0.5)
    assert "50%" in text.getvalue()
    assert "interaction 1: settling" in text.getvalue()
    assert "left" in text.getvalue()
