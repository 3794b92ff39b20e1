from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.exploration.information_gain import Forecast, InformationGain
from estimator.parallel.executors import Threads
from estimator.posterior.model.likelihood import Noise

CAP = 0.2
NOISE = Noise(tilt=0.01, clearance=0.002)


def forecast(tilts: Array, *, silent: bool = False, doubtful: bool = False) -> Forecast:
    """One program, samples that differ by their first tilt and touch alike."""
    count = len(tilts)
    tilt = np.zeros((1, count, 2))
    tilt[0, :, 0] = tilts
    return Forecast(
        touch=np.zeros((1, count, 2), dtype=bool),
        doubtful=np.full((1, count, 2), doubtful),
        tilt=tilt,
        clearance=np.full((1, count), 0.1),
        beyond=np.zeros((1, count), dtype=bool),
        silent=np.full((1, count), silent),
    )


def bits(of: Forecast, groups: list[int]) -> float:
    gain = InformationGain(NOISE, CAP, ("touch", "tilt", "clearance"))
    scales = np.zeros((len(groups), 2))
    rng = np.random.default_rng(1)
    return float(gain.of(of, scales, np.array(groups), rng, draws=4000)[0])


def test_two_bodies_that_feel_quite_differently_are_told_apart_but_for_outliers() -> None:
    found = bits(forecast(np.array([0.0, 0.5])), [0, 1])
    assert found == pytest.approx(1 - NOISE.outlier, abs=0.02)


def test_bodies_that_feel_alike_are_not() -> None:
    assert bits(forecast(np.zeros(4)), [0, 1, 2, 3]) == pytest.approx(0.0, abs=1e-9)


def test_a_difference_within_the_noise_tells_what_shannon_says() -> None:
    apart = 0.01  # one standard deviation
    found = bits(forecast(np.array([0.0, apart])), [0, 1])
    x = np.linspace(-0.08, 0.09, 20_001)
    one = np.exp(-0.5 * (x / 0.01) ** 2)
    two = np.exp(-0.5 * ((x - apart) / 0.01) ** 2)
    mean = 0.5 * (one + two)
    exact = (
        0.5
        * np.trapezoid(one * np.log2(one / mean) + two * np.log2(two / mean), x)
        / (0.01 * math.sqrt(2 * math.pi))
    )
    assert found == pytest.approx((1 - NOISE.outlier) * exact, abs=0.03)


def test_only_what_differs_between_groups_counts() -> None:
    tilts = np.array([0.0, 0.5, 0.0, 0.5])
    assert bits(forecast(tilts), [0, 1, 0, 1]) == pytest.approx(0.95, abs=0.02)
    assert bits(forecast(tilts), [0, 0, 1, 1]) == pytest.approx(0.0, abs=0.01)


def test_threads_do_not_show_in_the_result() -> None:
    rng = np.random.default_rng(2)
    programs = [forecast(tilts) for tilts in rng.normal(0, 0.02, (5, 8))]
    names = [item.name for item in fields(Forecast)]
    joined = {name: np.concatenate([getattr(one, name) for one in programs]) for name in names}
    with Threads(3) as threads:
        one, three = (
            InformationGain(NOISE, CAP, ("touch", "tilt"), some).of(
                Forecast(**joined),
                np.zeros((8, 2)),
                np.arange(8),
                np.random.default_rng(1),
                draws=50,
            )
            for some in (None, threads)
        )
    assert np.array_equal(one, three)
    assert one.min() > 0


def test_poses_that_cannot_be_foretold_tell_nothing() -> None:
    assert bits(forecast(np.array([0.0, 0.5]), silent=True), [0, 1]) == 0.0


def test_a_sense_that_does_not_count_tells_nothing() -> None:
    gain = InformationGain(NOISE, CAP, ("touch", "clearance"))
    found = gain.of(
        forecast(np.array([0.0, 0.5])),
        np.zeros((2, 2)),
        np.array([0, 1]),
        np.random.default_rng(1),
        draws=500,
    )
    assert found[0] == pytest.approx(0.0, abs=1e-9)
