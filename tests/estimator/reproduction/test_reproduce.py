"""The whole path: processes, robots, figures; and what interrupts it."""

from __future__ import annotations

import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import psutil
import pytest
from typer.testing import CliRunner

from estimator.cli.command_line import app
from estimator.errors import EstimatorError, RunDirectoryError
from estimator.identification.method import Listener
from estimator.reproduction.ledger import Ledger
from estimator.reproduction.paper_runs import FIGURES, PlannedRun, planned_runs, typical_runs
from estimator.reproduction.reproduce import figures_of, reproduce
from estimator.storage.database import DATABASE
from tests.estimator.reproduction.conftest import TINY

BUDGET = ("--interactions", "2", "--population", "4", "--generations", "1", "--physics", "statics")


class Hearing(Listener):
    def __init__(self) -> None:
        self.said: list[str] = []
        self.total = 0.0
        self.done = 0.0

    def say(self, sentence: str) -> None:
        self.said.append(sentence)

    def expect(self, work: float, done: float) -> None:
        self.total, self.done = work, done

    def worked(self, work: float, what: str) -> None:
        self.done += work


@pytest.fixture(scope="module")
def everything(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, Mapping[str, str], Hearing]:
    """One seed of the whole paper, nothing broken off."""
    root, hearing = tmp_path_factory.mktemp("everything"), Hearing()
    asked: dict[str, Any] = {"runs": 1, "budget": TINY, "command": "estimator reproduce"}
    return root, reproduce(root, FIGURES, hearing, jobs=2, **asked), hearing


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_figure_has_its_three_files(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    root, failures, _ = everything
    assert not failures
    for name in FIGURES:
        assert (root / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert table(root / f"{name}.csv")
        assert json.loads((root / f"{name}.json").read_text())["caption"]


def test_progress_goes_over_all_runs(everything: tuple[Path, Mapping[str, str], Hearing]) -> None:
    _, _, hearing = everything
    assert hearing.done == hearing.total > 0
    assert sum("/9 " in sentence for sentence in hearing.said) == 9
    assert "left" in hearing.said[0]


def test_figure_2_holds_every_models_error_of_both_variants(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    rows = table(everything[0] / "fig2.csv")
    for panel in "ac":
        errors = [row for row in rows if row["panel"] == panel]
        assert len(errors) == 4 * 4  # models, generations
        assert {row["iteration"] for row in errors} == {"1", "2"}
    lengths = [row for row in rows if row["panel"] == "b"]
    assert len(lengths) == 4 * 4  # legs, generations
    assert all(0.02 <= float(row["value"]) <= 0.40 for row in lengths)


def test_figure_3_has_seven_columns_in_each_group_and_the_chance_level(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    root = everything[0]
    rows = table(root / "fig3.csv")
    assert [(row["variant"], row["iteration"]) for row in rows] == [
        (str(variant), str(iteration)) for variant in range(1, 8) for iteration in (1, 2)
    ]
    row = rows[0]
    assert float(row["variance_m2"]) <= float(row["longest_minus_shortest_m"]) ** 2 / 4
    numbers = json.loads((root / "fig3.json").read_text())
    assert len(numbers["bars"]) == 14
    assert numbers["random_models"]["mean_leg_error_m"]["mean"] == pytest.approx(0.064, abs=0.003)


def test_figure_4_follows_twelve_configurations(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    root = everything[0]
    numbers = json.loads((root / "fig4.json").read_text())
    assert [name[-1] for name in numbers["configurations"]] == ["P", "O", "J"] * 4
    assert [len(row) for row in numbers["right_at_iteration_ends"]] == [12, 12]
    rows = [row for row in table(root / "fig4.csv") if row["panel"] == "c"]
    assert len(rows) == 12 * 4
    last = [int(row["value"]) for row in rows if row["generation"] == "3"]
    assert last == [int(right) for right in numbers["right_at_iteration_ends"][1]]
    assert sum(last) == json.loads((root / "fig6.json").read_text())["right"][0]


def test_figure_5_shows_robot_and_models_in_two_poses(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    rows = table(everything[0] / "fig5.csv")
    assert [(row["program"], row["body"]) for row in rows] == [
        (program, body)
        for program in ("first motor program", "fresh motor program")
        for body in ("robot", "model after iteration 1", "model after iteration 2")
    ]
    assert rows[0]["angles_deg"] != rows[3]["angles_deg"]


def test_figure_6_has_the_chance_line_and_an_interval(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    numbers = json.loads((everything[0] / "fig6.json").read_text())
    assert numbers["by_chance"] == pytest.approx(3.75)
    assert (numbers["configurations"], numbers["informative_configurations"]) == (12, 11)
    low, high = numbers["wilson_95"]
    assert 0 <= low <= numbers["successes"] / numbers["runs"] <= high <= 1


def test_figure_6_has_the_texts_genome_too(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    numbers = json.loads((everything[0] / "fig6-8x4.json").read_text())
    assert (numbers["configurations"], numbers["informative_configurations"]) == (20, 19)
    assert numbers["by_chance"] == pytest.approx(5.4, abs=0.05)
    (row,) = table(everything[0] / "fig6-8x4.csv")
    assert row["seed"] == "1000"
    assert row["touch_error"]


def test_figure_4_says_how_well_the_truth_would_have_done(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    (row,) = table(everything[0] / "fig6.csv")
    errors = [float(row[f"{whose}subjective_error"]) for whose in ("", "true_bodys_")]
    text = (everything[0] / "report.md").read_text()
    figure = text[text.index("## Figure 4") : text.index("## Figure 5")]
    assert [f"{error:.2f}" in figure for error in errors] == [True, True]


def test_the_report_tells_all(everything: tuple[Path, Mapping[str, str], Hearing]) -> None:
    root = everything[0]
    text = (root / "report.md").read_text()
    headings = [line.removeprefix("## Figure ") for line in text.splitlines() if "## Fig" in line]
    assert [f"fig{heading}" for heading in headings] == list(FIGURES)
    assert len(json.loads((root / "claims.json").read_text())["findings"]) == 22
    for words in (
        *("`estimator reproduce`", "seeds 1000 to 1000", "Not the paper's budgets"),
        *("Made at commit", "numpy", "simulations requested", "![Figure 5](fig5.png)", "not shown"),
        "![Figure 6-8x4](fig6-8x4.png)",
        *("| topological/touch+tilt+clearance/1000 |", "| parametric/clearance/1000 |"),
    ):
        assert words in text
    assert len(table(root / "runs.csv")) == 9


def test_what_is_finished_is_not_repeated(
    everything: tuple[Path, Mapping[str, str], Hearing],
) -> None:
    root, _, _ = everything
    before = {path: path.stat().st_mtime_ns for path in root.rglob(DATABASE)}
    ended = CliRunner().invoke(
        app, ["reproduce", "fig6", "--runs", "1", *BUDGET, "--jobs", "1", "--out", str(root)]
    )
    assert ended.exit_code == 0, ended.output
    assert "1 of 1 runs are finished already" in ended.stderr
    assert {path: path.stat().st_mtime_ns for path in root.rglob(DATABASE)} == before


def generations(root: Path) -> int:
    """How many are on disk, over all runs."""
    count = 0
    for path in root.rglob(DATABASE):
        with closing(sqlite3.connect(path)) as database:
            if database.execute(
                "SELECT 1 FROM sqlite_master WHERE name = 'generations'"
            ).fetchone():
                count += database.execute("SELECT COUNT(*) FROM generations").fetchone()[0]
    return count


def start(root: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [
            *(sys.executable, "-m", "estimator", "reproduce", "fig2", *BUDGET),
            *("--jobs", "1", "--out", str(root)),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_an_interrupted_reproduction_ends_as_one_that_never_was(
    everything: tuple[Path, Mapping[str, str], Hearing], tmp_path: Path
) -> None:
    done = 0
    for broken_by in (signal.SIGKILL, signal.SIGINT):
        process = start(tmp_path)
        while process.poll() is None and generations(tmp_path) <= done:
            time.sleep(0.005)
        assert process.poll() is None
        family = psutil.Process(process.pid).children(recursive=True)
        if broken_by is signal.SIGINT:
            os.killpg(process.pid, broken_by)  # as a terminal does
        else:
            process.send_signal(broken_by)
        _, said = process.communicate(timeout=120)
        _, left = psutil.wait_procs(family, timeout=120)
        assert not left  # neither workers nor robots
        done = generations(tmp_path)
        assert done > 0
    assert process.returncode == 1
    assert "The same command goes on" in said
    assert "Traceback" not in said
    process = start(tmp_path)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    for name in ("fig2.csv", "fig2.json", "fig2.png"):
        assert (tmp_path / name).read_bytes() == (everything[0] / name).read_bytes()
    assert len(json.loads((tmp_path / "study.json").read_text())["sessions"]) == 3


@pytest.fixture
def typical(root: Path) -> tuple[PlannedRun, Path]:
    return typical_runs(TINY)[0], root


def test_a_run_that_fails_is_listed_and_tried_again(
    typical: tuple[PlannedRun, Path],
) -> None:
    run, root = typical
    directory = run.directory(root)
    Ledger(root, TINY.in_words, command="", jobs=1).close()
    directory.mkdir(parents=True)
    (directory / DATABASE).write_text("no database at all, but long enough to be taken for one")
    failures = reproduce(root, ("fig2",), Listener(), budget=TINY)
    assert list(failures) == [run.name]
    text = (root / "report.md").read_text()
    assert "A run is missing." in text
    assert "1 of 2 runs are not finished" in text
    assert "run.sqlite is not a run: file is not a database" in text
    (directory / DATABASE).unlink()
    assert not reproduce(root, ("fig2",), Listener(), budget=TINY)
    assert "![Figure 2](fig2.png)" in (root / "report.md").read_text()


def test_another_robot_or_budget_does_not_mix(root: Path) -> None:
    (root / "truth.urdf").write_text("<robot/>")
    with pytest.raises(RunDirectoryError, match=r"truth\.urdf is not what it would be now"):
        reproduce(root, ("fig2",), Listener(), budget=TINY)
    with pytest.raises(RunDirectoryError, match="give another --out"):
        reproduce(root, ("fig2",), Listener())


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["fig7"], 1, "there is no 'fig7'"),
        (["fig2", "--physics", "magic"], 1, "there is no physics 'magic'"),
        (["fig2", "--population", "3"], 1, "must be even"),
        (["fig2", "--runs", "31"], 2, "Usage"),
        (["fig2", "--interactions", "0"], 2, "Usage"),
        ([], 2, "Usage"),
    ],
)
def test_bad_input_is_a_sentence(
    tmp_path: Path, arguments: list[str], code: int, sentence: str
) -> None:
    ended = CliRunner().invoke(app, ["reproduce", *arguments, "--out", str(tmp_path / "out")])
    assert ended.exit_code == code
    assert sentence in ended.stderr
    assert not (tmp_path / "out").exists()


def test_figures_by_name() -> None:
    assert figures_of("all") == FIGURES
    assert figures_of("fig3") == ("fig3",)
    with pytest.raises(EstimatorError, match="choose fig2"):
        figures_of("3")
    assert {run.problem for run in planned_runs(figures_of("fig5"), 2, TINY)} == {"topological"}
