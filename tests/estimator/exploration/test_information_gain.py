from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator.body.morphology import Array
from estimator.executors import Threads
from estimator.exploration import information_gain
from estimator.exploration.information_gain import InformationGain
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise, drawn
from estimator.posterior.model.sensor_data import DENSITIES, SensorData
from estimator.posterior.model.special import logsumexp
from estimator.readings.observation import Observation, PredictedReadings

MODALITIES = ("touch", "tilt", "clearance")
CAP = 0.2
NOISE = Noise(tilt=0.01, clearance=0.002)


def predictions(
    tilts: Array, *, no_prediction: bool = False, doubtful: bool = False
) -> PredictedReadings:
    """One program, samples that differ by their first tilt and touch alike."""
    readings = PredictedReadings.empty(len(tilts), 2)
    readings.touch_doubtful[:] = doubtful
    readings.tilt[:, 0] = tilts
    readings.clearance[:] = 0.1
    readings.valid[:] = not no_prediction
    return readings


def bits(of: PredictedReadings, groups: list[int]) -> float:
    gain = InformationGain(NOISE, CAP, ("touch", "tilt", "clearance"))
    scales = np.zeros((len(groups), 2))
    rng = np.random.default_rng(1)
    return float(gain.of(of, scales, np.array(groups)[:, None], rng, draws=4000)[0, 0])


def test_two_bodies_that_feel_quite_differently_are_told_apart_but_for_outliers() -> None:
    found = bits(predictions(np.array([0.0, 0.5])), [0, 1])
    assert found == pytest.approx(1 - NOISE.outlier * (1 - NOISE.nearby), abs=0.02)


def test_bodies_that_feel_alike_are_not() -> None:
    assert bits(predictions(np.zeros(4)), [0, 1, 2, 3]) == pytest.approx(0.0, abs=1e-9)


def test_a_difference_within_the_noise_tells_what_shannon_says() -> None:
    apart = 0.01  # one standard deviation
    found = bits(predictions(np.array([0.0, apart])), [0, 1])
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


