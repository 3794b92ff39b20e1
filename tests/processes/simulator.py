"""Starts ``sim-robotd`` as a process, as a user would."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


class Simulator:
    """A running ``sim-robotd``.

    Attributes:
        uri: Where it takes requests.
        log: What it wrote to standard error so far.
    """

    def __init__(self, *options: str, bind: str = "tcp://127.0.0.1:*"):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sim_robot.cli", "--bind", bind, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.log: list[str] = []
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self.log.append(line)
            if found := re.search(r"serving .* on (tcp://\S+)", line):
                self.uri = found[1]
                return
        raise AssertionError("sim-robotd did not start: " + "".join(self.log))

    def kill(self) -> None:
        """SIGKILL, as a power cut."""
        self._process.kill()
        self._process.communicate()

    def terminate(self, timeout: float = 10) -> tuple[int, str]:
        """SIGTERM, as a service manager; returns exit code and standard output."""
        self._process.terminate()
        output, log = self._process.communicate(timeout=timeout)
        self.log += log.splitlines()
        return self._process.returncode, output


@contextmanager
def simulator(*options: str, bind: str = "tcp://127.0.0.1:*") -> Iterator[Simulator]:
    """A ``sim-robotd`` that is gone afterwards."""
    found = Simulator(*options, bind=bind)
    try:
        yield found
    finally:
        found.kill()
