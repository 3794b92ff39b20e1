"""Back-ends by name: ours, those of other packages, and what is said of a wrong one."""

import json
import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from estimator.body.morphology import Base, Morphology
from estimator.errors import EstimatorError, WorkerError
from estimator.identification.method import Listener
from estimator.identification.run import resume
from estimator.physics.backends import (
    BACKENDS,
    PhysicsPool,
    approximation_of,
    in_this_process,
    open_predicting,
    physics_class,
)
from estimator.physics.base import ArrayPhysics, WorldSettings
from estimator.physics.mujoco import MuJoCoPhysics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS, on_this_computer
from tests.estimator.model_robot import make_capabilities, make_order, without_plots
from tests.estimator.outside_package import PHYSICS, THUMB, install, put_on_path

ROOT = Path(__file__).parents[3]
WORLD = WorldSettings()
BALL = Morphology(base=Base(size=(0.1, 0.1, 0.1), mass=1.0), parts=(), density=1.0)
READINGS = """\
angle_deg_left,angle_deg_front,angle_deg_right,angle_deg_back,tilt_lr_deg,tilt_fb_deg
-25,10,-20,15,2,0.5
10,-20,5,-30,1,-3
"""


def test_where_a_back_end_runs_follows_from_what_it_declares() -> None:
    assert issubclass(physics_class("statics"), ArrayPhysics)
    assert not issubclass(physics_class("pybullet"), ArrayPhysics)
    with on_this_computer(2) as executors:
        with closing(executors.open_physics("statics", WORLD)) as exact:
            assert type(exact) is StaticsPhysics
        with closing(executors.open_physics("pybullet", WORLD)) as simulated:
            assert type(simulated) is PhysicsPool
    with closing(in_this_process("pybullet", WORLD)) as engine:
        assert type(engine) is PyBulletPhysics
    with closing(in_this_process("mujoco", WORLD)) as engine:
        assert type(engine) is MuJoCoPhysics
    assert approximation_of("statics", WORLD) is None
    assert isinstance(approximation_of("pybullet", WORLD), StaticsPhysics)


class OtherStatics(StaticsPhysics):
    """A fast back-end of a program's own."""


def test_a_fast_physics_predicts_and_statics_does_for_a_slow_one() -> None:
    for name, kind in ((BACKENDS.add(OtherStatics), OtherStatics), ("pybullet", StaticsPhysics)):
        with closing(open_predicting(name, WORLD)) as physics:
            assert type(physics) is kind


def test_a_run_with_the_physics_of_another_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In processes of its own, as a user would; then again where the package is missing."""
    outside = install(tmp_path / "outside", THUMB)
    (tmp_path / "readings.csv").write_text(READINGS)
    (tmp_path / "robot.json").write_text(json.dumps(make_capabilities().to_map()))
    run = tmp_path / "run"
    identified = subprocess.run(
        [
            *(sys.executable, "-m", "estimator", "identify", "--method", "paper"),
            *("--robot", f"file:{tmp_path / 'readings.csv'}", "--seed", "1", "--jobs", "1"),
            *("--problem", make_order(tmp_path, "").problem, "--modalities", "tilt"),
            *("--population", "4", "--generations", "1", "--physics", "thumb"),
            *("--out", run),
        ],
        env=os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{outside}"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert identified.returncode == 0, identified.stderr
    result = json.loads((run / "result.json").read_text())
    assert (result["complete"], result["physics"]) == (True, "thumb")
    assert result["versions"]["bodyschema-thumb"] == "0.3"
    with RunStore.open(run, to_write=False) as store:
        assert store.settings.plugins == {"bodyschema-thumb": "0.3"}

    with pytest.raises(EstimatorError, match="no physics 'thumb': choose pybullet, mujoco"):
        resume(run, IN_THIS_PROCESS, Listener(), report=without_plots)
    said: list[str] = []
    monkeypatch.setattr(Listener, "say", lambda self, sentence: said.append(sentence))
    put_on_path(install(tmp_path / "newer", THUMB, version="0.4"), monkeypatch)
    resume(run, IN_THIS_PROCESS, Listener(), report=without_plots)
    assert said == [
        "Note: the run was started with bodyschema-thumb 0.3, and goes on with bodyschema-thumb "
        "0.4."
    ]


@pytest.mark.parametrize(
    ("entry_points", "code", "sentence"),
    [
        (
            THUMB,
            "import absent_engine",
            r"physics 'thumb' of bodyschema-thumb 0.3 cannot be loaded from "
            r"bodyschema_thumb:RuleOfThumb: ModuleNotFoundError: No module named 'absent_engine'",
        ),
        (
            THUMB,
            "",
            r"cannot be loaded from bodyschema_thumb:RuleOfThumb: AttributeError: .*'RuleOfThumb'",
        ),
        (
            THUMB,
            "RuleOfThumb = object",
            r"'thumb' of bodyschema-thumb 0.3 must be a class that derives from estimator.Physics",
        ),
        (
            THUMB,
            "from estimator.physics.base import *\n"
            "class RuleOfThumb(ArrayPhysics):\n    def path_margins_of_bodies(self): ...",
            r"'thumb' of bodyschema-thumb 0.3 has no method read_bodies",
        ),
        (
            THUMB.replace("thumb =", "statics =") + THUMB.splitlines()[1],
            "",
            r"more than one physics 'statics': uninstall all but one of bodyschema, "
            r"bodyschema-thumb",
        ),
    ],
    ids=["import", "attribute", "class", "method", "name taken"],
)
def test_a_package_that_cannot_be_used_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    entry_points: str,
    code: str,
    sentence: str,
) -> None:
    put_on_path(install(tmp_path, entry_points, code=code), monkeypatch)
    assert BACKENDS.names() == ("pybullet", "mujoco", "statics", "thumb")
    physics_class("pybullet")  # others are not concerned
    name = "statics" if "statics =" in entry_points else "thumb"
    with pytest.raises(EstimatorError, match=sentence):
        physics_class(name)


def test_what_a_back_end_raises_at_its_start_comes_back_from_the_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = PHYSICS.replace("super().__init__()", "raise RuntimeError('no licence')")
    put_on_path(install(tmp_path, THUMB, code=code), monkeypatch)
    with (
        on_this_computer(2) as executors,
        closing(executors.open_physics("thumb", WORLD)) as physics,
        pytest.raises(EstimatorError, match=r"^bodyschema-thumb 0\.3 .* RuntimeError: no licence$"),
    ):
        physics.read([(BALL, np.zeros(0))])


def test_nothing_is_sought_under_a_wrong_name() -> None:
    with pytest.raises(EstimatorError, match="no physics 'bullet': choose pybullet"):
        in_this_process("bullet", WORLD)
    with pytest.raises(WorkerError, match="at least 1, not 0"), on_this_computer(0):
        pass
