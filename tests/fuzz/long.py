"""``make fuzz``: a million frames by property, a million by coverage, and many through a socket.

    python -m tests.fuzz.long [--frames N] [--skip-coverage]

Prints one line of figures for each; ends with 1 at the first thing that must not be.
"""

from __future__ import annotations

import argparse
import gc
import logging
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil
import zmq
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from bench.still_robot import still_robot
from protocol.transport.client import RobotClient
from protocol.transport.server import Server
from tests.fuzz.reference import verdict
from tests.fuzz.steps import play
from tests.fuzz.subject import Subject
from tests.robot.stepped import SteppedClock

MEGABYTE = 1e6
ROUND = 500  # plays between two looks at the memory
PLAY = 80  # frames of a coverage-guided play, about
SEEDS = 40  # plays to begin with
KEPT = 20_000  # frames to be sent through a socket again and again
PLAYS = st.binary(min_size=400, max_size=2000)
PROGRAM = Path(__file__).with_name("coverage_guided.py")


def by_property(frames: int) -> list[bytes]:
    """Feeds so many frames of drawn plays; returns some of the invalid ones."""
    fed = invalid = rounds = 0
    kept: list[bytes] = []
    memory: list[float] = []

    class Recorded(Subject):
        """Keeps the invalid frames that it is fed."""

        def feed(self, frame: bytes, peer: bytes = b"peer") -> list[dict[str, Any]]:
            if len(kept) < KEPT and verdict(frame) is not None:
                kept.append(frame)
            return super().feed(frame, peer)

    begun = time.monotonic()
    while fed < frames:
        rounds += 1

        @seed(rounds)
        @settings(
            max_examples=ROUND,
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
        )
        @given(PLAYS)
        def whatever_comes(data: bytes) -> None:
            nonlocal fed, invalid
            subject = Recorded()
            play(subject, data)
            fed += subject.frames
            invalid += subject.invalid

        whatever_comes()
        gc.collect()
        memory.append(psutil.Process().memory_info().rss / MEGABYTE)
    seconds = time.monotonic() - begun
    half = memory[len(memory) // 2]
    print(
        f"by property: {fed:,} frames ({invalid:,} invalid) in {seconds:.0f} s; resident memory "
        f"{memory[0]:.1f} MB after the first round, {half:.1f} MB half-way, {memory[-1]:.1f} MB "
        "at the end",
        flush=True,
    )
    return kept


def by_coverage(frames: int) -> None:
    """Lets libFuzzer find so many frames, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report"
        corpus = Path(folder) / "corpus"
        corpus.mkdir()
        rng = random.Random(0)
        for number in range(SEEDS):
            (corpus / f"seed-{number}").write_bytes(rng.randbytes(600))
        fed = plays = rounds = 0
        begun = time.monotonic()
        peaks: list[str] = []
        counts = {"plays": 0, "frames": 0, "invalid": 0}
        while fed < frames:
            rounds += 1
            done = subprocess.run(
                [
                    *(sys.executable, str(PROGRAM), str(corpus)),
                    *(f"-runs={max((frames - fed) // PLAY, 4000)}", f"-seed={rounds}"),
                    *("-max_len=1500", "-len_control=0", "-print_final_stats=1"),
                    f"-artifact_prefix={folder}/",
                ],
                env=os.environ | {"FUZZ_REPORT": str(report), "PYTHONPATH": "."},
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode:
                print(done.stderr[-6000:], file=sys.stderr)
                raise SystemExit(1)
            for part in report.read_text().split():
                name, count = part.split("=")
                counts[name] += int(count)
            fed, plays = counts["frames"], counts["plays"]
            peaks += [
                line.split()[-1]
                for line in done.stderr.splitlines()
                if line.startswith("stat::peak_rss_mb")
            ]
        inputs = len(list(corpus.iterdir()))
        print(
            f"by coverage: {fed:,} frames ({counts['invalid']:,} invalid) in {plays:,} plays and "
            f"{time.monotonic() - begun:.0f} s; {inputs:,} inputs that reach something new; "
            f"peak memory of each process {', '.join(peaks)} MB",
            flush=True,
        )


def through_a_socket(kept: Sequence[bytes], frames: int) -> None:
    """Sends invalid frames to a whole daemon; it must stay as it is, and small."""
    process = psutil.Process()
    log = logging.getLogger("fuzz")
    log.setLevel(logging.ERROR)
    with still_robot(SteppedClock(), housekeeping=None, log=log) as robot:
        server = Server(robot.controller, bind="tcp://127.0.0.1:*", log=log)
        thread = threading.Thread(target=server.run)
        thread.start()
        robot.controller.start()
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        begun = time.monotonic()
        memory, files = [], []
        try:
            with RobotClient(server.endpoint) as client:
                client.acquire()
                before = client.status()
                for batch in range(max(1, frames // len(kept))):
                    with context.socket(zmq.DEALER) as dealer:
                        dealer.setsockopt(zmq.LINGER, 0)
                        dealer.connect(server.endpoint)
                        for number, frame in enumerate(kept):
                            dealer.send(frame)
                            if number >= 100:  # so many may be on their way
                                dealer.recv()
                        for _ in range(min(100, len(kept))):
                            dealer.recv()
                    assert server.garbage == (batch + 1) * len(kept)
                    gc.collect()
                    memory.append(process.memory_info().rss / MEGABYTE)
                    files.append(process.num_fds())
                after = client.status()
                assert (after.state, after.sequence) == (before.state, before.sequence)
                assert after.controller == client.client_id
                client.perform({joint.name: 0.1 for joint in client.capabilities.joints})
        finally:
            context.destroy(linger=0)
            robot.controller.shut_down()
            server.close()
            thread.join()
    print(
        f"through a socket: {server.garbage:,} invalid frames in {time.monotonic() - begun:.0f} s, "
        f"each answered; state unchanged; resident memory {memory[0]:.1f} MB after the first "
        f"{len(kept):,}, {memory[-1]:.1f} MB at the end; {files[0]} and {files[-1]} descriptors",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Fuzzes codec, server core and server for long.")
    parser.add_argument("--frames", type=int, default=1_000_000, help="of each kind")
    parser.add_argument("--skip-coverage", action="store_true", help="without Atheris")
    options = parser.parse_args()
    kept = by_property(options.frames)
    if not options.skip_coverage:
        by_coverage(options.frames)
    through_a_socket(kept, options.frames // 5)


if __name__ == "__main__":
    main()
