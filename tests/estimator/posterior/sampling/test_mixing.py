"""Samples of one set of attachments, all that a search has met, go on to all that there are."""

from __future__ import annotations

from collections import Counter

import numpy as np

from estimator.executors import ThisProcess
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.sampling.mixing import mixed
from estimator.posterior.sampling.weighing import WeighedModes
from tests.estimator.posterior.sampling.enumeration import distance, enumerated
from tests.estimator.posterior.sampling.test_sampler import WIDE
from tests.estimator.two_unknown_rows import NOISE, POINT, draw, programs

_SAMPLES = 1024


def gone_on(predictor: Predictor, likelihood: Likelihood, steps: int) -> WeighedModes:
    """From samples of the first point's attachments, as if nothing else had been found."""
    values = np.repeat(POINT[None], _SAMPLES, axis=0)
    met = WeighedModes(
        points=values[:1],
        shares=np.ones(1),
        ess=np.full(1, 100.0),
        values=values,
        rare=values[:0],
        rare_shares=np.empty(0),
        causes=(),
        as_stated=None,
        draws=[values],
    )
    before = predictor.cost.simulations
    modes, scales = mixed(
        met,
        np.zeros((_SAMPLES, 2)),
        predictor,
        likelihood,
        np.random.default_rng(1),
        workers=ThisProcess(),
        steps=steps,
    )
    assert modes.values.shape == values.shape
    assert scales.shape == (_SAMPLES, 2)
    assert predictor.cost.simulations > before
    return modes


def test_what_no_search_has_met_is_named_as_often_as_it_deserves(narrow: Predictor) -> None:
    unknowns = narrow.unknowns
    data = draw(narrow, POINT, programs(2, seed=3), np.random.default_rng(6))
    exact = enumerated(narrow, data, WIDE, (4, 6, 2, 4, 6))
    first = {unknowns.keys(POINT[None])[0]: 1.0}
    assert distance(first, exact) > 0.5
    modes = gone_on(narrow, Likelihood(data, WIDE), 800)
    keys = unknowns.keys(modes.points)
    sampled = Counter(unknowns.keys(modes.values))
    assert set(sampled) <= set(keys)
    assert len(set(keys)) == len(keys) == len(modes.draws)
    assert distance({key: count / _SAMPLES for key, count in sampled.items()}, exact) < 0.15
    shares = dict(zip(keys, modes.shares.tolist(), strict=True))
    assert abs(sum(shares.values()) - 1) < 1e-9
    met_first = keys[0]
    assert abs(shares[met_first] - exact[met_first]) < 0.05


def test_no_unmet_set_leads_by_the_chance_of_its_chains(narrow: Predictor) -> None:
    unknowns = narrow.unknowns
    data = draw(narrow, POINT, programs(1, seed=3), np.random.default_rng(6))
    modes = gone_on(narrow, Likelihood(data, WIDE), 100)
    others = np.sort(modes.shares[1:])
    assert len(others) > 50
    counts = Counter(unknowns.keys(modes.values))
    del counts[unknowns.keys(POINT[None])[0]]
    assert others[0] > 0
    assert others[-1] < 0.9 * max(counts.values()) / _SAMPLES
    assert others[-1] > 2 * others[0]  # a set that many chains are in has more for it than chance


def test_where_chains_stay_nothing_changes(narrow: Predictor) -> None:
    unknowns = narrow.unknowns
    data = draw(narrow, POINT, programs(8), np.random.default_rng(2))
    modes = gone_on(narrow, Likelihood(data, NOISE), 40)
    assert unknowns.keys(modes.points) == unknowns.keys(POINT[None])
    assert modes.shares.tolist() == [1.0]
