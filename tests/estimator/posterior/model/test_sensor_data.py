from __future__ import annotations

import numpy as np
import pytest

from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.sensor_data import DENSITIES, NO_PREDICTION, SCALED, SensorData
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings

NOISE = Noise(tilt=0.01, clearance=0.004, touch=0.02, outlier=0.05)


def test_every_modality_has_a_density() -> None:
    assert set(DENSITIES) == set(MODALITIES)
    assert sum(density.misfits for density in DENSITIES.values()) == NO_PREDICTION
    assert SCALED == ("tilt", "clearance")  # as noise factors are stored in runs


@pytest.mark.parametrize("name", list(MODALITIES))
def test_what_was_not_read_has_no_density(name: str) -> None:
    nothing = Observation(angles=(0.0,), touch=(None, None))
    observed = DENSITIES[name].observed([nothing], counts=True)
    nowhere = DENSITIES[name].log_anywhere(observed.count, observed.beyond, 0.2)
    assert nowhere.tolist() == [0.0]


def test_an_interaction_in_which_nothing_was_read_says_nothing() -> None:
    nothing = Observation(angles=(0.0,), touch=(None, None))
    readings = PredictedReadings.empty(1, 2)
    readings.valid[:] = True
    data = SensorData.of([nothing], tuple(MODALITIES), 0.2)
    misfits = data.misfits(readings, np.zeros(1, dtype=np.intp))[None]
    assert Likelihood(data, NOISE).of(misfits)[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_the_mixture_is_the_sum_of_the_densities() -> None:
    seen = Observation(angles=(0.0,), touch=(True, False), tilt=(0.2, -0.1), clearance=0.1)
    readings = PredictedReadings.empty(1, 2)
    readings.valid[:] = True
    readings.touch[0], readings.tilt[0], readings.clearance[0] = (True, True), (0.21, -0.1), 0.102
    interaction = np.zeros(1, dtype=np.intp)
    inlier = np.log1p(-NOISE.outlier)
    for name in MODALITIES:
        data = SensorData.of([seen], [name], 0.2)
        misfits = data.misfits(readings, interaction)[None]
        alone, _ = Likelihood(data, NOISE).terms(misfits)
        inlier += alone[0, 0] - np.log1p(-NOISE.outlier)
    data = SensorData.of([seen], tuple(MODALITIES), 0.2)
    together, _ = Likelihood(data, NOISE).terms(
        data.misfits(readings, interaction)[None], np.ones(1), np.zeros((1, 2))
    )
    expected = (
        np.log(0.95)
        - 0.5
        - 2 * np.log(0.01 * np.sqrt(2 * np.pi))
        - 0.5 * 0.5**2
        - np.log(0.004 * np.sqrt(2 * np.pi))
        + np.log(0.98)
        + np.log(0.02)
    )
    assert together[0, 0] == pytest.approx(inlier)
    assert together[0, 0] == pytest.approx(expected)
