import math

import numpy as np
import pytest
from scipy.special import log_ndtr

from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.sensor_data import MISFITS, NO_PREDICTION, STANCE, SensorData
from estimator.readings.observation import Observation, PredictedReadings

CAP = 0.2
NOISE = Noise(tilt=0.01, clearance=0.004)


def one_reading(clearance: float = 0.1, *, saturated: bool = False) -> PredictedReadings:
    readings = PredictedReadings.empty(1, 2)
    readings.valid[:] = True
    readings.touch[0] = True, False
    readings.tilt[0] = 0.2, -0.1
    readings.clearance[0] = CAP if saturated else clearance
    readings.saturated[0] = saturated
    return readings


def densities(
    observations: list[Observation], readings: PredictedReadings, noise_scale: float = 1.0
) -> Array:
    data = SensorData.of(observations, ("touch", "tilt", "clearance"), CAP)
    interactions = np.arange(len(observations))
    misfits = data.misfits(readings[np.zeros(len(interactions), dtype=np.intp)], interactions)[None]
    fits = Likelihood(data, NOISE).of(misfits, noise_scale)
    values: Array = np.exp(fits[0])
    return values


@pytest.mark.parametrize("noise_scale", [1.0, 5.0])
@pytest.mark.parametrize("clearance", [0.02, 0.1, 0.199])
def test_clearance_adds_up_to_one_with_what_lies_beyond_the_range(
    clearance: float, noise_scale: float
) -> None:
    below = np.linspace(-0.1, CAP, 30_001)
    seen = [
        Observation(angles=(0.0,), touch=(None, None), clearance=float(height)) for height in below
    ]
    beyond = Observation(angles=(0.0,), touch=(None, None), clearance=CAP, clearance_saturated=True)
    inside = densities(seen, one_reading(clearance), noise_scale)
    p0 = NOISE.outlier * (1 - NOISE.nearby) * 0.9 / CAP
    inside = np.where(below < 0, inside - p0, inside)  # p0 lies within the range alone
    total = (
        np.trapezoid(inside, below) + densities([beyond], one_reading(clearance), noise_scale)[0]
    )
    assert total == pytest.approx(1.0, abs=2e-3)


def test_tilts_and_bits_add_up_to_one() -> None:
    grid = np.linspace(-math.pi / 2, math.pi / 2, 1201)
    step = grid[1] - grid[0]
    total = 0.0
    for bits in ((False, False), (False, True), (True, False), (True, True)):
        one = [Observation(angles=(0.0,), touch=bits, tilt=(float(x), None)) for x in grid.tolist()]
        total += densities(one, one_reading()).sum() * step
    assert total == pytest.approx(1.0, abs=2e-3)


def test_one_interaction_costs_no_more_than_an_outlier() -> None:
    far = Observation(angles=(0.0,), touch=(False, True), tilt=(-1.2, 1.2), clearance=0.0)
    anywhere = NOISE.outlier * (1 - NOISE.nearby) * 0.25 / math.pi**2 * 0.9 / CAP
    assert densities([far], one_reading())[0] == pytest.approx(anywhere, rel=1e-6)


def test_readings_of_which_nothing_is_known_have_a_density_of_their_own() -> None:
    seen = Observation(angles=(0.0,), touch=(False, None), tilt=(-1.2, 1.2), clearance=0.0)
    data = SensorData.of([seen], ("touch", "tilt", "clearance"), CAP)
    anywhere = 0.5 / math.pi**2 * 0.9 / CAP
    assert np.exp(Likelihood(data, NOISE).log_anywhere) == pytest.approx([anywhere], rel=1e-10)


def test_one_that_ends_beside_the_pose_predicted_costs_less() -> None:
    predicted, beside, elsewhere = (
        math.log(densities([one], one_reading())[0])
        for one in (
            Observation(angles=(0.0,), touch=(True, False), tilt=tilt, clearance=height)
            for tilt, height in (((0.2, -0.1), 0.1), ((0.25, -0.14), 0.11), ((0.2, -0.7), 0.01))
        )
    )
    assert 5 < predicted - beside < 10  # nats
    assert predicted - elsewhere > 14


