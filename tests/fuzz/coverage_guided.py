"""Coverage-guided fuzzing of codec and server core: ``python tests/fuzz/coverage_guided.py``.

libFuzzer, by way of Atheris, keeps the inputs that reach new branches of our code and of the
reference decoder, and grows new ones out of them. An input is a play for the subject that watches
itself.

Arguments are libFuzzer's: ``-runs=N``, ``-seed=N``, a corpus folder. The number of frames is
written to the file that ``FUZZ_REPORT`` names.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["protocol", "tests.fuzz"]):
    from tests.fuzz.steps import play
    from tests.fuzz.subject import Subject

_EVERY = 1000  # plays between two reports

_counts = {"plays": 0, "frames": 0, "invalid": 0}


def one_play(data: bytes) -> None:
    """Feeds one input."""
    subject = Subject()
    play(subject, data)
    _counts["plays"] += 1
    _counts["frames"] += subject.frames
    _counts["invalid"] += subject.invalid
    if _counts["plays"] % _EVERY == 0:
        _report()


def _report() -> None:
    if place := os.environ.get("FUZZ_REPORT"):
        Path(place).write_text(" ".join(f"{name}={count}" for name, count in _counts.items()))


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_play)
    atheris.Fuzz()
