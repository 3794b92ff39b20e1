import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.errors import EstimatorError, InteractionError
from estimator.evaluation.validate import BEST, POPULATION, RANDOM, Validation, compare, validate
from estimator.identification.method import Listener
from estimator.identification.record_link import Record, open_by_hand
from estimator.identification.robot_link import WireLink
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.observation import Observation
from estimator.readings.readings_csv import write
from estimator.storage.records import Prediction
from estimator.storage.store import RunStore
from protocol.errors import RobotError
from tests.estimator.evaluation.test_score import make_ended_run
from tests.estimator.model_robot import JOINTS, TRUE_LENGTHS, ModelRobot, make_capabilities, serving

PROGRAMS = 4


@pytest.fixture
def run(tmp_path: Path) -> RunStore:
    """A run that has ended, and whose best model is the robot itself."""
    return make_ended_run(tmp_path, TRUE_LENGTHS)


def performed(
    run: RunStore,
    uri: str,
    physics: PyBulletPhysics,
    first_id: int = 1,
    saved: Validation | None = None,
) -> Validation:
    link = WireLink(uri, client_id="me", first_id=first_id)
    try:
        return validate(run, physics, link, programs=PROGRAMS, saved=saved, listener=Listener())
    finally:
        link.close()


def test_the_true_model_predicts_what_random_ones_do_not(
    run: RunStore, physics: PyBulletPhysics
) -> None:
    robot = ModelRobot()
    with serving(robot) as uri, run:
        validation = performed(run, uri, physics)
        again = performed(run, uri, physics, first_id=1000, saved=validation)
    assert validation.programs == PROGRAMS
    assert validation.best_model["tilt_deg"] == pytest.approx(0, abs=1e-3)
    assert validation.best_model["clearance_mm"] == pytest.approx(0, abs=1e-3)
    assert validation.best_model["touch"] == 0
    assert validation.random_models["tilt_deg"] is not None
    assert validation.random_models["tilt_deg"] > 0.1
    assert again.programs == PROGRAMS
    targets = [tuple(motion.targets.values()) for motion in robot.motions]
    assert len(set(targets)) == 2 * PROGRAMS  # fresh programs each time


def test_predictions_are_on_disk_before_the_robot_moves(
    run: RunStore, physics: PyBulletPhysics
) -> None:
    robot = ModelRobot()
    robot.refusals.append(RobotError("fault", "A servo fell off."))
    with serving(robot) as uri, run as store:
        with pytest.raises(InteractionError, match="A servo fell off"):
            performed(run, uri, physics)
        assert len(robot.motions) == 1
        (predictions,) = store.validations.all()
        assert len(predictions) == PROGRAMS
        performed(run, uri, physics, first_id=1000)
        (finished,) = store.validations.all()
        assert [item.readings for item in finished] == [item.readings for item in predictions]
    assert len(robot.motions) == 1 + PROGRAMS


def make_prediction(touch: float | None, tilt: float, clearance: float) -> Prediction:
    row = {
        "touch": [None if touch is None else [touch, 0.0]],
        "tilt": [None if touch is None else [tilt, 0.0]],
        "clearance": [None if touch is None else [clearance]],
    }
    rows = {name: value * 3 for name, value in row.items()}
    return Prediction(program=(0.0,), readings={BEST: row, POPULATION: rows, RANDOM: rows})


def test_errors_by_hand() -> None:
    predictions = [
        make_prediction(1.0, np.radians(4.0), 0.050),
        make_prediction(0.0, np.radians(1.0), 0.010),
    ]
    observations = [
        Observation(angles=(0.0,), touch=(False, False), tilt=(0.0, 0.0), clearance=0.040),
        Observation(angles=(0.0,), touch=(False, None), tilt=(None, 0.0), clearance=None),
    ]
    validation = compare(predictions, observations)
    assert validation.best_model["touch"] == pytest.approx(1 / 3)
    assert validation.best_model["tilt_deg"] == pytest.approx(4 / 3)
    assert validation.best_model["clearance_mm"] == pytest.approx(10.0)
    assert validation.population_median == validation.random_models == validation.best_model
    assert validation.invalid_predictions == 0
    assert validation.as_predicted == 1