def test_a_pose_that_the_model_cannot_foretell_leaves_only_the_outlier() -> None:
    data = SensorData.of(
        [Observation(angles=(0.0,), touch=(True, False), tilt=(0.2, -0.1), clearance=0.1)],
        ("touch", "tilt", "clearance"),
        CAP,
    )
    misfits = np.zeros((1, 1, MISFITS))
    misfits[..., NO_PREDICTION] = 1
    found = Likelihood(data, NOISE).of(misfits)
    anywhere = NOISE.outlier * 0.25 / math.pi**2 * 0.9 / CAP
    assert math.exp(found[0, 0]) == pytest.approx(anywhere)


def test_modalities_that_do_not_count_change_nothing() -> None:
    near = Observation(angles=(0.0,), touch=(True, False), tilt=(0.2, -0.1), clearance=0.1)
    far = Observation(angles=(0.0,), touch=(False, True), tilt=(0.2, -0.1), clearance=0.19)
    fits = []
    for seen in (near, far):
        data = SensorData.of([seen], ("tilt",), CAP)
        misfits = data.misfits(one_reading(), np.zeros(1, dtype=np.intp))[None]
        fits.append(Likelihood(data, NOISE).of(misfits)[0, 0])
    assert fits[0] == fits[1]


def test_a_model_beyond_the_range_is_certain_of_a_reading_at_its_end() -> None:
    beyond = Observation(angles=(0.0,), touch=(None, None), clearance=CAP, clearance_saturated=True)
    expected = 1 - NOISE.outlier * (1 - NOISE.nearby) * 0.9
    found = densities([beyond], one_reading(saturated=True))[0]
    assert found == pytest.approx(expected)


def test_no_body_fits_better_than_the_best_that_any_could() -> None:
    seen = [
        Observation(angles=(0.0,), touch=(True, False), tilt=(0.2, -0.1), clearance=0.1),
        Observation(
            angles=(0.0,),
            touch=(True, False),
            tilt=(0.2, -0.1),
            clearance=CAP,
            clearance_saturated=True,
        ),
    ]
    data = SensorData.of(seen, ("touch", "tilt", "clearance"), CAP)
    likelihood, interactions = Likelihood(data, NOISE), np.arange(2)
    for reading, alike in ((one_reading(), 0), (one_reading(saturated=True), 1)):
        misfits = data.misfits(reading[np.zeros(2, dtype=np.intp)], interactions)[None]
        found = likelihood.of(misfits)[0]
        best = likelihood.best()[0]
        assert found[alike] == pytest.approx(best[alike])
        assert np.all(found <= best)


@pytest.mark.parametrize("away", [-0.3, -0.1, -0.001, 0.0, 0.02, 0.1])
@pytest.mark.parametrize("noise_scale", [1.0, 5.0, 25.0])
def test_a_reading_at_the_end_of_the_range_is_the_tail_of_the_normal_distribution(
    away: float, noise_scale: float
) -> None:
    beyond = Observation(angles=(0.0,), touch=(None, None), clearance=CAP, clearance_saturated=True)
    data = SensorData.of([beyond], ("clearance",), CAP)
    misfits = data.misfits(one_reading(CAP + away), np.zeros(1, dtype=np.intp))[None]
    inlier, _ = Likelihood(data, NOISE).terms(misfits, noise_scale)
    tail = log_ndtr(away / (NOISE.clearance * noise_scale))
    assert inlier[0, 0] == pytest.approx(tail + math.log1p(-NOISE.outlier), rel=1e-10)


@pytest.mark.parametrize("sensors", [0, 1, 6])
def test_where_touch_does_not_count_the_robot_may_have_other_sensors(sensors: int) -> None:
    observed = Observation(angles=(0.0,), touch=(True,) * sensors, tilt=(0.2, -0.1), clearance=0.1)
    data = SensorData.of([observed], ("tilt", "clearance"), CAP)
    misfits = data.misfits(one_reading(), np.zeros(1, dtype=np.intp))
    assert not misfits[:, :STANCE].any()
