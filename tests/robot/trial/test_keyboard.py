"""``robotd try`` in a real terminal: keys move a servo, and the terminal is as it was before."""

from __future__ import annotations

import os
import signal
import sys
import tty
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

import pytest

from robot.cli.command_line import main
from robot.trial.keyboard import Keyboard
from robot.trial.session import QUIT
from sim_robot.electronics.sv203 import SV203Emulator
from tests.terminal_window import TerminalWindow

EXAMPLE = Path(str(resources.files("robot") / "robot.toml")).read_text(encoding="utf-8")
PAGE_UP = "\x1b[5~"


@pytest.fixture
def board() -> Iterator[SV203Emulator]:
    emulator = SV203Emulator()
    yield emulator
    emulator.close()


@pytest.fixture
def window(board: SV203Emulator, tmp_path: Path) -> Iterator[TerminalWindow]:
    config = tmp_path / "robot.toml"
    config.write_text(EXAMPLE.replace("/dev/ttyS0", board.port), encoding="utf-8")
    shown = TerminalWindow([sys.executable, "-m", "robot", "try", "--config", str(config)])
    yield shown
    shown.close()


@pytest.mark.parametrize("end", ["\x03", "q", signal.SIGTERM, None])
def test_keys_move_a_servo_and_leaving_holds_it(
    window: TerminalWindow, board: SV203Emulator, end: str | signal.Signals | None
) -> None:
    window.until("> hip_left")
    assert board.pulses() == (128,) * 8  # nothing moves by itself
    window.press(PAGE_UP * 4)
    window.until(r"hip_left .*count (?!128)")
    match end:
        case str():
            window.press(end)
        case signal.Signals():
            window.process.send_signal(end)
        case None:
            window.hang_up()
    assert end is None or window.ended() == 0
    held = board.pulses()
    assert held[0] not in (0, 128)
    assert held[1:] == (128,) * 7


def test_without_a_terminal_it_says_so(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(EXAMPLE, encoding="utf-8")
    assert main(["try", "--config", str(config)]) == 1
    assert "run it in a terminal" in capsys.readouterr().err


class Typist:
    """Types at a terminal, and sees what keys that is taken for."""

    def __init__(self, near: int, far: int) -> None:
        self._far = far
        self._view = Keyboard(near)

    def keys(self, typed: bytes) -> list[str]:
        os.write(self._far, typed)
        return list(iter(self._view.key, None))


@pytest.fixture
def typist() -> Iterator[Typist]:
    near, far = os.openpty()
    tty.setraw(near)
    yield Typist(near, far)
    os.close(near)
    os.close(far)


def test_a_stop_overtakes_what_was_typed_before_it(typist: Typist) -> None:
    assert typist.keys(b"\x1b[5~" * 40 + b" \x1b[B") == ["space", "down"]
    assert typist.keys(b"\x1b[5~" * 40 + b"\x03") == [QUIT]


@pytest.mark.parametrize("typed", [b"\x1b[20~", b"\x1b[6;5~", b"\x1bOP", b"\x1bh", b"\x1b\r"])
def test_a_sequence_that_means_nothing_is_one_key(typist: Typist, typed: bytes) -> None:
    assert len(typist.keys(typed)) == 1
    assert typist.keys(typed + b"0")[1:] == ["0"]


def test_a_sequence_that_arrives_in_parts_is_one_key(typist: Typist) -> None:
    assert [typist.keys(part) for part in (b"\x1b", b"[2", b"0")] == [[], [], []]
    assert len(typist.keys(b"~")) == 1
    assert [typist.keys(part) for part in (b"\x1b[", b"A")] == [[], ["up"]]


def test_escape_holds_up_neither_a_sequence_nor_a_stop(typist: Typist) -> None:
    assert typist.keys(b"\x1b\x1b[5~") == ["\x1b", "page up"]
    assert len(typist.keys(b"\x1b\x1b[20~")) == 2
    assert typist.keys(b"\x1b") == []
    assert typist.keys(b" ") == ["space"]
    assert typist.keys(b"\x1b[2\x1b[B")[1:] == ["down"]
