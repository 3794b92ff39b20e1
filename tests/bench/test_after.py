"""What the study of life after identification counts as right; its runs are the bench."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from bench.after import tables, write_runs
from bench.after_figures import Damaged, Figures, Reached
from bench.after_run import AfterRun, fell_elsewhere
from estimator.readings.observation import Observation
from estimator.use.diagnosis import Verdict
from estimator.use.pose import Pose

SHORTER = "the leg of hip_front shortened"


def damaged(
    fault: str,
    verdict: Verdict,
    *named: str,
    share: tuple[float, float] | None = None,
    as_if: bool = False,
) -> Damaged:
    return Damaged(
        fault=fault,
        noticed=2 if fault else None,
        suspected=bool(fault),
        verdict=verdict.value,
        named=named,
        probability=0.99,
        share=share,
        as_if=as_if,
        movements=5,
        cpu_seconds=7.0,
    )


RIGHT = damaged("body.length=2:70", Verdict.CHANGED, SHORTER, share=(0.69, 0.72))
WRONG = damaged("servos.dead=1", Verdict.CHANGED, SHORTER)
NONE = damaged("body.cut=3:70", Verdict.NONE_OF_THESE, SHORTER, share=(0.0, 0.0))
AS_IF = damaged("body.bent=2:25", Verdict.CHANGED, "zero of hip_front", as_if=True)
WHOLE = damaged("", Verdict.UNCHANGED)


@pytest.mark.parametrize(
    ("one", "right", "wrong"),
    [
        (RIGHT, True, False),
        (WRONG, False, True),
        (NONE, False, False),
        (AS_IF, False, True),
        (WHOLE, True, False),
    ],
)
def test_what_counts_as_right(one: Damaged, right: bool, wrong: bool) -> None:
    assert (one.right, one.wrong) == (right, wrong)


@pytest.mark.parametrize(
    ("tilt", "clearance", "elsewhere"),
    [
        ((0.1, 0.04), 0.010, False),
        ((0.1, 0.06), 0.005, True),
        ((0.1, 0.00), 0.020, True),
        ((0.1, None), 0.005, True),
        ((None, None), 0.005, True),
        ((0.1, 0.00), None, True),
    ],
)
def test_a_robot_that_does_not_read_as_predicted_fell_elsewhere(
    tilt: tuple[float | None, float | None], clearance: float | None, elsewhere: bool
) -> None:
    """As after a fall beyond a sensor's range, which leaves no reading."""
    pose = Pose(
        program=(0.0,), share=1.0, margin=0.1, tilt=(0.1, 0.0), clearance=0.005, touch=(True,)
    )
    observed = Observation(angles=(0.0,), tilt=tilt, clearance=clearance)
    assert fell_elsewhere(observed, pose) == elsewhere


def test_all_runs_are_listed_and_counted(tmp_path: Path) -> None:
    run = AfterRun(
        body="tripod", problem="p", engine="pybullet", seed=3, goals=2, quiet=20, faults=()
    )
    figures = Figures(
        poses=(
            Reached(share=0.9, margin=0.1, reached=True, elsewhere=False),
            Reached(share=0.2, margin=0.0, reached=False, elsewhere=True),
        ),
        quiet=20,
        alarms=0,
        damaged=(WHOLE, RIGHT, WRONG, NONE, AS_IF),
    )
    run.file(tmp_path).parent.mkdir(parents=True)
    run.file(tmp_path).write_text(figures.model_dump_json())
    assert run.figures(tmp_path) == figures
    table = tables([run], tmp_path)
    for row in (
        "| poses reached | 1 | 2 |",
        "| right cause, alone or in a set of two | 1 | 3 |",
        "| wrong cause | 1 | 3 |",
        "| none of these, of the table | 1 | 3 |",
        "| share of a leg within its 90 % interval | 1 | 1 |",
        "| of these, moves as if | 1 | 1 |",
        "| undamaged robots called so | 1 | 1 |",
    ):
        assert row in table
    write_runs([run], tmp_path, tmp_path / "tables")
    with (tmp_path / "tables" / "after.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["right"] for row in rows] == ["True", "True", "False", "False", "False"]
    assert rows[1]["share"] == "0.69; 0.72"
    assert (tmp_path / "tables" / "after-poses.csv").read_text().count("tripod") == 2
