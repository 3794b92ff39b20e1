"""Each row of the table does what its sentence says, to the readings that statics computes."""

from __future__ import annotations

import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from estimator.body.arrays import ACCELEROMETER, Bodies
from estimator.body.morphology import BASE, Array, Base, Morphology, Part
from estimator.errors import EstimatorError
from estimator.parameters.changeable_rows import changeable_rows_of
from estimator.parameters.instruments import as_sensed, performed
from estimator.parameters.rows import packages, table_of
from estimator.parameters.table import (
    DEVIATES,
    MISWIRED,
    WIRING,
    Parameter,
    applied,
    deviating,
    prior_probabilities,
)
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import PredictedReadings
from tests.docs.pages import page
from tests.estimator.outside_package import install, put_on_path
from tests.estimator.two_unknown_rows import programs

KNOWN = Problem.load("parametric")
TABLE = {one.name: one for one in table_of(KNOWN.outlines, KNOWN.sensors)}
LENGTHS = np.array([[0.5, 0.62, 0.41, 0.55, 0.71, 0.48, 0.66, 0.59]])
MOVED = np.pad(programs(40, seed=3), ((0, 0), (0, 4)))
SEVERAL = np.random.default_rng(5).uniform(0.1, 0.9, (8, 8))
EVERYWHERE = (np.repeat(np.arange(8), 40), np.tile(MOVED, (8, 1)))
((A_ROW, ITS_TABLE),) = re.findall(
    r"```python\n([^`]*?of_cables[^`]*)```.*?```toml\n(.*?)```", page("extending"), re.DOTALL
)
"""The package that ``docs/extending.md`` shows."""


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    genome = Genome(KNOWN, Base(size=(0.14, 0.14, 0.085), mass=1.0))
    return Predictor(Unknowns(genome), StaticsPhysics())


def read(predictor: Predictor, bodies: Bodies, moved: Array = MOVED) -> PredictedReadings:
    return predictor.read(bodies, np.zeros(len(moved), dtype=np.intp), moved)


def same(one: PredictedReadings, other: PredictedReadings) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("tilt", "clearance", "touch")
    )


def changed(predictor: Predictor, name: str, amount: float = 1.0) -> PredictedReadings:
    return read(predictor, TABLE[name].applied(predictor.unknowns.bodies(LENGTHS), amount))


@pytest.mark.parametrize("name", TABLE)
def test_every_row_can_be_felt_and_by_no_amount_is_nothing(predictor: Predictor, name: str) -> None:
    row, bodies = TABLE[name], predictor.unknowns.bodies(SEVERAL)
    before = predictor.read(bodies, *EVERYWHERE)
    if not row.name.endswith("about the leftward direction"):  # there hinges are turned about it
        assert any(
            not same(before, predictor.read(row.applied(bodies, amount), *EVERYWHERE))
            for amount in row.amounts(row.wide or row.narrow, np.array([-2.0, 2.0]))
        )
    assert same(before, predictor.read(bodies, *EVERYWHERE))  # the bodies are left as they were
    stated = row.applied(bodies, 1.0 if row.factor else 0.0)
    assert same(before, predictor.read(stated, *EVERYWHERE))
    assert row.check
    assert "{" not in row.said(1.25, (1.0, 1.5))


def test_thicker_parts_are_as_heavy_and_heavier_ones_as_thick(predictor: Predictor) -> None:
    bodies = predictor.unknowns.bodies(LENGTHS)
    thick = TABLE["thickness of all parts"].applied(bodies, 2.0)
    assert np.allclose(thick.radius**2 * thick.density, bodies.radius**2 * bodies.density)
    heavy = TABLE["mass of left upper"].applied(bodies, 3.0)
    assert np.array_equal(heavy.radius, bodies.radius)
    assert (heavy.density / bodies.density).tolist() == [[3, 1, 1, 1, 1, 1, 1, 1]]


def test_servos_that_turn_too_far_or_the_other_way_do_what_another_program_asks(
    predictor: Predictor,
) -> None:
    bodies = predictor.unknowns.bodies(LENGTHS)
    for name, amount, factors in (
        ("travel of all servos", 1.2, [1.2] * 8),
        ("travel of front upper", 0.5, [1.0, 0.5, *[1.0] * 6]),
        ("servo of right upper reversed", 1.0, [1.0, 1.0, -1.0, *[1.0] * 5]),
    ):
        assert same(changed(predictor, name, amount), read(predictor, bodies, MOVED * factors))
    swapped = MOVED[:, [1, 0, 2, 3, 4, 5, 6, 7]]
    exchanged = changed(predictor, "plugs of left upper and front upper exchanged")
    assert same(exchanged, read(predictor, bodies, swapped))


