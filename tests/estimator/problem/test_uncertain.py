"""What a problem says of how well its robot is known."""

from __future__ import annotations

import math
import re

import pytest

from estimator.errors import ProblemError
from estimator.problem.problem import Problem
from tests.docs.pages import section


def problem(section: str) -> Problem:
    return Problem.parse(
        f"{Problem.load('parametric').source}\n[uncertain]\n{section}\n", "mine.toml"
    )


def narrow(section: str) -> dict[str, float]:
    return {row.name: row.narrow for row in problem(section).table}


def test_robots_are_as_people_build_them_where_nothing_is_said() -> None:
    rows = {row.name: row.narrow for row in Problem.load("parametric").table}
    assert rows["thickness of all parts"] == 0.25
    assert rows["zero of left upper"] == pytest.approx(math.radians(0.4))
    assert narrow("") == rows


def test_a_group_is_widened_or_closed_in_the_unit_of_its_sentence() -> None:
    rows = narrow("zero_deg = 2.0\nthickness = 0\nservo_dead = 0\ndistance_mm = 1.5")
    assert rows["zero of left upper"] == pytest.approx(math.radians(2.0))
    assert rows["distance sensor's offset"] == pytest.approx(0.0015)
    assert "thickness of all parts" not in rows
    assert not any(name.endswith("dead") and "servo" in name for name in rows)
    assert not problem("exact = true").table


def test_only_a_doubtful_accelerometer_is_read_lying_flat() -> None:
    assert problem("accelerometer_deg = 2.0").reads_flat_first
    assert not problem("accelerometer_deg = 0.2").reads_flat_first
    assert not Problem.load("parametric").reads_flat_first


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("thicknes = 0.1", "thicknes: is nothing that may be otherwise on this robot: name some"),
        ("servo_dead = 1.0", "servo_dead: either is so or is not: write 0 where it is sure"),
        ("zero_deg = -1.0", "zero_deg: must lie in 0 to 100 of its unit, not -1"),
        ("zero_deg = inf", "zero_deg: must be finite, not inf"),
    ],
)
def test_what_cannot_be_is_a_sentence(line: str, sentence: str) -> None:
    with pytest.raises(ProblemError) as caught:
        problem(line)
    assert sentence in str(caught.value)


def test_the_page_has_all_that_may_be_otherwise_and_how_far() -> None:
    rows = {
        name: cells
        for names, *cells in re.findall(
            r"^\| (`.+) \| .+ \| (.+) \| (.+) \|$",
            section("problems", "How well the robot is known"),
            re.MULTILINE,
        )
        for name in re.findall(r"`(\w+)`", names)
    }
    table = {row.group: row for row in Problem.load("parametric").table}
    assert rows.keys() == table.keys()
    for group, (narrow, wide) in rows.items():
        row = table[group]
        assert number(narrow) == pytest.approx(row.narrow * row.unit)
        assert (wide == "yes or no") == row.switch
        assert row.switch or number(wide) == pytest.approx(row.wide * row.unit)


def number(cell: str) -> float:
    """A standard deviation of the page; – stands for 0."""
    return 0.0 if cell == "–" else float(cell.removesuffix("°").removesuffix(" mm"))