@pytest.mark.parametrize("modalities", [MODALITIES, ("tilt",), ("touch", "clearance")])
def test_a_gain_is_what_readings_drawn_from_the_likelihood_tell(
    modalities: tuple[str, ...],
) -> None:
    noise = Noise(tilt=0.01, clearance=0.004, touch=0.1, outlier=0.4, nearby=0.8)
    readings, rng = PredictedReadings.empty(4, 2), np.random.default_rng(3)
    readings.valid[:] = True
    readings.undecided[3] = True
    readings.touch[:] = [[False, True], [False, False], [True, True], [True, True]]
    readings.touch_doubtful[2, 0] = True
    readings.tilt[:] = [[0.0, 0.0], [0.015, 0.0], [0.0, 0.07], [0.3, 0.3]]
    readings.clearance[:] = [0.1, CAP, CAP - 0.002, 0.05]
    readings.saturated[1] = True
    scales = np.log([[1.0, 1.5], [2.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    groups = np.arange(4)[:, None]
    found = InformationGain(noise, CAP, modalities).of(
        readings, scales, groups, np.random.default_rng(1), draws=40_000
    )[0, 0]
    count, present = 3000, 0.0  # of each body that foretells anything
    for source in range(3):
        observed = [drawn_from(readings, source, noise, scales[source], rng) for _ in range(count)]
        data = SensorData.of([one for one in observed if one is not None], modalities, CAP)
        interactions = np.tile(np.arange(len(data)), 4)
        misfits = data.misfits(readings[np.repeat(np.arange(4), len(data))], interactions)
        fits = Likelihood(data, noise).of(misfits.reshape(4, len(data), -1), scales=scales)
        present += (fits[source] - logsumexp(fits, axis=0) + math.log(4)).sum() / count
    assert found == pytest.approx(present / 4 / math.log(2), abs=0.03)


def drawn_from(
    readings: PredictedReadings, source: int, noise: Noise, scales: Array, rng: np.random.Generator
) -> Observation | None:
    """What a robot with one of the bodies may feel; ``None``: what any other may, too."""
    wide, chance = np.exp(scales) * [noise.tilt, noise.clearance], rng.random()
    if chance < noise.outlier:
        if chance > noise.outlier * noise.nearby:
            return None
        wide = np.hypot(wide, [DENSITIES["tilt"].beside, DENSITIES["clearance"].beside])
    tilt = readings.tilt[source] + wide[0] * drawn(2, rng)
    height = readings.clearance[source] + wide[1] * drawn(1, rng)[0]
    beyond = bool(readings.saturated[source] or height >= CAP)
    wrong = np.where(readings.touch_doubtful[source], 0.5, noise.touch)
    touch = readings.touch[source] != (rng.random(2) < wrong)
    return Observation(
        angles=(0.0,),
        touch=tuple(touch.tolist()),
        tilt=(float(tilt[0]), float(tilt[1])),
        clearance=CAP if beyond else float(height),
        clearance_saturated=beyond,
    )


def test_only_what_differs_between_groups_counts() -> None:
    tilts = np.array([0.0, 0.5, 0.0, 0.5])
    assert bits(predictions(tilts), [0, 1, 0, 1]) == pytest.approx(0.975, abs=0.02)
    assert bits(predictions(tilts), [0, 0, 1, 1]) == pytest.approx(0.0, abs=0.01)


def test_groupings_are_told_of_at_once_as_by_themselves() -> None:
    of, scales = predictions(np.array([0.0, 0.5, 0.0, 0.5])), np.zeros((4, 2))
    groups = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 2], [1, 1, 3]])
    gain = InformationGain(NOISE, CAP, ("touch", "tilt", "clearance"))

    def told(some: NDArray[np.int64]) -> Array:
        bits: Array = gain.of(of, scales, some, np.random.default_rng(1), draws=100)[0]
        return bits

    assert told(groups).tolist() == [told(groups[:, [one]])[0] for one in range(3)]


def test_readings_are_compared_in_pieces_as_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tilts = np.random.default_rng(2).normal(0, 0.02, (5, 8))
    readings = PredictedReadings.concatenate([predictions(one) for one in tilts])
    groups, gain = np.arange(8)[:, None] // 2, InformationGain(NOISE, CAP, MODALITIES)

    def told(pairs: int) -> Array:
        monkeypatch.setattr(information_gain, "_PAIRS", pairs)
        rng = np.random.default_rng(1)
        return gain.of(readings, np.zeros((8, 2)), groups, rng, draws=50)

    at_once = told(10**6)
    assert at_once.min() > 0.1
    for pairs in (1, 100, 900):  # a reading, some, and the readings of two programs
        assert told(pairs) == pytest.approx(at_once, rel=1e-12)


def test_threads_do_not_show_in_the_result() -> None:
    rng = np.random.default_rng(2)
    programs = [predictions(tilts) for tilts in rng.normal(0, 0.02, (5, 8))]
    with Threads(3) as threads:
        one, three = (
            InformationGain(NOISE, CAP, ("touch", "tilt"), some).of(
                PredictedReadings.concatenate(programs),
                np.zeros((8, 2)),
                np.arange(8)[:, None],
                np.random.default_rng(1),
                draws=50,
            )
            for some in (None, threads)
        )
    assert np.array_equal(one, three)
    assert one.min() > 0


def test_poses_that_cannot_be_predicted_tell_nothing() -> None:
    assert bits(predictions(np.array([0.0, 0.5]), no_prediction=True), [0, 1]) == 0.0


def test_a_sense_that_does_not_count_tells_nothing() -> None:
    gain = InformationGain(NOISE, CAP, ("touch", "clearance"))
    found = gain.of(
        predictions(np.array([0.0, 0.5])),
        np.zeros((2, 2)),
        np.array([[0], [1]]),
        np.random.default_rng(1),
        draws=500,
    )
    assert found[0, 0] == pytest.approx(0.0, abs=1e-9)
