"""Log lines: for the journal and for a terminal, and never at the robot's cost."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import pytest

from robot.host.logs import LineHandler, complain, reads_journal


def logger(fd: int) -> logging.Logger:
    logger = logging.Logger("robotd")
    logger.addHandler(LineHandler(fd))
    return logger


def journal(monkeypatch: pytest.MonkeyPatch, fd: int) -> None:
    status = os.fstat(fd)
    monkeypatch.setenv("JOURNAL_STREAM", f"{status.st_dev}:{status.st_ino}")


def test_a_terminal_gets_the_time_and_the_journal_a_priority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / "log").open("w+b", buffering=0) as file:
        logger(file.fileno()).warning("stopped by %s", "client a")
        journal(monkeypatch, file.fileno())
        log = logger(file.fileno())
        log.warning("stopped")
        log.error("fault")
        log.info("cleared")
        file.seek(0)
        first, *others = file.read().decode().splitlines()
    assert first[:2] == "20"  # the year: systemd would add its own
    assert first.endswith("robotd WARNING: stopped by client a")
    assert others == ["<4>stopped", "<3>fault", "<6>cleared"]


def test_each_line_of_a_traceback_has_its_priority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / "log").open("w+b", buffering=0) as file:
        journal(monkeypatch, file.fileno())
        try:
            raise ValueError("a bug")
        except ValueError:
            logger(file.fileno()).exception("the control loop failed")
        file.seek(0)
        lines = file.read().decode().splitlines()
    assert len(lines) >= 4
    assert all(line.startswith("<3>") for line in lines)
    assert lines[-1] == "<3>ValueError: a bug"


@pytest.mark.parametrize(
    ("text", "words"),
    [("x" * 5_000_000, "ValueError: xxx"), ("x\n" * 500_000, "lines are left out")],
)
def test_what_others_raise_does_not_fill_the_log(tmp_path: Path, text: str, words: str) -> None:
    with (tmp_path / "log").open("w+b", buffering=0) as file:
        log = logger(file.fileno())
        log.error("fault: %s", text)
        try:
            raise ValueError(text) from KeyError(text)
        except ValueError:
            log.exception("the control loop failed")
        file.seek(0)
        lines = file.read().decode().splitlines()
    assert sum(map(len, lines)) < 50_000
    assert any(words in line for line in lines)
    assert any("the control loop failed" in line for line in lines)


def test_a_client_cannot_forge_a_line(tmp_path: Path) -> None:
    with (tmp_path / "log").open("w+b", buffering=0) as file:
        logger(file.fileno()).info("stopped by %s", "x\n<3>robotd: fault\x1b[2J\u2028")
        file.seek(0)
        text = file.read().decode()
    assert len(text.splitlines()) == 1
    assert r"x\n<3>robotd: fault\x1b[2J\u2028" in text


@pytest.mark.parametrize("stream", [None, "", "1:2"])
def test_what_is_not_the_journal(monkeypatch: pytest.MonkeyPatch, stream: str | None) -> None:
    assert not reads_journal(2, {} if stream is None else {"JOURNAL_STREAM": stream})
    assert not reads_journal(-1, {"JOURNAL_STREAM": "1:2"})


def test_a_full_disk_loses_lines_and_nothing_else() -> None:
    with Path("/dev/full").open("wb", buffering=0) as full:
        log = logger(full.fileno())
        for _ in range(1000):
            log.error("fault: %s", "x" * 100)


def test_a_reader_that_sleeps_is_not_waited_for_and_told_what_it_missed() -> None:
    reading, writing = os.pipe()
    try:
        log = logger(writing)
        for number in range(2000):
            log.info("line %d %s", number, "x" * 10_000)
        got = os.read(reading, 1 << 20).decode().splitlines()
        log.info("awake")
        count, last = os.read(reading, 1 << 20).decode().splitlines()
    finally:
        os.close(reading)
        os.close(writing)
    assert count == f"({2000 - len(got)} log lines were lost)"
    assert last.endswith("awake")
    assert all(len(line) < 4096 for line in got)


def test_the_reason_of_an_end_is_an_error_in_the_journal(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    complain("robotd", ValueError("no board"))
    journal(monkeypatch, 2)
    complain("robotd", ValueError("no board"))
    assert capfd.readouterr().err == "robotd: no board\n<3>no board\n"
