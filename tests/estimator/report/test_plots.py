"""Plots of robots with more joints than there are markers."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.report.canvas import MARKERS, as_png, as_svg, leg_colour, leg_markers, new_axes
from estimator.report.plots import draw_errors, draw_lengths, plot_interval_lengths
from estimator.storage.records import Counters, Generation
from tests.estimator.model_robot import (
    JOINTS,
    PROBLEM,
    make_capabilities,
    make_posterior,
    make_problem,
)

PNG = b"\x89PNG"


def history(*errors: Sequence[float]) -> list[Generation]:
    """Two generations per iteration; the best model's legs grow."""
    return [
        Generation(
            number=number,
            iteration=number // 2,
            errors=tuple(row),
            best=(number / 10, 0.2, 0.3, 0.4),
            counters=Counters(),
        )
        for number, row in enumerate(errors)
    ]


GENERATIONS = history((3.0, float("inf"), 5.0), (2.0, 3.0, 4.0), (2.5, 3.0, 3.5), (1.0, 1.0, 2.0))


def plot_errors(generations: Sequence[Generation]) -> Figure:
    figure, axes = new_axes()
    draw_errors(axes, generations)
    return figure


def ends_of_iterations(axes: Axes) -> list[float]:
    lines = [line for line in axes.lines if line.get_linestyle() == ":"]
    return [float(np.asarray(line.get_xdata(), dtype=float)[0]) for line in lines]


def test_every_models_error_is_drawn_and_iterations_are_parted() -> None:
    figure = plot_errors(GENERATIONS)
    assert as_png(figure).startswith(PNG)
    (axes,) = figure.axes
    dots = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines[:4]]
    assert [sorted(row.tolist()) for row in dots] == [
        [3.0, 5.0],
        [2.0, 3.0, 4.0],
        [2.5, 3.0, 3.5],
        [1.0, 1.0, 2.0],
    ]
    assert np.asarray(axes.lines[4].get_ydata()).tolist() == [3.0, 2.0, 2.5, 1.0]
    assert ends_of_iterations(axes) == [1.5, 3.5]


def test_a_perfect_model_is_drawn() -> None:
    perfect = plot_errors(history((0.0, 2.0), (0.0, 1.0)))
    assert perfect.axes[0].get_yscale() == "linear"  # a logarithmic one leaves it out
    assert plot_errors(GENERATIONS).axes[0].get_yscale() == "log"


def test_legs_are_drawn_with_the_papers_arrows_in_centimetres() -> None:
    problem = make_problem()
    genome = Genome(problem, problem.base(make_capabilities()))
    _, axes = new_axes()
    draw_lengths(axes, GENERATIONS, genome, JOINTS, targets=(0.1, 0.2, 0.3, 0.4))
    lines = {line.get_label(): line for line in axes.lines}
    assert MARKERS == {"left": "<", "front": "^", "right": ">", "back": "v"}
    assert [lines[name].get_marker() for name in JOINTS] == ["<", "^", ">", "v"]
    assert np.asarray(lines["left"].get_ydata()) == pytest.approx([5.0, 7.0, 9.0, 11.0])
    dots = [line for line in axes.lines if line.get_marker() == "o" and np.size(line.get_ydata())]
    assert [float(np.asarray(line.get_ydata())[0]) for line in dots] == pytest.approx(
        [10.0, 20.0, 30.0, 40.0]
    )
    assert ends_of_iterations(axes) == [1.5, 3.5]


def test_arrows_show_where_legs_really_are_if_that_is_known() -> None:
    problem = make_problem()
    genome = Genome(problem, problem.base(make_capabilities()))
    axes = Figure().add_subplot()
    draw_lengths(axes, GENERATIONS, genome, JOINTS, mounts=("back", "left", "left", "front"))
    assert [line.get_marker() for line in axes.lines[:4]] == ["v", "<", "s", "^"]


def test_eight_legs_have_eight_colours_and_eight_markers() -> None:
    parts = "".join(
        f"""
[[parts]]
name = "leg {number}"
parent = 0
mount = "left"
hinge = "up"
length = [0.05, 0.25]
radius = 0.006
motor = {number}
"""
        for number in range(1, 9)
    )
    head = PROBLEM.partition("[[parts]]")[0].replace("[1, 2, 3, 4]", '"all"')
    genome = Genome(Problem.parse(head + parts, "test"), make_problem().base(make_capabilities()))
    names = ["$\\frac{", "_hidden", "a\x1b[31m", *"defgh"]
    generations = [replace(item, best=(0.5,) * 8) for item in GENERATIONS]
    _, axes = new_axes()
    draw_lengths(axes, generations, genome, names)
    lines = axes.lines[:8]
    assert [line.get_label() for line in lines] == ["$\\frac{", " _hidden", r"a\x1b[31m", *"defgh"]
    assert len({line.get_color() for line in lines}) == 8
    assert len({line.get_marker() for line in lines}) == 8


def test_all_models_invalid_is_still_a_plot() -> None:
    assert as_png(plot_errors(history((float("inf"),), (float("inf"),)))).startswith(PNG)


def test_a_drawing_for_a_page_has_its_text_and_is_the_same_each_time() -> None:
    one, two = (as_svg(plot_errors(GENERATIONS)) for _ in range(2))
    assert one == two
    assert one.startswith("<svg")
    assert ">subjective error of each model</text>" in one


def test_ctrl_c_waits_until_the_library_is_loaded() -> None:
    code = """
import os, signal, sys
class Interruption:
    def find_spec(self, name, path=None, target=None):
        if name == "matplotlib.backends":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interruption())
from estimator.report.canvas import as_png, new_axes
try:
    new_axes()
except KeyboardInterrupt:
    assert as_png(new_axes()[0])
    print("interrupted")
"""
    ended = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert ended.stdout == "interrupted\n"


FOUR = ("left", "front", "right", "back")


@pytest.mark.parametrize("legs", [8, 24])
@pytest.mark.parametrize("sides", [FOUR, ("left",), ("port bow",)])
def test_each_leg_has_a_colour_and_a_marker_of_its_own(legs: int, sides: tuple[str, ...]) -> None:
    where = [sides[leg % len(sides)] for leg in range(legs)]
    assert len(set(leg_markers(where))) == legs
    colours = np.array(
        [[int(leg_colour(leg)[at : at + 2], 16) for at in (1, 3, 5)] for leg in range(legs)]
    )
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=-1)
    assert apart[~np.eye(legs, dtype=bool)].min() > 20


def test_legs_on_the_papers_four_sides_have_its_arrows() -> None:
    assert leg_markers(FOUR) == ["<", "^", ">", "v"]
    assert leg_markers(["back", "left", "left", "front"]) == ["v", "<", "s", "^"]


@pytest.mark.parametrize("name", ["hexapod-12", "hexapod-18"])
def test_each_leg_of_a_hexapod_is_drawn(name: str) -> None:
    problem = Problem.load(name)
    robot = replace(make_capabilities(), base_size=(0.24, 0.12, 0.06), base_mass=0.8)
    genome = Genome(problem, problem.base(robot))
    genes = genome.permitted(np.random.default_rng(1).random((3, genome.size)))
    posterior = make_posterior(problem, robot, genes, best=genes[0])
    names = [f"joint {number}" for number in range(1, len(problem.parts) + 1)]
    figure = plot_interval_lengths([posterior, posterior], names, [0.1] * len(names))
    (axes,) = figure.axes
    assert as_png(figure)
    _, labels = axes.get_legend_handles_labels()
    assert sorted(labels) == sorted([*names, "true length"])
