from __future__ import annotations

import numpy as np
import pytest

from estimator.posterior.posterior import met_by_each, share_met


def test_what_two_populations_met_tells_how_much_was_missed() -> None:
    keys, shares = [(0,), (1,), (2,)], np.array([0.5, 0.3, 0.2])
    assert share_met(shares, met_by_each(keys, [{(0,), (1,)}, {(0,), (1,)}])) == 1.0
    assert share_met(shares, met_by_each(keys, [{(0,)}, {(1,)}])) == 0.0
    partly = share_met(shares, met_by_each(keys, [{(0,), (1,)}, {(0,), (2,)}]))
    assert partly == pytest.approx(1 - (1 - 0.5 / 0.7) * (1 - 0.5 / 0.8))
