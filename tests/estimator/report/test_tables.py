"""What a terminal says of a posterior, a score and a validation."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from rich.console import Console

from estimator.evaluation.attachments import Configuration
from estimator.evaluation.score import Score
from estimator.evaluation.validate import PredictionErrors, Validation
from estimator.posterior.fitted import FittedPosterior
from estimator.report.evaluations import print_score, print_validation
from estimator.report.outcome import headline, print_result
from estimator.report.page.run_page import run_page
from estimator.report.posterior_report import posterior_report, sums_of_lengths
from estimator.report.summarise import summarise
from estimator.report.tables import as_stated_in_words
from estimator.storage.posteriors import (
    Interval,
    NextMovement,
    PredictedInteraction,
    StoredMode,
)
from estimator.storage.store import RunStore
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import PROBLEM, TRUE_LENGTHS, make_capabilities
from tests.estimator.posterior_run import make_posterior_run
from tests.estimator.report.made_runs import capabilities_with, made_run

UP = 2.5 / 6


def rival(hinge: float, *, indistinguishable: bool) -> StoredMode:
    genes = (0.5, 0.5, 0.5, hinge, 0.5)
    return StoredMode(
        probability=0.125,
        ess=50.0,
        genes=genes,
        indistinguishable=indistinguishable,
        found=(True, True),
    )


def test_rivals_come_with_the_movement_that_would_decide(tmp_path: Path) -> None:
    movement = NextMovement(
        program=(0.0, 0.0, 0.1, -0.5), reason="tells apart: hinge of back (up or down)", bits=0.8
    )
    rivals = [rival(3.5 / 6, indistinguishable=False), rival(4.5 / 6, indistinguishable=True)]
    lengths = [TRUE_LENGTHS] * 3
    with make_posterior_run(
        tmp_path, lengths, hinge=UP, rivals=rivals, next_movement=movement
    ) as run:
        result = summarise(run)
    text = io.StringIO()
    print_result(Console(file=text, width=200), result, details=True)
    said = text.getvalue()
    assert "Rival (12.5 %): hinge of back: down." in said
    assert "Indistinguishable (12.5 %): hinge of back: roll_left." in said
    assert (
        "Most informative next movement: right to +6°, back to -29°; tells apart: "
        "hinge of back (up or down); it is expected to rule out 43 % of the possibilities." in said
    )
    assert result.posterior is not None
    assert result.posterior.next_movement == movement
    assert all(leg.population_m is None for leg in result.legs)


def test_residuals_are_in_a_table(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        result = summarise(run)
    assert result.posterior is not None
    told = PredictedInteraction(
        touch=(True,) * 4,
        tilt=(0.1, 0.0),
        clearance=0.02,
        residuals={"touch": 0.0, "tilt": -1.26, "clearance": 12.0},
        outlier_probability=0.97,
    )
    not_read = told.model_copy(update={"residuals": {"tilt": 0.5}})
    posterior = result.posterior.model_copy(update={"predicted": (told, not_read)})
    text = io.StringIO()
    print_result(
        Console(file=text, width=200),
        result.model_copy(update={"posterior": posterior}),
        details=True,
    )
    _, _, table = text.getvalue().partition("in standard deviations of the noise:\n")
    heading, row, other, *_ = (line.split() for line in table.splitlines())
    assert heading == ["interaction", "touch", "tilt", "clearance", "outlier"]
    assert row == ["1", "+0.0", "-1.3", "+12.0", "97.0", "%"]
    assert other == ["2", "–", "+0.5", "–", "97.0", "%"]


def test_that_the_robot_may_be_built_otherwise_is_taken_off_and_said(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=UP, misspecified=0.04) as run:
        result = summarise(run)
        page, _ = run_page(run, result)
    text = io.StringIO()
    print_result(Console(file=text, width=200), result, details=True)
    said = (
        "attachments together is 72.0 %; the probability that the robot is otherwise than this "
        "problem can say, 4.0 %."
    )
    assert said in text.getvalue()
    assert said in page


def test_lengths_of_a_robot_as_stated_are_those_of_the_best_attachments(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=UP, misspecified=0.04) as run:
        result = summarise(run)
    assert result.posterior is not None
    lengths = tuple(Interval(low=0.1, median=0.1, high=0.12) for _ in TRUE_LENGTHS)
    posterior = result.posterior.model_copy(update={"as_stated_m": lengths})
    assert as_stated_in_words(result, posterior).startswith(
        "If the robot is exactly as stated, and attached as the best body (72.0 %): left 100.0 ± 10"
    )


def test_noise_is_told_of_sensors_that_were_read(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        fitted = FittedPosterior.of(run)
        assert fitted is not None
        assert list(posterior_report(run, fitted).noise) == ["tilt", "clearance"]
        deaf = replace(fitted, modalities=("touch", "tilt"))
        assert list(posterior_report(run, deaf).noise) == ["tilt"]


def test_of_legs_in_line_the_sum_is_said_in_terminal_and_page(tmp_path: Path) -> None:
    """Where one grows as the other shrinks; the third is known by itself."""
    first, second, *others = TRUE_LENGTHS
    lengths = [(first + away, second - away, *others) for away in (-0.03, -0.01, 0.01, 0.03)]
    with make_posterior_run(tmp_path, lengths) as run:
        result = summarise(run)
        page, _ = run_page(run, result)
    assert result.posterior is not None
    (known,) = result.posterior.sums
    assert known.legs == (0, 1)
    assert known.length_m.median == pytest.approx(first + second)
    one, other = (leg.joint for leg in result.legs[:2])
    total = 1000 * (first + second)
    sentence = f"Of {one} and {other} the sum is known: {total:.1f} mm ({total:.1f}–{total:.1f})."
    text = io.StringIO()
    print_result(Console(file=text, width=200), result, details=True)
    assert sentence in text.getvalue()
    assert sentence in page


def test_sums_are_told_only_where_they_are_known_better() -> None:
    rng = np.random.default_rng(0)
    apart = rng.uniform(0.1, 0.2, (256, 2))
    shares = np.full(256, 1 / 256)
    assert sums_of_lengths(apart, shares) == ()
    narrow = 0.15 + 0.1 * (apart[:, :1] - 0.15) * [1, -1]  # each to ±5 mm already
    assert sums_of_lengths(narrow, shares) == ()
    assert len(sums_of_lengths(0.15 + (apart[:, :1] - 0.15) * [1, -1], shares)) == 1


def test_what_no_movement_could_tell_is_said(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=4.5 / 6) as run:
        result = summarise(run)
    assert result.posterior is not None
    assert result.posterior.equivalent == ("a servo of back that never moves feels like a roll",)


@pytest.mark.parametrize(("length", "told"), [(0.14, True), (0.16, False)])
def test_exchanged_tilts_feel_like_a_square_body_turned(
    tmp_path: Path, length: float, told: bool
) -> None:
    robot = replace(make_capabilities(), base_size=(length, 0.14, 0.03))
    lengths = [TRUE_LENGTHS] * 3
    with make_posterior_run(tmp_path, lengths, mount=7 / 8, robot=robot) as run:
        result = summarise(run)
    assert result.posterior is not None
    mirrored, *turned = result.posterior.equivalent
    assert "mirror image" in mirrored
    assert ["axes are exchanged" in one for one in turned] == [True] * told


def test_where_all_is_known_nothing_else_feels_so(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        result = summarise(run)
    assert result.posterior is not None
    assert result.posterior.equivalent == ()


def test_after_a_movement_nothing_may_be_known_or_explained(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=UP) as run:
        result = summarise(run)
        assert result.posterior is not None
        (step,) = result.posterior.steps
        doubted = step.model_copy(update={"probability": 0.99, "explained": False})
        unknown = step.model_copy(update={"probability": None})
        posterior = result.posterior.model_copy(
            update={
                "steps": (unknown, doubted, step),
                "coverage": 0.4,
            }
        )
        result = result.model_copy(update={"posterior": posterior})
        page, _ = run_page(run, result)
    text = io.StringIO()
    print_result(Console(file=text, width=200), result, details=True)
    for said in (text.getvalue(), page):
        assert said.count("not explained") == 1
        assert "99.0 %, not explained" in said
        assert "together is not known: the searches have found different bodies." in said
    assert page.count("<td>not known</td>") == 1


def test_a_radius_that_the_robot_states_otherwise_is_no_explanation(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, radius=0.013) as run:
        result = summarise(run)
    assert result.posterior is not None
    assert not result.posterior.explained
    assert result.posterior.verdict == (
        "THIS PROBLEM IS NOT THE ROBOT'S: the robot states a radius of 6.0 mm for left, and the "
        "problem 13.0 mm: write radius = 0.006 there, or its lengths will be wrong. Some body that "
        "this problem allows explains every interaction."
    )


def configuration(
    part: str, trait: str, found: str, *, right: bool, excused: bool
) -> Configuration:
    return Configuration(
        part=part,
        trait=trait,
        modelled=found,
        true="left",
        searched=(part, trait) != ("leg 1", "parent"),
        chance=0.25,
        right=right,
        right_up_to_equivalence=right or excused,
    )


def printed(score: Score) -> str:
    console = Console(file=StringIO(), width=120, color_system=None)
    print_score(console, score)
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def make_score(configurations: tuple[Configuration, ...]) -> Score:
    right = sum(item.right for item in configurations)
    excused = sum(item.right_up_to_equivalence for item in configurations)
    searched = [item for item in configurations if item.searched]
    return Score(
        joints=("hip",),
        true_lengths_m=(0.2,),
        lengths_m=(0.21,),
        leg_errors_m=(0.01,),
        leg_errors_signed_m=(0.01,),
        mean_leg_error_m=0.01,
        mean_signed_leg_error_m=0.01,
        touched=(True,),
        mean_leg_error_touched_m=0.01,
        mean_leg_error_never_touched_m=None,
        configurations=configurations,
        configurations_right=right,
        configurations_right_up_to_equivalence=excused,
        configurations_total=len(configurations),
        configurations_informative=len(searched),
        configurations_informative_right=sum(item.right for item in searched),
        configurations_informative_right_up_to_equivalence=sum(
            item.right_up_to_equivalence for item in searched
        ),
        configurations_chance=1.25,
        not_representable=("hip points 17 degrees away from front",),
        true_body_errors=(0.5, 12.25, 0.75),
        true_body_margins_deg=(26.6, 0.1, 0.3),
    )


def test_each_configuration_is_marked_right_excused_or_wrong() -> None:
    text = printed(
        make_score(
            (
                configuration("leg 1", "parent", "main body", right=True, excused=False),
                configuration("leg 1", "mount", "front", right=False, excused=False),
                configuration("leg 1", "hinge", "roll_left", right=False, excused=True),
                configuration("foot", "parent", "leg 1", right=True, excused=False),
                configuration("foot", "mount", "left", right=True, excused=False),
            )
        )
    )
    assert "Configurations right: 3 of 5, 4 up to equivalence." in text
    assert "Of the 4 that might have been wrong: 2 right, 3 up to equivalence." in text
    assert "By chance 1.25 of 5" in text
    assert "The true body, simulated, has a subjective error of 12.25 in interaction 2, at" in text
    assert "would land elsewhere in interaction 2: there a trifle" in text.replace("\n", " ")
    leg, foot = (line for line in text.splitlines() if "■" in line)
    assert leg.split("  ")[0] == "leg 1"
    for cell in ("■ main body", "□ front (true: left)", "≈ roll_left (true: left)"):
        assert cell in leg
    assert "not identifiable" in foot
    assert "Not representable: hip points 17 degrees away from front." in text


def test_what_the_problem_gives_is_not_listed() -> None:
    given = configuration("leg 1", "parent", "main body", right=True, excused=False)
    text = printed(make_score((given,)))
    assert "Configurations right: 1 of 1 (given by the problem, not searched)" in text
    assert "sits on" not in text


def test_a_result_shows_how_parts_hang_together_where_that_was_to_be_found(tmp_path: Path) -> None:
    known = make_run(tmp_path / "known", (0.1,) * 4)
    unknown = PROBLEM.replace('parent = 0\nmount = "back"', 'parent = "unknown"\nmount = "unknown"')
    assert unknown != PROBLEM
    store = make_run(tmp_path / "unknown", (0.1,) * 4, unknown, more=(0.99, 0.3))
    texts = []
    for each in (known, store):
        with each:
            console = Console(file=StringIO(), width=120, color_system=None)
            print_result(console, summarise(each), details=True)
            assert isinstance(console.file, StringIO)
            texts.append(console.file.getvalue())
    assert "sits on" not in texts[0]
    lines = [line for line in texts[1].splitlines() if line.startswith("back ")]
    assert lines[0].split()[:5] == ["back", "right", "front", "up", "100.0"]


def test_a_title_counts_parts_where_legs_have_several(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=UP) as run:
        result = summarise(run)
    assert headline(result).startswith("4 legs")
    model = result.best_models[0]
    first, second, *others = model.parts
    on_first = second.model_copy(update={"parent": first.name, "joint": "knee"})
    parts = (first, on_first, *others)
    several = model.model_copy(update={"parts": parts})
    result = result.model_copy(update={"best_models": (several, *result.best_models[1:])})
    assert headline(result).startswith(f"{len(parts)} parts")


@pytest.mark.parametrize("several", [False, True])
def test_lengths_of_parts_stand_under_what_they_are(tmp_path: Path, several: bool) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=UP) as run:
        result = summarise(run)
    best, *others = result.best_models
    if several:
        foot = best.parts[0].model_copy(update={"name": "foot", "joint": None})
        best = best.model_copy(update={"parts": (*best.parts, foot)})
        result = result.model_copy(update={"best_models": (best, *others)})
    text = io.StringIO()
    print_result(Console(file=text, width=200), result)
    (heading,) = (line for line in text.getvalue().splitlines() if line.startswith("part "))
    assert ("length (mm)" in heading, "90 % interval" in heading) == (not several, not several)
    assert ("best body (mm)" in heading) == several


@pytest.mark.parametrize(
    ("right", "said"),
    [(9, "predicts the robot: 9 of 10"), (6, "in part: 6 of 10"), (1, "does not predict")],
)
def test_a_validation_begins_with_a_verdict(right: int, said: str) -> None:
    errors: PredictionErrors = {"touch": 0.1, "tilt_deg": 1.0, "clearance_mm": 2.0}
    validation = Validation(
        programs=10,
        best_model=errors,
        population_median=errors,
        random_models=errors,
        invalid_predictions=0,
        as_predicted=right,
    )
    text = io.StringIO()
    print_validation(Console(file=text, width=200), validation)
    first, *_ = text.getvalue().splitlines()
    assert first.startswith("This body ")
    assert said in first
    assert f"{right} of 10 read as predicted, to 1.5° and 5 mm" in first


@pytest.mark.parametrize("method", ["paper", "posterior"])
def test_in_80_columns_all_numbers_are_whole(
    tmp_path: Path, method: Literal["paper", "posterior"]
) -> None:
    joints = tuple(f"{kind}_{place}" for place in range(6) for kind in ("swing", "lift"))
    place = made_run(tmp_path / "run", "hexapod-12", method, capabilities=capabilities_with(joints))
    with RunStore.open(place, to_write=False) as run:
        result = summarise(run)
    texts = []
    for width in (80, 200):
        text = io.StringIO()
        print_result(Console(file=text, width=width), result, details=True)
        texts.append(text.getvalue())
    narrow, wide = texts
    assert "…" not in narrow
    numbers = re.compile(r"[\d.]+(?:–[\d.]+)?")
    assert sorted(numbers.findall(narrow)) == sorted(numbers.findall(wide))
