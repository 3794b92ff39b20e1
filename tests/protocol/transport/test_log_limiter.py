"""Repeated events: the first is told, the others are counted."""

from __future__ import annotations

from protocol.transport.log_limiter import LogLimiter


def test_one_in_a_period_is_let_through_with_the_number_kept_back() -> None:
    limiter = LogLimiter(period=60)
    assert limiter.count("held", 0) == 0
    assert [limiter.count("held", second) for second in (1, 2, 59.9)] == [None] * 3
    assert limiter.count("busy", 2) == 0  # another kind
    assert limiter.count("held", 60) == 3
    assert limiter.count("held", 119) is None
    assert limiter.count("held", 500) == 1
