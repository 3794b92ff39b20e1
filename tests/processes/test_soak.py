"""Two virtual minutes of the soak: random commands, faults and clients, and every check of it.

On the PC-104's electronics; ``make soak SOAK='--electronics pi'`` has the others.
"""

from __future__ import annotations

from bench.daemons import Sample
from bench.soak import growth, soak


def sample(memory: float) -> Sample:
    return Sample(hours=0, memory=memory, descriptors=1, threads=1, latency=1, worst=1)


def test_nothing_is_lost_and_nothing_repeated() -> None:
    with soak(1, "pc104") as crowd:
        crowd.run(0.03, every=0.01, deaths=0, tell=lambda sample: None)
    assert crowd.counts["observations"] > 15
    assert crowd.counts["faults noticed"] > 0
    assert len({sample.descriptors for sample in crowd.samples[1:]}) == 1
    assert max(sample.hours for sample in crowd.samples) >= 0.03


def test_a_leak_would_show() -> None:
    still = [sample(100 + 3 * (number % 2)) for number in range(24)]
    leaking = [sample(100 + number / 2) for number in range(24)]
    assert growth(still, lambda one: one.memory) == 0
    assert growth(leaking, lambda one: one.memory) == 4
