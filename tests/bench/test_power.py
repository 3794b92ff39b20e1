"""The study's list, its memory and its tables; the runs themselves are the bench."""

from __future__ import annotations

import csv
import pickle
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from bench.power.__main__ import main
from bench.power.robots import Robot
from bench.power.study import PICTURES, SEEDS, study
from bench.power.tables import overview, plot_success, run_rows, write_tables
from bench.power.trial import Figures, Step, Trial, TrialRun
from bench.prior_bodies import drawn_body
from estimator.identification.method import Listener
from estimator.reproduction.harness import directory
from sim_robot.world.body import load_body


def figures(
    seed: int, cells: int, probability: float, error: float = 1.0, *, explained: bool = True
) -> Figures:
    step = Step(
        probability=probability,
        explained=explained,
        cells=cells,
        leg_errors_mm=(error, -1.0),
        inside=(False, True),
        cpu_seconds=20.0,
    )
    return Figures(
        seed=seed,
        cpu_seconds=20.0,
        simulations=1000,
        explained=True,
        verdict="Some body explains it.",
        cells=12,
        steps=(step,),
    )


def test_every_robot_of_the_study_can_be_started(tmp_path: Path) -> None:
    path = tmp_path / "body.urdf"
    for trials in study(SEEDS["development"]).values():
        assert len({trial.name for trial in trials}) == len(trials)
        for trial in pickle.loads(pickle.dumps(trials)):
            body = trial.robot.body(trial.seeds[0])
            names = []
            for text in (body, trial.robot.truth(body)):
                path.write_text(text, encoding="utf-8")
                names.append([motor.name for motor in load_body(path).motors])
            assert names[0] == names[1]


def test_a_body_of_the_prior_is_drawn_again_for_its_seed() -> None:
    assert drawn_body("topological", 3) == drawn_body("topological", 3)
    assert drawn_body("topological", 3) != drawn_body("topological", 4)


def test_a_body_of_the_prior_is_one_that_the_problem_allows(tmp_path: Path) -> None:
    path, library = tmp_path / "one_each.toml", Path("estimator/problem/library")
    path.write_text(f"share_mounts = false\n{(library / 'topological.toml').read_text()}")
    for seed in range(10):
        body = etree.fromstring(drawn_body(str(path), seed).encode())
        hips = [joint for joint in body.findall("joint") if joint.get("type") == "revolute"]
        places = {
            tuple(
                value
                for tag in ("parent", "origin")
                for one in hip.findall(tag)
                for value in one.attrib.values()
            )
            for hip in hips
        }
        assert len(places) == len(hips) == 4


def done_before(root: Path) -> None:
    """Runs of one group, with the study's ledger."""
    for seed in SEEDS["reported"][:10]:
        folder = root / "reported" / "runs" / "eight-parts" / "topological-20" / str(seed)
        folder.mkdir(parents=True)
        (folder / "figures.json").write_text(figures(seed, 12, 0.9).model_dump_json())
        (folder / "made.json").write_text('{"commits": ["commit 1"]}')
    (root / "reported" / "study.json").write_text('{"asked": {}}')


def test_what_was_done_is_not_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    done_before(tmp_path)
    main(["--only", "eight parts", "--done", "--out", str(tmp_path)])
    assert "10 of 10" in capsys.readouterr().out
    monkeypatch.setattr("bench.power.__main__.DOCS", tmp_path)
    for name in ("images", "runs"):
        (tmp_path / name).mkdir()
    with pytest.raises(SystemExit):
        main(["--only", "eight parts", "--publish", "--done", "--out", str(tmp_path)])
    main(["--publish", "--done", "--out", str(tmp_path)])
    (picture,) = (tmp_path / "images").iterdir()
    assert picture.read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "runs" / "runs.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["seed"] for row in rows] == [str(seed) for seed in SEEDS["reported"][:10]]
    assert {row["commit"] for row in rows} == {"Made at commit 1."}