def test_an_invalid_prediction_is_counted_and_left_out() -> None:
    predictions = [make_prediction(None, 0.0, 0.0), make_prediction(0.0, 0.0, 0.010)]
    wanted = Observation(angles=(0.0,), touch=(False, True), tilt=(0.0, 0.0), clearance=0.0)
    validation = compare(predictions, [wanted, wanted])
    assert validation.best_model["touch"] == pytest.approx(0.5)
    assert validation.best_model["clearance_mm"] == pytest.approx(10.0)
    assert validation.invalid_predictions == 1 + 3 + 3
    assert validation.as_predicted == 0


def test_a_robot_without_touch_sensors_has_no_touch_error() -> None:
    wanted = Observation(angles=(0.0,), tilt=(0.0, 0.0), clearance=0.0)
    validation = compare([make_prediction(0.0, 0.0, 0.0)], [wanted])
    assert validation.best_model["touch"] is None
    assert validation.best_model["tilt_deg"] == 0


def test_a_run_that_has_not_ended_is_not_validated(
    tmp_path: Path, run: RunStore, physics: PyBulletPhysics
) -> None:
    settings, capabilities = run.settings, run.capabilities
    run.close()
    with (
        serving(ModelRobot()) as uri,
        RunStore.create(tmp_path / "empty", settings, capabilities, "me") as empty,
        pytest.raises(EstimatorError, match=r"has not ended.*estimator resume"),
    ):
        performed(empty, uri, physics)


class Fresh(Record):
    """A record of one motor program that the run was fitted to, and of two others."""

    def __init__(self) -> None:
        programs = ((0.0,) * 4, (0.1, 0.2, 0.3, 0.4), (-0.3, -0.2, 0.1, 0.0), (0.0005,) * 4)
        seen = (
            Observation(angles=program, touch=(True,) * 4, clearance=number / 100)
            for number, program in enumerate(programs)
        )
        super().__init__(make_capabilities(), programs, tuple(seen))


def test_a_record_counts_as_fresh_only_what_no_model_was_fitted_to(
    run: RunStore, physics: PyBulletPhysics
) -> None:
    with run as store:
        with pytest.raises(InteractionError, match="fitted to 2, so 2 are fresh, not 3: ask for"):
            validate(run, physics, Fresh(), programs=3, saved=None, listener=Listener())
        assert not store.validations.all()
        assert (
            validate(run, physics, Fresh(), programs=2, saved=None, listener=Listener()).programs
            == 2
        )
        (predictions,) = store.validations.all()
    clearances = [item.observation and item.observation.clearance for item in predictions]
    assert clearances == [0.01, 0.02]  # each program's own, not the record's first


@pytest.mark.parametrize("measures", [False, True])
def test_the_runs_own_table_holds_nothing_fresh(
    tmp_path: Path, run: RunStore, physics: PyBulletPhysics, measures: bool
) -> None:
    """It has the angles that the servos took: after their steps, or as they measured them."""
    robot = make_capabilities()
    measured: tuple[float | None, ...] = ()
    program, performed = (0.102, 0.2, -1.0, 0.4), (0.11, 0.2, -1.0, 0.4)
    if measures:
        joints = tuple(replace(joint, measured_noise=0.001) for joint in robot.joints)
        robot, measured = replace(robot, joints=joints), (0.12, 0.21, -1.02, None)
    felt = Observation(
        angles=performed, measured=measured, touch=(True,) * 4, tilt=(0.0, 0.0), clearance=0.05
    )
    with run as store:
        store.plan(1, program)
        store.observe(1, felt)
        write(tmp_path / "readings.csv", JOINTS, store.observations())
        (tmp_path / "robot.json").write_text(json.dumps(robot.to_map()))
        link = open_by_hand(tmp_path / "readings.csv", lambda _: ())
        with pytest.raises(InteractionError, match="fitted to 2, so 0 are fresh"):
            validate(store, physics, link, programs=1, saved=None, listener=Listener())


def test_a_record_without_what_was_predicted_is_refused(
    run: RunStore, physics: PyBulletPhysics
) -> None:
    with run as store:
        store.validations.predict([Prediction(program=(0.9,) * 4, readings={})])
        with pytest.raises(InteractionError, match="the record lacks a motor program"):
            validate(run, physics, Fresh(), programs=2, saved=None, listener=Listener())
