"""A ``sim-robotd`` process for one run, started by its command as a person would start it.

Its noise comes from its seed and the number of the interaction, so a robot that was started anew
reads what its predecessor read, once it has performed what its predecessor had performed.
"""

from __future__ import annotations

import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

from estimator.errors import EstimatorError, InteractionError, RunDirectoryError
from estimator.executors import die_with
from estimator.readings.observation import Observation, by_joint_name
from estimator.storage.store import RunStore
from protocol.system.missing_library import install_command
from protocol.system.process import Closable
from protocol.transport.client import RobotClient

COMMAND: Final = "sim-robotd"
_START_LIMIT: Final = 60.0  # s; not tuned
_PARK_LIMIT: Final = 10.0  # s; it parks within 5
_LAST_LINES: Final = 20
_SERVING_LINE: Final = re.compile(r"serving \S+ on (tcp://[^\s,]+)")


class RobotProcess(Closable):
    """A running ``sim-robotd``; use it as a context manager.

    It ends when this process does, however that ends, and Ctrl-C in a terminal does not reach it.

    Args:
        seed: Seed of the sensors' noise.
        options: Further options of the command.

    Attributes:
        uri: Address at which the robot takes requests.

    Raises:
        EstimatorError: ``sim-robotd`` is not installed.
        InteractionError: The robot did not start.
    """

    def __init__(self, seed: int, options: Sequence[str] = ()):
        self._process = subprocess.Popen(
            [_command(), "--bind", "tcp://127.0.0.1:*", "--seed", str(seed), *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=partial(die_with, os.getpid(), signal.SIGTERM),  # noqa: PLW1509 - system calls
        )
        self.uri = ""
        self._last_lines: deque[str] = deque(maxlen=_LAST_LINES)
        self._ready = threading.Event()
        self._reader = threading.Thread(target=self._read, name=COMMAND, daemon=True)
        self._reader.start()
        try:
            heard = self._ready.wait(_START_LIMIT)
            if not self.uri:
                reason = "".join(self._last_lines).strip() or "it said nothing"
                outcome = "ended at once" if heard else f"was not ready after {_START_LIMIT:.0f} s"
                raise InteractionError(f"{COMMAND} {outcome}: {reason}")
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Lets the robot park, and ends it."""
        self._process.terminate()
        try:
            self._process.wait(_PARK_LIMIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()

    def _read(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as lines:
            for line in lines:
                self._last_lines.append(line)
                address = _SERVING_LINE.search(line)
                if address is not None:
                    self.uri = address[1]
                    self._ready.set()
        self._ready.set()


def print_body() -> str:
    """The URDF of the body that ``sim-robotd`` has: the truth, for the scorer alone.

    Raises:
        EstimatorError: ``sim-robotd`` is not installed, or failed.
    """
    completed = subprocess.run(
        [_command(), "--print-body"],
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    if completed.returncode != 0:
        raise EstimatorError(f"{COMMAND} --print-body failed: {completed.stderr.strip()}")
    return completed.stdout


def catch_up(store: RunStore, uri: str) -> None:
    """Has a new robot perform what a run's robot had performed before, so that it stands there too.

    Args:
        store: The run.
        uri: A robot that was started with the same seed and has not moved yet.

    Raises:
        RunDirectoryError: The new robot's readings are not those of the run.
        BodyschemaError: The robot cannot be reached, or did not perform.
    """
    validations = itertools.chain.from_iterable(store.validations.all())
    performed = [
        (item.program, item.observation)
        for item in (*store.interactions(), *validations)
        if item.observation is not None
    ]
    if not performed:
        return
    with RobotClient(uri, software="estimator") as client:
        client.acquire()
        for program, recorded in performed:
            reply = client.perform(by_joint_name(program, client.capabilities))
            repeated = Observation.from_wire(reply, client.capabilities)
            if _readings(repeated) != _readings(recorded):
                raise RunDirectoryError(
                    f"The simulated robot does not read again what it read in {store.directory}, "
                    f"so it was another version's: delete {store.directory}, and it is run anew."
                )


def _readings(observation: Observation) -> tuple[object, ...]:
    return observation.angles, observation.touch, observation.tilt, observation.clearance


def _command() -> str:
    """The ``sim-robotd`` of this installation, or else the one on the PATH."""
    installed = Path(sys.executable).with_name(COMMAND)
    path = str(installed) if installed.is_file() else shutil.which(COMMAND)
    if path is None:
        raise EstimatorError(f"{COMMAND} is not installed: {install_command('sim')}")
    return path
