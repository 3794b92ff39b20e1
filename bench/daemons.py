"""Starts daemons as processes, to be measured from outside."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import psutil


@dataclass
class Daemon:
    """A running daemon.

    Attributes:
        process: The process.
        uri: Where it takes requests.
        control: Where faults can be injected, if it offers that.
        log: The last lines that it logged.
    """

    process: psutil.Process
    uri: str = ""
    control: str = ""
    log: deque[str] = field(default_factory=lambda: deque(maxlen=200))


@contextmanager
def daemon(module: str, *options: str) -> Iterator[Daemon]:
    """Runs a module that logs where it serves; it is terminated afterwards."""
    process = subprocess.Popen(
        [sys.executable, "-m", module, "--bind", "tcp://127.0.0.1:*", *options],
        stderr=subprocess.PIPE,
        text=True,
    )
    started = Daemon(psutil.Process(process.pid))
    ready = threading.Event()

    def listen() -> None:
        assert process.stderr is not None
        for line in process.stderr:
            started.log.append(line)
            if match := re.search(r"injected at (\S+)", line):
                started.control = match[1]
            if match := re.search(r"serving .*? on (tcp://[^\s,]+)", line):
                started.uri = match[1]
                ready.set()
        ready.set()

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    try:
        ready.wait(60)
        if not started.uri:
            raise RuntimeError(f"{module} did not start:\n{''.join(started.log)}")
        yield started
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
        process.wait()
        listener.join(10)
        if process.stderr is not None:
            process.stderr.close()
