from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.errors import TruthError
from estimator.evaluation.score import score
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.readings.observation import Observation
from estimator.storage.records import Counters, Generation
from estimator.storage.run_config import RunSettings
from estimator.storage.store import RunStore
from tests.estimator.model_robot import JOINTS, PROBLEM, make_capabilities

YAWS = {"left": 1.5707963, "front": 0.0, "right": -1.5707963, "back": 3.1415927}
PLACES = {"left": "0 0.07 0", "front": "0.07 0 0", "right": "0 -0.07 0", "back": "-0.07 0 0"}


def write_truth(path: Path, *, lengths: tuple[float, ...], axis_of_front: str = "0 -1 0") -> Path:
    box = '<box size="0.14 0.14 0.03"/>'
    text = f'<link name="body"><collision><geometry>{box}</geometry></collision></link>'
    for name, length in zip(JOINTS, lengths, strict=True):
        axis = axis_of_front if name == "front" else "0 -1 0"
        text += f"""<link name="{name}_leg"><collision><origin xyz="{length / 2} 0 0"
          rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.006" length="{length}"/>
          </geometry></collision></link><joint name="{name}" type="revolute">
          <parent link="body"/><child link="{name}_leg"/><axis xyz="{axis}"/>
          <origin xyz="{PLACES[name]}" rpy="0 0 {YAWS[name]}"/></joint>"""
    path.write_text(f'<robot name="r">{text}</robot>')
    return path


def make_run(
    folder: Path, lengths: tuple[float, ...], text: str = PROBLEM, more: tuple[float, ...] = ()
) -> RunStore:
    """A run that ended with one model of the given lengths; its right leg never touched.

    ``more`` are genes before the last length, where the text leaves more to be found.
    """
    settings = RunSettings(
        method="paper",
        explore="random",
        search="deterministic-crowding",
        objective="largest",
        reference="pybullet",
        robot="replay:x",
        problem="legs",
        problem_text=text,
        physics="pybullet",
        modalities=("touch", "tilt", "clearance"),
        seed=1,
        interactions=1,
        population=2,
        generations=1,
    )
    store = RunStore.create(folder / "run", settings, make_capabilities(), "me")
    store.plan(0, (0.0,) * 4)
    store.observe(0, Observation(angles=(0.0,) * 4, touch=(True, True, False, True)))
    genes = ((np.array(lengths) - 0.05) / 0.2).tolist()
    genes[-1:] = [*more, genes[-1]]
    generation = Generation(
        number=0, iteration=0, errors=(2.0, 1.0), best=tuple(genes), counters=Counters()
    )
    store.save(generation, {"population": [[0.0] * len(genes), genes]})
    return store


def make_ended_run(folder: Path, lengths: tuple[float, ...]) -> RunStore:
    """The same after its last generation."""
    store = make_run(folder, lengths)
    (generation,), checkpoint = store.generations(), store.checkpoint()
    assert checkpoint is not None
    store.save(replace(generation, number=1), checkpoint.state)
    store.search_end.save_best_fit(None)
    return store


def test_lengths_are_compared_leg_by_leg(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.2, 0.16))
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16, 0.16, 0.16, 0.16))
    with store:
        scored = score(store, truth, statics, physics)
    assert scored.joints == JOINTS
    assert scored.leg_errors_signed_m == pytest.approx([0.01, -0.01, 0.04, 0.0], abs=1e-9)
    assert scored.leg_errors_m == pytest.approx([0.01, 0.01, 0.04, 0.0], abs=1e-9)
    assert scored.mean_leg_error_m == pytest.approx(0.015)
    assert scored.mean_signed_leg_error_m == pytest.approx(0.01)
    assert scored.touched == (True, True, False, True)
    assert scored.mean_leg_error_touched_m == pytest.approx(0.02 / 3)
    assert scored.mean_leg_error_never_touched_m == pytest.approx(0.04)
    assert (scored.configurations_right, scored.configurations_total) == (12, 12)
    assert scored.configurations_right_up_to_equivalence == 12
    assert scored.configurations_informative == 0
    assert not scored.not_representable


def test_a_wrong_hinge_counts_as_one_wrong_configuration(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    store = make_run(tmp_path, (0.16, 0.16, 0.16, 0.16))
    down = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4, axis_of_front="0 1 0")
    with store:
        scored = score(store, down, statics, physics)
    assert scored.configurations_right == scored.configurations_right_up_to_equivalence == 11


def test_what_cannot_be_felt_is_right_up_to_equivalence(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    up, roll = (f'mount = "front"\nhinge = "{kind}"' for kind in ("up", "roll_left"))
    rolling = PROBLEM.replace(up, roll)
    store = make_run(tmp_path, (0.16, 0.16, 0.16, 0.16), rolling)
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4, axis_of_front="1 0 0")
    with store:
        scored = score(store, truth, statics, physics)
    assert scored.configurations_right == 11
    assert scored.configurations_right_up_to_equivalence == 12


def test_what_no_genome_can_say_is_wrong_and_listed(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    store = make_run(tmp_path, (0.16, 0.16, 0.16, 0.16))
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4, axis_of_front="0 -1 0.3")
    with store:
        scored = score(store, truth, statics, physics)
    assert scored.configurations_right == scored.configurations_right_up_to_equivalence == 11
    (sentence,) = scored.not_representable
    assert sentence.startswith("front has its axis 17 degrees")


def test_another_robots_truth_is_refused(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    store = make_run(tmp_path, (0.16, 0.16, 0.16, 0.16))
    with store, pytest.raises(TruthError, match="no revolute joint named"):
        score(store, Path("sim_robot/bodies/quadruped.urdf"), statics, physics)


def test_the_error_of_the_truth_tells_a_failed_search_from_a_hopeless_one(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    store = make_run(tmp_path, (0.16, 0.16, 0.16, 0.16))
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4)
    with store:
        scored = score(store, truth, statics, physics)
    # With all angles 0 the true body lies on its belly, and three feet are said to touch.
    assert scored.true_body_errors == pytest.approx([3.0], abs=0.01)
    assert scored.true_body_error == scored.true_body_errors[0]


def test_the_margin_of_the_truth_tells_where_a_trifle_decides(
    tmp_path: Path, statics: StaticsPhysics, physics: PyBulletPhysics
) -> None:
    store = make_run(tmp_path, (0.16, 0.16, 0.16, 0.16))
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4)
    # Left and right legs go down, the others up: the body balances on two feet.
    angles = tuple(np.radians([-25.0, 25.0, -25.0, 25.0]))
    with store:
        store.plan(1, angles)
        store.observe(1, Observation(angles=angles, touch=(True, False, True, False)))
        scored = score(store, truth, statics, physics)
    flat, balanced = scored.true_body_margins_deg
    assert flat > 10
    assert balanced < 0.05
