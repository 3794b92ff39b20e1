"""A few of the motions of ``tests.faults.leaps``; ``make leaps`` makes a thousand faults."""

from __future__ import annotations

from tests.faults.leaps import SOUND, Tally, study


def test_no_leap_is_commanded_whatever_fails_while_it_moves() -> None:
    tally = Tally()
    with study(seed=1) as robot:
        while tally.faults.total() < 25:
            robot.motion(tally, SOUND)
    assert 0.5 < tally.longest <= 1.0
    assert tally.unnoticed == 0
    assert len(tally.ends) > 1
