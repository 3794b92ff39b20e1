"""``estimator identify --live`` and ``estimator watch``, as processes and in sentences."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import IO

import pytest
from typer.testing import CliRunner
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from estimator.cli import live
from estimator.cli.command_line import app
from estimator.report.live.front import LARGEST
from protocol.system.missing_library import install_command
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import ModelRobot, make_order, serving
from tests.estimator.report.live.test_front import send_until_closed


@contextmanager
def estimator(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-m", "estimator", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def line_with(output: IO[str] | None, words: str) -> str:
    """The next line that says something; what comes before it is passed over."""
    assert output is not None
    read = []
    for line in output:
        read.append(line)
        if re.search(words, line):
            return line
    raise AssertionError("".join(read))


def is_served(uri: str) -> bool:
    try:
        with urllib.request.urlopen(uri, timeout=120) as answer:
            return b"<html" in answer.read(1000)
    except OSError:
        return False


def attack(uri: str) -> None:
    """Sends a page more than its memory should hold, and what no browser sends."""
    for message in (bytes(45 << 20), bytes(45 << 20), b"garbage", b"\x80"):
        with connect(
            uri.replace("http", "ws", 1),
            origin=Origin(uri),
            subprotocols=[Subprotocol(f"viser-v{metadata.version('viser')}")],
            compression=None,
            max_size=None,
            max_queue=None,
        ) as page:
            if len(message) <= LARGEST:
                page.send(message)
                assert page.ping().wait(120)  # by now the message has been looked at
                continue
            with pytest.raises(ConnectionClosed):
                send_until_closed(page, message)


def largest_memory(process: subprocess.Popen[str]) -> int:
    """What a process has had at most so far, MiB."""
    status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
    (kib,) = re.findall(r"VmHWM:\s*(\d+) kB", status)
    return int(kib) // 1024


def test_a_run_has_its_page_while_it_goes_on_and_can_be_watched_afterwards(tmp_path: Path) -> None:
    robot, run = ModelRobot(manual=True), str(tmp_path / "run")
    with serving(robot) as uri:
        order = make_order(tmp_path, uri)
        asked = ("--robot", uri, "--problem", order.problem, "--method", "paper", "--out", run)
        page = ("--live", "--live-bind", "127.0.0.1:0")
        with estimator("identify", *asked, "--seed", "1", "--jobs", "1", *page) as identify:
            address = line_with(identify.stderr, "The live page is at").split()[-1]
            assert is_served(address)
            robot.manual = False
            robot.complete()
            line_with(identify.stdout, r"Run: .*")
            assert identify.wait(120) == 0
    assert not is_served(address)
    with estimator("watch", run, "--live-bind", "127.0.0.1:0") as watch:
        address = line_with(watch.stdout, "The live page is at").split()[-1]
        line_with(watch.stdout, "The run is finished")
        assert is_served(address)
        before = largest_memory(watch)
        attack(address)
        assert largest_memory(watch) < before + 30
        assert is_served(address)
        watch.send_signal(signal.SIGINT)
        output, errors = watch.communicate(timeout=120)
    assert (watch.returncode, output, errors) == (0, "", "")
    assert not is_served(address)


def sentence(*arguments: str) -> str:
    ended = CliRunner().invoke(app, list(arguments))
    assert ended.exit_code == 1, ended.output
    assert ended.stderr.startswith("estimator: ")
    assert ended.stderr.count("\n") == 1
    return ended.stderr


def test_where_there_is_no_run_or_a_damaged_one_there_is_no_page(tmp_path: Path) -> None:
    assert "holds no run" in sentence("watch", str(tmp_path))
    (tmp_path / "run.sqlite").write_bytes(b"SQLite format 3\0" + bytes(5000))
    assert "it is damaged" in sentence("watch", str(tmp_path))


@pytest.mark.parametrize("address", ["8080", "here:", "127.0.0.1:70000"])
def test_what_is_no_address_is_refused_before_the_run(tmp_path: Path, address: str) -> None:
    run = tmp_path / "run"
    asked = ("--robot", "tcp://127.0.0.1:1", "--problem", "parametric", "--out", str(run))
    told = sentence("identify", *asked, "--live", "--live-bind", address)
    assert f"'{address}' is no address: write HOST:PORT, such as 127.0.0.1:8080" in told
    assert not run.exists()


def test_an_address_of_another_computer_is_refused(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.2, 0.16))
    store.close()
    told = sentence("watch", str(tmp_path / "run"), "--live-bind", "192.0.2.1:8080")
    assert "cannot be served on 192.0.2.1:8080" in told


@pytest.mark.parametrize("command", ["watch", "identify"])
def test_without_viser_a_sentence_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setattr(live, "find_spec", lambda name: None)
    asked = {
        "watch": (str(tmp_path),),
        "identify": ("--robot", "tcp://127.0.0.1:1", "--problem", "parametric", "--live"),
    }
    assert install_command("live") in sentence(command, *asked[command])
