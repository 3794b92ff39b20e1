"""Mounts and hinges of a problem's own: what genes choose from, and which choices are forbidden."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from estimator.body.morphology import BASE, Base
from estimator.errors import ProblemError
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from tests.estimator.problem.test_topological import robot

HEAD = """
name = "walker"
description = "Two legs, two shanks."
density = 1000.0
share_mounts = false

[motors]
driven = [1, 2, 3, 4]
range_deg = [-30.0, 30.0]
slew_deg_per_s = 60.0

[search]
population = 10
generations = 1
interactions = 1

[[mounts]]
name = "left hip"
at = [0.0, 0.05, 0.01]
yaw_deg = 30.0

[[mounts]]
name = "right hip"
at = [0.0, -0.05, 0.01]
yaw_deg = -30.0

[[mounts]]
name = "end"
at = 1.0
yaw_deg = 0.0

[[hinges]]
name = "lift"
axis = [0, -2, 0]

[[hinges]]
name = "aslant"
axis = [0, -1, 1]
"""
PART = """
[[parts]]
name = "{name}"
parent = "unknown"
mount = "unknown"
hinge = "unknown"
length = [0.05, 0.20]
radius = 0.006
motor = {motor}
"""
FIRST = PART.format(name="a", motor=1)
UNKNOWN = HEAD + "".join(
    PART.format(name=name, motor=motor) for motor, name in enumerate("abcd", 1)
)


def genome_of(problem: Problem) -> Genome:
    size = (0.1, 0.1, 0.05)
    return Genome(problem, Base(size=size, mass=1.0, mounts=problem.tables.base_mounts(size)))


def test_a_mount_is_one_of_the_chosen_parents() -> None:
    genome = genome_of(Problem.parse(UNKNOWN, "walker.toml"))
    columns = {gene.name: column for column, gene in enumerate(genome.genes)}
    genes = np.full((2, genome.size), 0.1)
    genes[:, columns["mount of b"]] = 0.9
    genes[1, columns["parent of b"]] = 0.9
    on_base, on_part = genome.decode_all(genes)
    assert (on_base.parts[1].parent, on_base.mount(1).name) == (BASE, "right hip")
    assert (on_part.parts[1].parent, on_part.mount(1).name) == (0, "end")
    assert genome.words(columns["mount of b"], genes) == ("right hip", "end")
    assert genome.words(columns["parent of b"], genes) == ("main body", "a")
    assert genome.words(columns["hinge of b"], genes) == ("lift", "lift")
    arrays = genome.bodies(genes)
    assert arrays.base_mounts[arrays.mount[0, 1], :3].tolist() == [0.0, -0.05, 0.01]
    assert arrays.part_mounts[arrays.mount[1, 1]].tolist() == [1.0, 1.0, 0.0, 1.0, 0.0]
    assert on_base.hinges[1].axis == pytest.approx((0, -math.sqrt(0.5), math.sqrt(0.5)))


def test_doubles_are_forbidden_and_spread_over_free_mounts() -> None:
    genome = genome_of(Problem.parse(UNKNOWN, "walker.toml"))
    genes = np.random.default_rng(1).random((500, genome.size))
    before = genome.forbidden(genes)
    doubled = [
        len({(part.parent, part.mount) for part in body.parts}) < 4
        for body in genome.decode_all(genes)
    ]
    assert before.tolist() == doubled
    assert 0.5 < before.mean() < 1
    spread = genome.permitted(genes)
    assert not genome.forbidden(spread).any()
    assert np.array_equal(spread[~before], genes[~before])
    lengths = [gene.trait == "length" for gene in genome.genes]
    assert np.array_equal(spread[:, lengths], genes[:, lengths])


def test_shared_mounts_are_the_default() -> None:
    shared = UNKNOWN.replace("share_mounts = false\n", "")
    genome = genome_of(Problem.parse(shared, "walker.toml"))
    assert not genome.forbidden(np.zeros((3, genome.size))).any()


CROSSED = (
    HEAD[: HEAD.index("[[mounts]]")].replace("[1, 2, 3, 4]", "[1, 2]")
    + FIRST.replace('parent = "unknown"', "parent = 0")
    + PART.format(name="b", motor=2).replace('parent = "unknown"', "parent = 1")
    + re.sub("motor.*", "", PART.format(name="c", motor=3)).replace(
        'mount = "unknown"', 'mount = "front"'
    )
)
"""Each draw of places leaves others: c has some that only a has as well, and some that only b."""


@pytest.mark.parametrize(
    ("text", "exact"),
    [(UNKNOWN, True), (UNKNOWN.replace("share_mounts = false", ""), True), (CROSSED, False)],
)
def test_ways_to_attach_the_parts_are_those_of_all_bodies(text: str, exact: bool) -> None:
    problem = Problem.parse(text, "walker.toml")
    genome = genome_of(problem)
    choices = [(np.arange(gene.choices or 1) + 0.5) / (gene.choices or 1) for gene in genome.genes]
    genes = np.stack(np.meshgrid(*choices), axis=-1).reshape(-1, genome.size)
    bodies = genome.decode_all(genes[~genome.forbidden(genes)])
    attached = {
        tuple((part.parent, part.mount, part.hinge * (part.motor is not None)) for part in parts)
        for parts in (body.parts for body in bodies)
    }
    ways = genome.ways(np.random.default_rng(0))
    assert ways.exact == exact
    assert ways.number == pytest.approx(len(attached), rel=0 if exact else 0.03)


def test_places_and_axes_of_a_parts_own() -> None:
    own = FIRST.replace('parent = "unknown"\nmount = "unknown"', "parent = 0\n{place}")
    own = own.replace('hinge = "unknown"', "axis = [3, 0, 4]").replace('name = "a"', 'name = "own"')
    text = HEAD.replace("[1, 2, 3, 4]", "[1]") + own.format(
        place="at = [0.02, 0.03, -0.01]\nyaw_deg = 135"
    )
    problem = Problem.parse(text, "own.toml")
    genome = genome_of(problem)
    body = genome.decode(np.zeros(genome.size))
    assert [gene.name for gene in genome.genes] == ["length of own"]
    assert body.place(0) == (0.02, 0.03, -0.01)
    assert body.mount(0).yaw == pytest.approx(math.radians(135))
    assert body.hinge(0).axis == pytest.approx((0.6, 0.0, 0.8))
    again = text.replace(
        "at = [0.02, 0.03, -0.01]\nyaw_deg = 135", "at = [0, 0.05, 0.01]\nyaw_deg = 30"
    )
    body = genome_of(Problem.parse(again, "own.toml")).decode(np.zeros(1))
    assert body.mount(0).name == "left hip"


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('mount = "unknown"', 'mount = "hip"', r"parts.1..mount .a.: on .*'right hip', 'unknown'"),
        ('mount = "unknown"', 'mount = "left hip"', r"parts.2..mount .b.: on a part, .*'end', 'u"),
        (
            'hinge = "unknown"',
            'hinge = "up"',
            r"parts.1..hinge .a.: .* 'lift', 'aslant', 'unknown'",
        ),
        ('mount = "unknown"', "", r"parts.1. .a.: give either mount"),
        ('mount = "unknown"', "at = 0.5", r"parts.1. .a.: give either mount"),
        ('mount = "unknown"', "at = 0.5\nyaw_deg = 0", r"parts.1..at .a.: .* known parent"),
        ("axis = [0, -2, 0]", "axis = [0, 0, 0]", r"hinges.1..axis .lift.: .*has length zero"),
        ("axis = [0, -2, 0]", "axis = [0, 1]", r"hinges.1..axis .lift.: must be .x, y, z."),
        ("at = 1.0", "at = 1.5", r"mounts.3..at .end.: must be a point .* fraction"),
        ("at = [0.0, 0.05, 0.01]", "at = [0, 50, 10]", r"mounts.1..at .left hip.: .* within 10 m"),
        ("yaw_deg = 30.0", 'yaw_deg = "left"', r"mounts.1..yaw_deg .left hip.: must be a number"),
        ('name = "right hip"', 'name = "left hip"', "mounts: 'left hip' is no name of its own"),
        ("share_mounts = false", 'share_mounts = "no"', "share_mounts: "),
    ],
)
def test_wrong_tables_are_refused(old: str, new: str, reason: str) -> None:
    assert old in UNKNOWN
    text = UNKNOWN.replace(old, new, 2 if "left hip" in new and "mount" in old else 1)
    with pytest.raises(ProblemError, match=f"^walker.toml: .*{reason}"):
        Problem.parse(text, "walker.toml")


def test_two_parts_on_a_forbidden_mount_are_refused() -> None:
    known = UNKNOWN.replace(
        'parent = "unknown"\nmount = "unknown"', 'parent = 0\nmount = "left hip"'
    )
    with pytest.raises(
        ProblemError,
        match=r"parts.2..mount .b.: a sits there already, on left hip of the main body",
    ):
        Problem.parse(known, "walker.toml")
    crowded = UNKNOWN.replace('parent = "unknown"', "parent = 0")
    with pytest.raises(ProblemError, match="share_mounts: a, b, c may sit on only 2 mounts"):
        Problem.parse(crowded, "walker.toml")


def test_a_part_of_unknown_parent_without_a_mount_is_refused() -> None:
    text = UNKNOWN.replace('mount = "unknown"', 'mount = "left hip"', 1).replace(
        'parent = "unknown"\nmount = "unknown"', 'parent = 0\nmount = "left hip"', 1
    )
    with pytest.raises(ProblemError, match="share_mounts: a, b may sit on only 1 mount: add"):
        Problem.parse(text, "walker.toml")


@pytest.mark.parametrize("mounts", [1, 3, 12])
def test_a_file_for_any_robot_need_not_suit_the_papers(mounts: int) -> None:
    head, _, rest = HEAD.partition("[[mounts]]")
    own = "".join(
        f'[[mounts]]\nname = "{number}"\nat = [0.0, 0.05, 0.0]\nyaw_deg = {number}.0\n'
        for number in range(mounts)
    )
    _, _, hinges = rest.partition("[[hinges]]")
    part = FIRST.replace("motor = 1", 'each = "driven"').replace('parent = "unknown"', "parent = 0")
    text = head.replace("[1, 2, 3, 4]", '"all"') + own + "[[hinges]]" + hinges + part
    problem = Problem.parse(text, "mine.toml")
    assert len(problem.parts) == min(mounts, 8)
    assert len(problem.for_robot(robot(mounts, 0)).parts) == mounts
    with pytest.raises(ProblemError, match=f"may sit on only {mounts} mount"):
        problem.for_robot(robot(mounts + 1, 0))
    with pytest.raises(ProblemError, match=r"mine\.toml: parts\[1\]\.hinge"):  # suits no robot
        Problem.parse(text.replace('hinge = "unknown"', 'hinge = "none"'), "mine.toml")
