"""The live page of a run, in a process of its own: ``estimator watch``, at a low priority.

So it cannot hold the run up, and whatever becomes of it, the run goes on.
"""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import typer
from rich.console import Console

from estimator.cli.console import errors_as_sentences, out
from estimator.cli.options import Directory, LiveBind
from estimator.cli.screen import Screen
from estimator.errors import EstimatorError
from estimator.executors import die_with
from protocol.system.missing_library import install_command
from protocol.system.process import Closable

LIVE_BIND: Final = "127.0.0.1:8080"
_NICENESS: Final = 10


def parse_bind(bind: str) -> tuple[str, int]:
    """Host and port of ``HOST:PORT``.

    Raises:
        EstimatorError: ``bind`` is not of that form.
    """
    host, _, port = bind.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise EstimatorError(f"{bind!r} is no address: write HOST:PORT, such as {LIVE_BIND}")
    return host, int(port)


def check_viser() -> None:
    """Checks that viser, which serves the page, is installed.

    Raises:
        EstimatorError: viser is not installed.
    """
    if find_spec("viser") is None:
        raise EstimatorError(
            f"the live page needs viser, which is not installed: {install_command('live')}"
        )


class LiveView(Closable):
    """The live page of a run that this process works on; a context manager, which ends it.

    Args:
        directory: The run directory.
        bind: ``HOST:PORT`` where the page is served; ``None``: there is to be no page.

    Raises:
        EstimatorError: ``bind`` is no address, or viser is missing.
    """

    def __init__(self, directory: Path, bind: str | None) -> None:
        self._command: list[str] | None = None
        self._process: subprocess.Popen[str] | None = None
        if bind is not None:
            parse_bind(bind)
            check_viser()
            program = (sys.executable, "-m", "estimator", "watch")
            self._command = [*program, str(directory), "--live-bind", bind]

    def close(self) -> None:
        """Ends the page."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._reader.join()

    def start(self, say: Callable[[str], None]) -> None:
        """Starts the page of a run that exists by now.

        Args:
            say: Called with each line that the page's process prints.
        """
        if self._command is None:
            return
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            process_group=0,  # Ctrl-C does not reach it; ``close`` ends it
            preexec_fn=partial(_give_way, os.getpid()),  # noqa: PLW1509 - system calls
        )
        self._reader = threading.Thread(target=_repeat, args=(self._process, say), daemon=True)
        self._reader.start()

    def stay(self, console: Console) -> None:
        """Leaves the page open until Ctrl-C, where a person sits in front of the terminal."""
        if self._process is None or not sys.stdin.isatty():
            return
        console.print("The live page stays open until Ctrl-C.")
        try:
            self._process.wait()
        except KeyboardInterrupt:
            return


class LiveScreen(Screen):
    """A screen that also opens the live page, as soon as there is a run."""

    def __init__(self, console: Console, live_view: LiveView) -> None:
        super().__init__(console)
        self._live_view = live_view

    def expect(self, work: float, done: float) -> None:
        """Sets the length of the bar, and opens the page."""
        super().expect(work, done)
        self._live_view.start(self.say)


def _repeat(process: subprocess.Popen[str], say: Callable[[str], None]) -> None:
    assert process.stdout is not None
    with process.stdout:
        for line in process.stdout:
            say(line.rstrip("\n"))


def _give_way(parent: int) -> None:
    die_with(parent, signal.SIGTERM)
    os.nice(_NICENESS)


def watch(directory: Directory, bind: LiveBind = LIVE_BIND) -> None:
    """Show a run on a page in the browser, also while another process works on it."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with errors_as_sentences(None):
        host, port = parse_bind(bind)
        check_viser()
        page = importlib.import_module("estimator.report.live.live_page")
        try:
            page.watch(directory, host, port, _print_line)
        except KeyboardInterrupt:
            raise typer.Exit from None


def _print_line(sentence: str) -> None:
    out.print(sentence, highlight=False, soft_wrap=True)
    out.file.flush()