def test_a_run_that_was_broken_off_begins_anew(tmp_path: Path) -> None:
    def asked(seed: int) -> str:
        raise AssertionError(f"seed {seed} is not done")

    run = TrialRun(
        group="a group", trial=Trial(name="a trial", seeds=(6,), robot=Robot(body=asked)), seed=6
    )
    assert run.name == "a-group/a-trial/6"
    left = directory(run, tmp_path) / "run"
    left.mkdir(parents=True)
    assert not run.is_finished(tmp_path)
    with pytest.raises(AssertionError, match="seed 6 is not done"):
        run.do(tmp_path, Listener())
    assert not left.exists()


@pytest.mark.parametrize(
    ("run", "wrong"),
    [
        (figures(1, 12, 0.99), False),
        (figures(1, 11, 0.99), True),
        (figures(1, 11, 0.80), False),
        (figures(1, 12, 0.99, error=25.0), True),
        (figures(1, 11, 0.99).model_copy(update={"explained": False}), False),
    ],
)
def test_certain_and_wrong(run: Figures, wrong: bool) -> None:
    assert run.certain_and_wrong == wrong


def test_the_tables_hold_every_run(tmp_path: Path) -> None:
    trial = Trial(name="one method", seeds=(1, 2))
    runs = [figures(1, 12, 0.99), figures(2, 11, 0.40)]
    done = {
        "whole body": [(trial, runs)],
        "faults": [(trial, runs[:1])],
        "lengths": [(trial, runs)],
    }
    text = overview(done, "Made at commit 1.")
    assert "Made at commit 1." in text
    assert "| one method | 1 | 1 of 2 | 9–91 % | 1 | 1 | 1.0 | 1.0 | 2 of 4 | 20 |" in text
    assert "| one method | 1 | 12 of 12 | 0.99 | +1 -1 | no | Some body explains it. |" in text
    assert "| 0.99–1 | 1 | 0.99 | 1 |" in text  # lengths alone state nothing
    assert "4 of 8 hold the true length" in text
    write_tables(done, tmp_path, "commit 1")
    lines = (tmp_path / "runs.csv").read_text(encoding="utf-8").splitlines()
    assert "whole body,one method,2,□,0.40,+1.0 -1.0,20,,commit 1" in lines
    assert len(lines) == 5
    faults = (tmp_path / "faults.csv").read_text(encoding="utf-8")
    assert "faults,one method,1,12 of 12,0.99,+1 -1,no,Some body explains it.,commit 1" in faults


def test_the_picture_has_a_line_for_each_method() -> None:
    one, other = (Trial(name=name, seeds=(1, 2)) for name in ("one method", "another"))
    figure = plot_success(
        [(one, [figures(1, 12, 0.99), figures(2, 11, 0.40)]), (other, [figures(1, 12, 0.99)])]
    )
    points = [
        [np.asarray(line.get_xydata()).tolist() for line in axes.lines] for axes in figure.axes
    ]
    assert points == [[[[1, 0.5]], [[1, 1]]], [[[20, 0.5]], [[20, 1]]]]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["one method", "another"]


@pytest.mark.parametrize("group", PICTURES)
def test_no_method_of_a_group_is_left_out_of_its_picture(group: str) -> None:
    trials = study(SEEDS["development"])[group]
    figure = plot_success([(trial, [figures(1, 12, 0.99)]) for trial in trials])
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == [trial.name for trial in trials]
    assert all(len(axes.lines) == len(trials) for axes in figure.axes)


def test_what_a_run_does_not_stand_by_is_no_statement() -> None:
    trial = Trial(name="one method", seeds=(1, 2))
    runs = [figures(1, 12, 0.99), figures(2, 11, 0.97, explained=False)]
    text = overview({"whole body": [(trial, runs)]}, "")
    assert "| one method | 1 | 1 of 2 | 9–91 % | 1 | 1 |" in text
    assert [row[3] for row in run_rows([(trial, runs)])] == ["0.99", "(0.97)"]
    assert "| 0.95–0.99 |" not in text