@pytest.mark.parametrize("short", [2.0, -2.0])
def test_servos_that_stop_short_do_so_on_their_way_from_0(
    predictor: Predictor, short: float
) -> None:
    bodies = predictor.unknowns.bodies(LENGTHS)
    shorter = TABLE["where all servos stop"].applied(bodies, math.radians(short))
    told = np.array([[20.0, -20.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    reached = [[20 - short, short - 20, 0 if short > 0 else 2, 0, 0, 0, 0, 0]]
    assert np.degrees(performed(np.radians(told), shorter)) == pytest.approx(np.array(reached))
    reads = read(predictor, bodies, performed(MOVED, shorter[np.zeros(40, dtype=int)]))
    assert same(read(predictor, shorter), reads)


def test_a_jammed_servo_stays_where_it_is(predictor: Predictor) -> None:
    still = MOVED.copy()
    still[:, 0] = 0.2
    bodies = predictor.unknowns.bodies(LENGTHS)
    jammed, held = (
        changed(predictor, "servo of left upper jammed", 0.2),
        read(predictor, bodies, still),
    )
    close = np.abs(jammed.tilt - held.tilt).max(axis=1) < 1e-6
    assert close.mean() > 0.9  # on the way others may have fallen to another side


def test_a_part_that_hangs_lies_on_the_ground_with_what_it_carries(predictor: Predictor) -> None:
    bodies = predictor.unknowns.bodies(LENGTHS)
    limp = TABLE["servo of left upper dead"].applied(bodies)
    assert np.flatnonzero(limp.limp[0]).tolist() == [0, 4]
    assert np.flatnonzero(limp.length[0] < 0.1 * bodies.length[0]).tolist() == [0, 4]
    assert read(predictor, limp).touch[:, 0].all()


def test_gauges(predictor: Predictor) -> None:
    before = read(predictor, predictor.unknowns.bodies(LENGTHS))
    assert not changed(predictor, "touch sensor 4 dead").touch[:, 3].any()
    assert changed(predictor, "touch sensor 4 stuck on").touch[:, 3].all()
    exchanged = changed(predictor, "plugs of touch sensors 1 and 3 exchanged")
    assert np.array_equal(exchanged.touch, before.touch[:, [2, 1, 0, 3]])


def test_an_accelerometer_that_lies_otherwise_feels_other_tilts(predictor: Predictor) -> None:
    left, forward = read(predictor, predictor.unknowns.bodies(LENGTHS)).tilt.T
    for name, amount, expected in (
        ("left/right tilt reversed", 1.0, (-left, forward)),
        ("forward/back tilt reversed", 1.0, (left, -forward)),
        ("accelerometer's axes exchanged", 1.0, (forward, left)),
        ("accelerometer by half a turn", 1.0, (-left, -forward)),
        # the board's own leftward direction now points backward
        ("accelerometer by a quarter turn leftward", 1.0, (-forward, left)),
        ("accelerometer by a quarter turn rightward", 1.0, (forward, -left)),
        ("accelerometer's turn about the vertical", math.pi / 2, (-forward, left)),
    ):
        felt = changed(predictor, name, amount).tilt.T
        assert np.allclose(felt, expected, atol=1e-9), name
    gained = changed(predictor, "accelerometer's gain", 1.1).tilt
    assert np.allclose(np.sin(gained), 1.1 * np.sin(np.column_stack([left, forward])))


def test_a_flat_robot_reads_its_accelerometers_own_tilt_and_sloping_ground_is_no_other_thing(
    predictor: Predictor,
) -> None:
    row = TABLE["accelerometer's own tilt, left/right"]
    flat = read(predictor, row.applied(predictor.unknowns.bodies(LENGTHS), 0.1), np.zeros((1, 8)))
    assert flat.tilt[0].tolist() == pytest.approx([0.1, 0.0])
    assert "ground that rises so to the left" in row.said(0.1)


def test_distances(predictor: Predictor) -> None:
    bodies = predictor.unknowns.bodies(LENGTHS)
    before = read(predictor, bodies)
    for offset in (0.01, -0.5):  # where the belly lies on the ground a reading may be below 0
        moved = changed(predictor, "distance sensor's offset", offset)
        assert np.allclose(
            moved.clearance, before.clearance + np.where(before.saturated, 0, offset)
        )
    farther = changed(predictor, "distance sensor's gain", 1.5)
    assert np.allclose(farther.clearance, before.clearance * np.where(before.saturated, 1, 1.5))
    far = TABLE["distance sensor's gain"].applied(bodies, 2.0)[np.zeros(40, dtype=np.intp)]
    assert np.array_equal(as_sensed(before, far).saturated, before.saturated)


def test_many_bodies_each_by_its_own_columns(predictor: Predictor) -> None:
    rows = tuple(TABLE.values())
    deviations = np.zeros((len(rows), len(rows)))
    np.fill_diagonal(deviations, [1.0 if one.switch else one.wide or one.narrow for one in rows])
    bodies = predictor.unknowns.bodies(np.repeat(LENGTHS, len(rows), axis=0))
    together = predictor.read(
        applied(rows, bodies, deviations), np.arange(len(rows)), np.tile(MOVED[7], (len(rows), 1))
    )
    for number, row in enumerate(rows):
        amount = row.amounts(1.0, deviations[[number], [number]])
        alone = predictor.read(
            row.applied(bodies[number : number + 1], amount), np.zeros(1, int), MOVED[[7]]
        )
        assert np.array_equal(together.tilt[number], alone.tilt[0]), row.name
        assert np.array_equal(together.touch[number], alone.touch[0]), row.name
    assert applied((), bodies, np.empty((len(rows), 0))) is bodies


@pytest.mark.parametrize("name", ["parametric", "topological"])
def test_what_a_search_takes_for_granted_is_as_if_each_point_had_it(name: str) -> None:
    problem = Problem.load(name)
    unknowns = Unknowns(Genome(problem, Base(size=(0.14, 0.14, 0.085), mass=1.0)), problem.table)
    genes = np.random.default_rng(7).uniform(0, 1, (5, unknowns.genes_size))
    for number, row in enumerate(problem.table):
        deviations = np.zeros(len(problem.table))
        deviations[number] = 1.0 if row.switch else row.wide or row.narrow
        taken = unknowns.with_fixed_deviations(deviations).bodies(genes)
        each = unknowns.bodies(unknowns.with_deviations(genes, deviations))
        for item in fields(Bodies):
            assert np.array_equal(getattr(taken, item.name), getattr(each, item.name)), row.name


def test_one_robot_in_twenty_is_built_otherwise_and_as_many_are_miswired() -> None:
    *of_rows, none = prior_probabilities(tuple(TABLE.values())).tolist()
    priors = dict(zip(TABLE, of_rows, strict=True))
    wiring = [name for name, row in TABLE.items() if row.group in WIRING]
    assert sum(priors[name] for name in wiring) == pytest.approx(MISWIRED)
    assert 1 - none == pytest.approx(sum(of_rows)) == pytest.approx(DEVIATES + MISWIRED)
    hinges = [prior for name, prior in priors.items() if name.startswith("hinge of")]
    assert sum(hinges) == pytest.approx(priors["thickness of all parts"])
    assert priors["mass of all parts"] == 0  # its narrow component is wide enough


def test_what_repeats_an_open_choice_has_no_row() -> None:
    unknown = Problem.load("topological")
    names = {one.name for one in table_of(unknown.outlines, unknown.sensors)}
    assert not any("reversed" in name or "plugs of leg" in name for name in names)
    assert not any("axes exchanged" in name or "quarter turn" in name for name in names)
    assert any("plugs of touch sensors" in name for name in names)
    table = table_of(unknown.outlines, unknown.sensors)
    gauges = ["plugs of touch sensors" in one.name for one in table]
    assert prior_probabilities(table)[:-1][gauges].sum() == pytest.approx(MISWIRED / len(WIRING))


def test_of_alike_parts_that_sit_anywhere_and_turn_with_others_gauges_are_not_exchanged() -> None:
    unknown = Problem.load("topological-20")
    rows = table_of(unknown.outlines, unknown.sensors)
    assert not any("plugs of touch sensors" in row.name for row in rows)
    assert any("touch sensor 4 dead" in row.name for row in rows)
    *others, last = unknown.outlines
    thicker = [*others, replace(last, radius=0.01)]
    names = [row.name for row in table_of(thicker, unknown.sensors) if "plugs of" in row.name]
    assert names == [f"plugs of touch sensors {gauge} and 4 exchanged" for gauge in (1, 2, 3)]
    own = [replace(part, parent=number) for number, part in enumerate(others[4:])]
    names = [row.name for row in table_of([*others[:4], *own, last], unknown.sensors)]
    assert sum("plugs of touch sensors" in name for name in names) == 6


def test_what_strays_farther_than_robots_as_people_build_them_deviates() -> None:
    rows = tuple(TABLE.values())
    deviations = np.zeros((4, len(rows)))
    at = {name: place for place, name in enumerate(TABLE)}
    reversed_, zero = at["servo of left upper reversed"], at["zero of left upper"]
    deviations[1, reversed_] = 1.0
    deviations[2:, zero] = rows[zero].narrow * np.array([2.0, 10.0])
    assert deviating(rows, deviations).tolist() == [-1, reversed_, -1, zero]
    assert deviating((), np.empty((2, 0))).tolist() == [-1, -1]


def test_sentences_have_an_amount_and_its_interval() -> None:
    assert TABLE["mass of all parts"].said(2.5, (1.4, 4.4)) == "parts 2.5 times as heavy [1.4–4.4]"
    turned = TABLE["hinge of left upper about the vertical"]
    assert turned.said(math.radians(27), (math.radians(23), math.radians(31))) == (
        "the hinge of left upper turned by +27° about the vertical [+23–+31]"
    )
    assert TABLE["servo of left upper dead"].said(1.0) == "the servo of left upper dead"


def test_a_package_adds_a_row(
    predictor: Predictor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = re.sub(r'project\.entry-points\.|"', "", ITS_TABLE)
    put_on_path(install(tmp_path / "my", points, name="my-cables", code=A_ROW), monkeypatch)
    assert packages() == {"my-cables": "0.3"}
    problem = Problem.parse(f"{KNOWN.source}\n[uncertain]\ncable_deg = 2.0\n", "mine.toml")
    rows: dict[str, Parameter] = {one.name: one for one in problem.table}
    assert rows["cable of left upper"].narrow == pytest.approx(math.radians(2.0), rel=1e-3)
    bodies = predictor.unknowns.bodies(LENGTHS)
    pulled = rows["cable of left upper"].applied(bodies, 0.1)
    assert same(read(predictor, pulled), changed(predictor, "zero of left upper", 0.1))
    assert pulled.base[0, ACCELEROMETER] == 0


@pytest.mark.parametrize(
    ("given", "named"), [("None", "None"), ("[3]", "3"), ("{'cable': 1}", "'cable'")]
)
def test_what_a_package_gives_that_is_no_row_is_refused(
    given: str, named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = "[bodyschema.parameters]\ncables = my_cables:rows\n"
    code = f"def rows(parts, sensors):\n    return {given}\n"
    put_on_path(install(tmp_path / "my", points, name="my-cables", code=code), monkeypatch)
    sentence = f"the table of parameters 'cables' of my-cables 0.3 gave {named}: it must give"
    with pytest.raises(EstimatorError, match=re.escape(sentence)):
        assert Problem.load("parametric").table


def test_a_leg_that_breaks_off_takes_what_it_carries_along() -> None:
    hip = Part(parent=BASE, mount=0, hinge=2, length=0.12, radius=0.008, motor=0)
    knee = Part(parent=0, mount=1, hinge=2, length=0.1, radius=0.008, motor=1, sensor=0)
    other = replace(hip, mount=2, motor=2, sensor=1)
    body = Morphology(
        base=Base(size=(0.14, 0.14, 0.06), mass=0.6), parts=(hip, knee, other), density=1000.0
    )
    rows = changeable_rows_of(body, ["hip", "knee", "other"], ["thigh", "shin", "leg"])
    (broken,) = (row for row in rows if row.name == "the leg of hip broken off")
    gone = broken.applied(Bodies.of([body]), np.array([0.5]))
    assert gone.length[0].tolist() == pytest.approx([0.06, 0.002, 0.12])
    assert gone.stuck[0].tolist() == [-1, -1, 0]
