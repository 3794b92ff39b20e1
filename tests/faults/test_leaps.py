"""A few of the motions of ``tests.faults.leaps``; ``make leaps`` makes a thousand faults."""

from __future__ import annotations

import pytest

from tests.faults.leaps import ON_I2C, ON_SERVOS, SOUND, Tally, study


@pytest.mark.parametrize(
    ("kinds", "boards", "family", "faults", "seed"),
    [
        (SOUND, (1,), "", 25, 1),
        (SOUND, (1, 2), "", 25, 1),
        (ON_I2C, (), "", 25, 1),
        (ON_SERVOS, (), "feetech", 9, 3),
        (ON_SERVOS, (), "dynamixel", 9, 3),
    ],
    ids=["sv203", "two sv203", "pca9685", "feetech", "dynamixel"],
)
def test_no_leap_is_commanded_whatever_fails_while_it_moves(
    kinds: tuple[str, ...], boards: tuple[int, ...], family: str, faults: int, seed: int
) -> None:
    tally = Tally()
    with study(seed, kinds, boards=boards, family=family) as robot:
        while tally.faults.total() < faults:
            robot.motion(tally, kinds)
    assert 0.3 < tally.longest <= 1.0
    assert tally.sound
    assert len(tally.ends) > 1
