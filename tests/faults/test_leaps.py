"""A few of the motions of ``tests.faults.leaps``; ``make leaps`` makes a thousand faults."""

from __future__ import annotations

import pytest

from tests.faults.leaps import ON_I2C, SOUND, Tally, study


@pytest.mark.parametrize(
    ("kinds", "boards"),
    [(SOUND, (1,)), (SOUND, (1, 2)), (ON_I2C, ())],
    ids=["sv203", "two sv203", "pca9685"],
)
def test_no_leap_is_commanded_whatever_fails_while_it_moves(
    kinds: tuple[str, ...], boards: tuple[int, ...]
) -> None:
    tally = Tally()
    with study(1, kinds, boards=boards) as robot:
        while tally.faults.total() < 25:
            robot.motion(tally, kinds)
    assert 0.3 < tally.longest <= 1.0
    assert tally.sound
    assert len(tally.ends) > 1
