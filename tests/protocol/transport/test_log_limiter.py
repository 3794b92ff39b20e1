"""Repeated events: the first is told, the others are counted."""

from __future__ import annotations

from protocol.transport.log_limiter import Tally


def test_one_in_a_period_is_let_through_with_the_number_kept_back() -> None:
    tally = Tally(period=60)
    assert tally.count("held", 0) == 0
    assert [tally.count("held", second) for second in (1, 2, 59.9)] == [None] * 3
    assert tally.count("busy", 2) == 0  # another kind
    assert tally.count("held", 60) == 3
    assert tally.count("held", 119) is None
    assert tally.count("held", 500) == 1
