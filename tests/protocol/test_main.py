"""A robot by hand, from a terminal."""

from __future__ import annotations

import pytest

from protocol.__main__ import main
from tests.processes.simulator import simulator


def test_stop_latches_until_clear(capsys: pytest.CaptureFixture[str]) -> None:
    with simulator() as robot:
        states = []
        for command in ("status", "stop", "hold", "clear", "relax", "hold"):
            code = main([robot.uri, command])
            seen = capsys.readouterr()
            states.append((command, code, seen.out.split(":")[0].strip()))
            if command == "stop" or code:  # whoever finds it frozen is told how to go on
                assert f"python -m protocol {robot.uri} clear" in seen.out + seen.err
            else:
                assert "clear" not in seen.out
    assert states == [
        ("status", 0, "idle"),
        ("stop", 0, "stopped"),
        ("hold", 1, ""),
        ("clear", 0, "holding"),
        ("relax", 0, "relaxed"),
        ("hold", 0, "holding"),
    ]


def test_nobody_there_is_a_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("protocol.__main__.TIMEOUT", 0.5)
    assert main(["tcp://127.0.0.1:9", "status"]) == 1
    assert "127.0.0.1:9" in capsys.readouterr().err
