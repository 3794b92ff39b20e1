"""Others look for what ours looks for, in readings that are recorded first."""

from __future__ import annotations

from pathlib import Path

from bench.peers.comparison import AS_STATED, REFIT, UNIT, WHOLE, Answer, Target, rows_of, table
from bench.power.trial import Trial


def test_a_peer_is_held_against_ours_on_the_same_readings(tmp_path: Path) -> None:
    sizes: list[int] = []

    def middle(target: Target, seed: int) -> Answer:
        del seed
        sizes.append(target.unknowns.size)
        target(target.best[None])
        return Answer(point=target.best, stated=None, finished=False)

    trial = Trial(name="short", seeds=(0,), problem="parametric", interactions=1)
    rows = rows_of(trial, 0, tmp_path, {UNIT: middle}, 60.0)
    assert [row.who for row in rows] == [REFIT, AS_STATED, WHOLE, UNIT]
    assert sizes == [8]  # lengths alone: nothing that may be otherwise than stated
    ours, as_stated, _, other = rows
    assert ours.nats == 0.0
    assert abs(as_stated.nats) < 0.5
    assert 0 < as_stated.million < ours.million  # no deviations are weighed
    assert other.nats < 0.5  # polished, a guess may come as far as ours, but not further
    assert 0 < other.million * 1e6 < ours.million * 1e6
    lines = table(rows).splitlines()
    assert [line.split("|")[1].strip() for line in lines[2:]] == [REFIT, AS_STATED, WHOLE, UNIT]
