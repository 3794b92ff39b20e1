"""No text from elsewhere does anything at a terminal but be read."""

import io
import json

import pytest
from rich.table import Table
from rich.text import Text

from estimator.cli.console import Terminal, print_json
from estimator.cli.screen import Screen
from protocol.errors import RobotError

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
