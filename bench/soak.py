"""Hours of random commands, faults and clients against a real ``sim-robotd``, in virtual time.

``python -m bench.soak --hours 24`` fails unless every request had one true outcome and memory,
descriptors and latency stayed flat. The seed decides what is tried; threads decide what meets what.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from statistics import median

from bench.daemons import Sample, simulator
from bench.soak_crowd import Crowd, InvariantBroken
from sim_robot.simulator.electronics_sets import DEFAULT_SET, SETS

DEATHS = 3  # controllers that are lost


def growth(samples: Sequence[Sample], of: Callable[[Sample], float]) -> float:
    """How much the median of the last third lies above that of the second third."""
    third = len(samples) // 3
    return median(map(of, samples[2 * third :])) - median(map(of, samples[third : 2 * third]))


@contextmanager
def soak(seed: int, electronics: str = DEFAULT_SET) -> Iterator[Crowd]:
    """Starts a robot and yields a crowd for it."""
    options = ("--seed", str(seed), "--electronics", electronics)
    with simulator(*options, "--control", "tcp://127.0.0.1:*") as robot:
        yield Crowd(robot, seed, electronics)


def main() -> int:
    """Runs the soak and prints measurements; returns the exit status, 1 if a check failed."""
    parser = argparse.ArgumentParser(prog="python -m bench.soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="virtual hours (default 24)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--electronics", choices=SETS, default=DEFAULT_SET)
    options = parser.parse_args()
    print("| virtual h | memory MB | descriptors | threads | latency p50 ms | p99 ms |")
    print("| --- | --- | --- | --- | --- | --- |", flush=True)

    def tell(sample: Sample) -> None:
        print(
            f"| {sample.hours:.1f} | {sample.memory:.1f} | {sample.descriptors} "
            f"| {sample.threads} | {sample.latency:.2f} | {sample.worst:.2f} |",
            flush=True,
        )

    start = time.monotonic()
    with soak(options.seed, options.electronics) as trial:
        try:
            trial.run(options.hours, every=options.hours / 24, deaths=DEATHS, tell=tell)
        except InvariantBroken as error:
            print(f"broken: {error}", file=sys.stderr)
            return 1
    counted = ", ".join(f"{number} {name}" for name, number in sorted(trial.counts.items()))
    memory = growth(trial.samples, lambda sample: sample.memory)
    descriptors = growth(trial.samples, lambda sample: sample.descriptors)
    latency = growth(trial.samples, lambda sample: sample.latency)
    print(f"\n{counted}; {time.monotonic() - start:.0f} s of real time\n")
    print(
        f"Last third against second: memory {memory:+.2f} MB, descriptors {descriptors:+.0f}, "
        f"median latency {latency:+.2f} ms"
    )
    flat = memory < 2 and descriptors <= 2 and latency < 1
    print("flat" if flat else "NOT FLAT")
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
