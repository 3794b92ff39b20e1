"""The paper's method gives the digits that it gave before there was another one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS

# Two movements of the default robot, seed 1000.
READINGS = """\
angle_deg_hip_left,angle_deg_hip_front,angle_deg_hip_right,angle_deg_hip_back,\
angle_deg_knee_left,angle_deg_knee_front,angle_deg_knee_right,angle_deg_knee_back,\
touch_1,touch_2,touch_3,touch_4,tilt_lr_deg,tilt_fb_deg,clearance_mm
-17.8000,-20.5200,15.5200,-30.0400,-0.2400,-0.2400,-0.2400,-0.2400,0,1,1,1,28.0015,-2.7664,55.6000
-28.6800,-26.6400,-7.6000,-6.9200,-0.2400,-0.2400,-0.2400,-0.2400,1,0,1,1,7.7812,8.3949,32.0000
"""


LEAST_ERRORS = (
    *(3.6764350168050632, 2.8427670799443563, 2.017493676304205, 1.568249936645377),
    *(4.8254550139439765, 4.8254550139439765, 4.8254550139439765, 3.677989937349975),
)
BEST = (
    *(0.10197078522098002, 0.6481120524264259, 0.39672991623493814, 0.17516697978514795),
    *(0.6601747058101463, 0.23089453070550048, 0.868240465961879, 0.7143974864437843),
)


def test_a_run_in_pybullet_is_the_same_to_the_digit(tmp_path: Path) -> None:
    """These are figures of commit 9f9a428's parent: the next one brought the method posterior."""
    (tmp_path / "readings.csv").write_text(READINGS)
    (tmp_path / "robot.json").write_text(
        json.dumps({"base_size": [0.14, 0.14, 0.085], "base_mass": 0.6})
    )
    order = RunConfig(
        robot=f"file:{tmp_path}/readings.csv",
        problem="parametric",
        method="paper",
        seed=1000,
        population=10,
        generations=3,
    )
    identify(tmp_path / "run", order, IN_THIS_PROCESS, Listener(), report=lambda _: None)
    with RunStore.open(tmp_path / "run", to_write=False) as store:
        generations = store.generations()
    least = [min(generation.errors) for generation in generations]
    assert least == pytest.approx(LEAST_ERRORS, rel=1e-9)
    assert generations[-1].best == pytest.approx(BEST, rel=1e-9)
