"""``estimator compare``: runs side by side, also unfinished and damaged ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb
from typer.testing import CliRunner, Result

from estimator.cli.command_line import app
from estimator.report.camera import Picture
from estimator.report.comparison import ComparedRun, comparison_picture
from estimator.storage.store import RunStore
from tests.estimator.report.made_runs import EIGHT, capabilities_with, made_run


@pytest.fixture
def runs(tmp_path: Path) -> tuple[Path, Path]:
    """A finished run of one method and an unfinished one of the other."""
    return (
        made_run(tmp_path / "one", "topological", "posterior"),
        made_run(tmp_path / "two", "parametric", "paper", complete=False),
    )


def compare(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["compare", *map(str, arguments)], terminal_width=200)


def test_runs_stand_side_by_side_as_table_and_picture(
    runs: tuple[Path, Path], tmp_path: Path
) -> None:
    picture = tmp_path / "c.png"
    ended = compare(*runs, "--out", picture)
    assert ended.exit_code == 0, ended.output
    lines = {line.split("  ")[0]: line.split()[-2:] for line in ended.stdout.splitlines() if line}
    assert lines["problem"] == ["topological", "parametric"]
    assert lines["seed"] == ["1", "1"]
    assert "Run 2 is not finished" in ended.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    one, two = (ComparedRun.read(run) for run in runs)
    for run in (one, two):
        for length in run.lengths.values():
            assert f"{1000 * length.median:.1f}" in ended.stdout
    axes = comparison_picture([one, two]).axes[-1]
    drawn = [
        float(np.asarray(line.get_ydata())[0]) for line in axes.lines if np.size(line.get_ydata())
    ]
    medians = [100 * length.median for run in (one, two) for length in run.lengths.values()]
    assert drawn == pytest.approx(medians)  # the plot's numbers are the table's


def test_in_80_columns_names_fold_and_nothing_is_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    joints = tuple(f"{place}_of_the_middle" for place in ("left", "front", "right", "back"))
    run = made_run(
        tmp_path / "one", "parametric", "posterior", capabilities=capabilities_with(joints)
    )
    ended = compare(*[run] * 4, "--out", tmp_path / "c.png")
    assert ended.exit_code == 0, ended.output
    _, _, lengths = ended.stdout.partition("length (mm)")
    assert "…" not in ended.stdout
    for joint in joints:
        assert joint in "".join(line.split()[0] for line in lengths.splitlines() if line[:1] != " ")


def test_a_leg_has_one_colour_on_all_bodies_and_in_the_plot(tmp_path: Path) -> None:
    others = tuple(f"other_{number}" for number in range(8))
    first, second = (
        ComparedRun.read(
            made_run(
                tmp_path / joints[0],
                "parametric",
                "posterior",
                capabilities=capabilities_with(joints),
            )
        )
        for joints in (EIGHT, others)
    )
    *panels, plot = comparison_picture([first, second]).axes
    plotted = [to_hex(line.get_color()) for line in plot.lines if np.size(line.get_ydata()) == 1]
    legs = len(first.lengths)
    for panel, colours in zip(panels, (plotted[:legs], plotted[legs:]), strict=True):
        picture = np.asarray(panel.images[0].get_array())
        assert legs_in(picture, plotted) == set(colours)


def legs_in(picture: Picture, colours: Sequence[str]) -> set[str]:
    """Those of some colours in which something is drawn, however lit or shaded."""
    pixels = picture.reshape(-1, 3) / np.linalg.norm(picture, axis=-1).reshape(-1, 1)
    seen = set()
    for colour in colours:
        hue = np.array(to_rgb(colour)) / np.linalg.norm(to_rgb(colour))
        if np.sum(np.linalg.norm(pixels - hue, axis=1) < 0.03) > 20:
            seen.add(colour)
    return seen


def test_a_run_that_has_learnt_nothing_is_compared(runs: tuple[Path, Path], tmp_path: Path) -> None:
    with RunStore.open(runs[1]) as store:
        store._database.execute("DELETE FROM generations")
        store._database.execute("DELETE FROM checkpoint")
    ended = compare(*runs, "--out", tmp_path / "c.png")
    assert ended.exit_code == 0, ended.output


def test_what_cannot_be_compared_is_a_sentence(runs: tuple[Path, Path], tmp_path: Path) -> None:
    alone, nowhere = compare(runs[0]), compare(runs[0], tmp_path)
    assert (alone.exit_code, nowhere.exit_code) == (2, 1)
    assert "two run directories" in alone.stderr
    assert "holds no run" in nowhere.stderr
    other = compare(*runs, "--out", tmp_path / "c.pdf")
    assert other.exit_code == 2
    assert ".png" in other.stderr
