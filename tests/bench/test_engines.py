"""The comparison of engines: MuJoCo's bodies are ours, and its figures say what they mean."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from bench.engines.__main__ import main
from bench.engines.figures import (
    OWN,
    UNEXPLAINED,
    Compared,
    cause,
    list_causes,
    risk_coverage,
    share,
)
from bench.engines.page import publish
from bench.engines.runs import CEILINGS, PROBLEMS, RIVALS, RUNS, draw
from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.errors import EstimatorError
from estimator.physics.base import WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import PACE, StaticsPhysics
from estimator.readings.observation import PredictedReadings

BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)


def four_legs(length: float) -> Morphology:
    legs = [
        Part(parent=BASE, mount=leg, hinge=2, length=length, radius=0.006, motor=leg, sensor=leg)
        for leg in range(4)
    ]
    return Morphology(base=BODY, parts=tuple(legs), density=1000.0)


def readings(tilts: list[float]) -> PredictedReadings:
    """Poses that differ in one tilt, degrees; everything else is alike."""
    poses = PredictedReadings.empty(len(tilts), 1)
    poses.tilt[:, 0] = np.radians(tilts)
    poses.valid[:] = True
    return poses


@pytest.mark.parametrize("problem", PROBLEMS)
def test_bodies_depend_on_seed_and_number_alone(problem: str) -> None:
    body, (_, program), (_, nudged) = draw(problem, 5, 17)
    again = draw(problem, 5, 17)
    assert again[0] == body
    assert np.array_equal(again[1][1], program)
    assert draw(problem, 5, 18)[0] != body
    assert draw(problem, 6, 17)[0] != body
    off = np.degrees(np.abs(nudged - program))
    assert off[program != 0] == pytest.approx(0.1)
    assert not off[program == 0].any()


def test_the_least_inertia_is_a_setting_of_the_world() -> None:
    _, pair, _ = draw("parametric", 0, 0)
    speeds = []
    for least in (6.0, 600.0):
        with PyBulletPhysics(WorldSettings(steps=20, least_inertia=least)) as physics:
            speeds.append(float(physics.read([pair]).speed[0]))
    assert speeds[0] != speeds[1]


def test_ceilings_name_runs_that_exist() -> None:
    assert {run for _, one, two, _ in CEILINGS for run in (one, two)} <= set(RUNS)
    assert set(RIVALS) <= set(RUNS)


def test_wilson_interval() -> None:
    interval = share(np.ones(10, dtype=bool))
    assert interval["share"] == 1
    assert interval["low"] == pytest.approx(0.7225, abs=1e-4)
    assert interval["high"] == pytest.approx(1)
    assert math.isnan(share(np.zeros(0, dtype=bool))["share"])


def test_the_surest_poses_come_first_and_what_says_nothing_is_left_out() -> None:
    computed = readings([0.0, 0.0, 0.0, 0.0, 0.0])
    computed.undecided[4] = True
    engine = readings([0.1, 9.0, 0.2, 9.0, 9.0])
    engine.valid[3] = False
    compared = Compared(
        problem="parametric",
        statics=computed,
        margins=np.array([0.1, 0.2, 0.3, 0.4, 0.5]),
        simulated=dict.fromkeys(RUNS, engine),
    )
    kept, risk = risk_coverage(compared, "fine")
    assert kept == pytest.approx([1 / 3, 2 / 3, 1])
    assert risk == pytest.approx([0, 1 / 2, 1 / 3])
    assert compared.disagreements() == [1]
    assert compared.suspects() == [1]
    compared.simulated["mujoco"] = readings([0.0] * 5)  # now the engines are not of one opinion
    assert compared.suspects() == []


def test_poses_that_are_equally_sure_come_in_no_order() -> None:
    for wrong in range(4):
        engine = readings([9.0 if row == wrong else 0.0 for row in range(4)])
        compared = Compared(
            problem="parametric",
            statics=readings([0.0] * 4),
            margins=np.full(4, 0.3),
            simulated={"fine": engine},
        )
        assert risk_coverage(compared, "fine")[1] == pytest.approx([0.25] * 4)


def test_the_cause_is_the_first_world_that_agrees_with_statics() -> None:
    pair = (four_legs(0.15), np.radians([-30.0] * 4))
    with StaticsPhysics() as statics:
        computed = statics.read([pair])
    worlds = {
        "too short": WorldSettings(steps=1),
        "long enough": WorldSettings(),
        "never": WorldSettings(),
    }
    assert cause(pair, computed, worlds) == "long enough"
    computed.tilt[0] = 1.0
    assert cause(pair, computed, {"settled": WorldSettings()}) == UNEXPLAINED


def test_a_fork_that_the_steps_of_statics_miss_is_its_own_fault(tmp_path: Path) -> None:
    """The centre of mass of body 901 is out of its support for less than one step."""
    pairs = [draw("topological-24", 1, number)[1] for number in range(902)]
    with StaticsPhysics() as statics, StaticsPhysics(pace=PACE / 30) as finer:
        computed, engine = statics.read(pairs), finer.read(pairs)
    compared = Compared(
        problem="topological-24",
        statics=computed,
        margins=np.zeros(len(pairs)),
        simulated=dict.fromkeys(RUNS, engine),
    )
    disagreements = list_causes(compared, 1, tmp_path / "causes.json", lambda: None)
    assert [item["body"] for item in disagreements][-1] == 901
    assert {item["cause"] for item in disagreements} == {OWN}


def test_the_command_goes_on_where_it_was(tmp_path: Path) -> None:
    command = ["--bodies", "1", "--seed", "2", "--jobs", "1", "--problems", "topological"]
    assert main([*command, "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "engines.json").read_text("utf-8"))
    assert [item["problem"] for item in report["problems"]] == ["topological"]
    with (tmp_path / "engines.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(RIVALS) + len(CEILINGS)
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "statics-differences.png",
        "statics-risk.png",
    }
    [kept] = tmp_path.rglob("*.npz")
    before = kept.stat().st_mtime_ns
    assert main([*command, "--out", str(tmp_path)]) == 0
    assert kept.stat().st_mtime_ns == before


def test_tables_replace_the_old_ones_in_the_page_and_nothing_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    begin = "<!-- measured: begin (make compare-engines writes from here) -->"
    page.write_text(f"above\n{begin}\nold\n<!-- measured: end -->\nbelow\n", encoding="utf-8")
    publish(page, "new\n")
    text = page.read_text("utf-8")
    assert text.startswith("above\n")
    assert text.endswith("\nbelow\n")
    assert "new" in text
    assert "old" not in text
    page.write_text("no place\n", encoding="utf-8")
    with pytest.raises(EstimatorError, match="no lines"):
        publish(page, "new\n")
