"""What is said of causes and of fits: the verdict, the headline and what to do next."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pytest
from rich.console import Console

from estimator.report.outcome import print_result
from estimator.report.page.run_page import run_page
from estimator.report.result import Result
from estimator.report.summarise import summarise
from estimator.report.verdict import verdict_on_posterior
from estimator.storage.posteriors import (
    Cause,
    Interval,
    NextMovement,
    PredictedInteraction,
    UnexplainedInteraction,
)
from tests.estimator.model_robot import TRUE_LENGTHS
from tests.estimator.posterior_run import make_posterior_run

UP = 2.5 / 6
ENDED = {"complete": True, "robot_uri": "tcp://robot:5750"}
HEAVY = Cause(
    name="mass of back",
    probability=0.55,
    sentence="back 2.5 times as heavy [1.4–4.4]",
    check="weigh back",
)
TURNED = Cause(
    name="hinge of back",
    probability=0.4,
    sentence="the hinge of back turned by +27° [+23–+31]",
    check="look at back",
)


def test_what_the_robot_has_otherwise_is_in_terminal_and_page(tmp_path: Path) -> None:
    stated = tuple(Interval(low=one - 0.002, median=one, high=one + 0.004) for one in TRUE_LENGTHS)
    with make_posterior_run(
        tmp_path, [TRUE_LENGTHS] * 3, askew=math.radians(1.3), causes=[HEAVY, TURNED]
    ) as run:
        (stored, cost) = run.posteriors()[-1]
        known = stored.model_copy(update={"as_stated_m": stated})
        run.save_posterior(0, known, cost, None)
        result = summarise(run)
        page, _ = run_page(run, result)
        page = page.replace("&#39;", "'")
    text = io.StringIO()
    print_result(Console(file=text, width=400), result, details=True)
    for said in (text.getvalue(), page):
        assert "an accelerometer turned by +1.3° left/right, or ground that rises so" in said
        assert "If the robot is exactly as stated" in said
        assert "± 3.0" in said
        for cause in (HEAVY, TURNED):
            assert cause.sentence in said
            assert cause.check in said
    assert result.posterior is not None
    assert result.posterior.explained
    assert result.posterior.verdict == (
        "Some body that this problem allows explains every interaction, on a robot that is not as "
        "the problem says: it has back 2.5 times as heavy [1.4–4.4] (55 %: weigh back) or the "
        "hinge of back turned by +27° [+23–+31] (40 %: look at back)."
    )


def test_something_else_may_read_like_what_is_named(tmp_path: Path) -> None:
    with make_posterior_run(
        tmp_path, [TRUE_LENGTHS] * 3, causes=[HEAVY, TURNED], misspecified=0.2
    ) as run:
        result = summarise(run)
        page, _ = run_page(run, result)
    assert result.posterior is not None
    assert result.posterior.verdict.endswith(
        "it has back 2.5 times as heavy [1.4–4.4] (44 %: weigh back) or the hinge of back turned "
        "by +27° [+23–+31] (32 %: look at back) or something that no check looks for (20 %)."
    )
    text = io.StringIO()
    print_result(Console(file=text, width=400), result, details=True)
    assert f"Otherwise (44.0 %): {HEAVY.sentence}" in text.getvalue()
    assert "<td>44.0 %</td>" in page


@pytest.mark.parametrize(
    ("hinge", "said"), [(None, "4 legs, probably to ± 0 mm: 80.0 % pro"), (UP, "80.0 % probable.")]
)
def test_what_is_named_is_to_be_measured(tmp_path: Path, hinge: float | None, said: str) -> None:
    """More movements cannot tell it from what reads like it."""
    sure = TURNED.model_copy(update={"probability": 1.0})
    with make_posterior_run(
        tmp_path, [TRUE_LENGTHS] * 3, causes=[sure], misspecified=0.2, hinge=hinge
    ) as run:
        (stored, cost) = run.posteriors()[-1]
        known = stored.model_copy(update={"probability_within_problem": 1.0})
        run.save_posterior(0, known, cost, None)
        result = summarise(run).model_copy(update=ENDED)
    text = io.StringIO()
    print_result(Console(file=text, width=200), result, tmp_path)
    assert said in text.getvalue()
    assert "Measure what the robot seems to have otherwise" in text.getvalue()
    assert "make it surer" not in text.getvalue()
    assert f"estimator pose {tmp_path}" in text.getvalue()


def test_a_robot_as_stated_that_may_have_something_else_is_to_move_more(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, misspecified=0.2) as run:
        result = summarise(run).model_copy(update=ENDED)
    text = io.StringIO()
    print_result(Console(file=text, width=200), result, tmp_path)
    assert text.getvalue().startswith("4 legs, probably to ± 0 mm: 80.0 % probable.")
    assert "more movements make it surer" in text.getvalue()
    assert "Measure" not in text.getvalue()


COULD_BE_SHORT = Cause(
    name="servo of left reversed",
    probability=0.19,
    sentence="the servo of left turning the other way",
    check="send left to +20°, and see which way it goes",
)


MOVEMENT = NextMovement(program=(0.5, 0.0, 0.1, -0.5), reason="", bits=0.8, bits_about_causes=0.6)


def with_a_cause(tmp_path: Path, probability: float) -> tuple[Result, str]:
    """A run whose servo may turn the other way, and its page."""
    cause = COULD_BE_SHORT.model_copy(update={"probability": probability})
    with make_posterior_run(
        tmp_path, [TRUE_LENGTHS] * 3, causes=[cause], next_movement=MOVEMENT
    ) as run:
        result = summarise(run)
        page, _ = run_page(run, result)
        return result, page


@pytest.mark.parametrize(
    ("probability", "said"),
    [
        (0.19, "is as the problem says (81 %), or has the servo of left turning the other way (19"),
        (0.06, "is as the problem says (94 %), or has the servo of left turning the other way (6"),
        (0.6, "has the servo of left turning the other way (60 %: send left to +20°, and see"),
    ],
)
def test_causes_that_compete_come_with_the_movement_that_tells_them_apart(
    tmp_path: Path, probability: float, said: str
) -> None:
    """Also where it is more probable that the robot is as stated, and all lengths look known."""
    result, page = with_a_cause(tmp_path, probability)
    assert result.posterior is not None
    verdict = result.posterior.verdict
    assert f"explains every interaction, on a robot that {said}" in verdict
    assert verdict.endswith(
        "A movement that tells them apart: left to +29°, right to +6°, back to -29°."
    )
    assert verdict in page
    text = io.StringIO()
    print_result(Console(file=text, width=2000), result)
    assert "whether the robot is as the problem says is not known yet" in text.getvalue()
    assert verdict in text.getvalue()
    alike = MOVEMENT.model_copy(update={"bits_about_causes": 0.01})
    assert verdict_on_posterior(
        result.posterior.model_copy(update={"next_movement": alike}), joints=["a", "b", "c", "d"]
    ).endswith("No movement was found that tells them apart.")
    not_asked = MOVEMENT.model_copy(update={"bits_about_causes": 0.0})
    assert "movement" not in verdict_on_posterior(
        result.posterior.model_copy(update={"next_movement": not_asked}), joints=["a", "b"]
    )


@pytest.mark.parametrize(("probability", "named"), [(0.04, False), (0.96, True)])
def test_of_a_cause_that_is_sure_or_improbable_no_movement_is_told(
    tmp_path: Path, probability: float, named: bool
) -> None:
    result, _ = with_a_cause(tmp_path, probability)
    assert result.posterior is not None
    assert ("turning the other way" in result.posterior.verdict) == named
    assert ("is not as the problem says" in result.posterior.verdict) == named
    assert "tells them apart" not in result.posterior.verdict


def test_what_fits_poorly_is_told_so(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        (stored, _) = run.posteriors()[-1]
    poor = stored.model_copy(update={"probability_within_problem": None})
    assert poor.explained
    assert verdict_on_posterior(poor) == (
        "Some body that this problem allows explains every interaction, but poorly: a better one "
        "may have been missed, the problem may be another robot's, or the sensors noisier than "
        "announced."
    )


def test_what_changed_is_no_explanation(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        (stored, _) = run.posteriors()[-1]
    changed = stored.model_copy(update={"overturned": 3})
    assert not changed.explained
    assert verdict_on_posterior(changed) == (
        "NO BODY THAT THIS PROBLEM ALLOWS explains both interactions 1 to 4, after which another "
        "was sure, and those since, so the robot may have changed on the way."
    )


def test_what_a_robot_has_otherwise_is_told_though_not_all_is_explained(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, causes=[TURNED]) as run:
        (stored, _) = run.posteriors()[-1]
    doubted = {"overturned": 3, "misspecification_probability": 0.97}
    said = verdict_on_posterior(stored.model_copy(update=doubted))
    assert said.startswith("NO BODY THAT THIS PROBLEM ALLOWS explains both interactions 1 to 4")
    assert "The one that explains most is on a robot that" in said
    assert f"{TURNED.sentence} (40 %: {TURNED.check})" in said


def test_one_unexplained_interaction_is_told(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        (stored, _) = run.posteriors()[-1]
    odd = UnexplainedInteraction(interaction=2, sensors=("tilt",))
    told = PredictedInteraction(
        touch=(), tilt=(0.0, 0.0), clearance=0.1, residuals={}, outlier_probability=0.0
    )
    one, two = (
        stored.model_copy(update={"unexplained": (odd,) * count, "predicted": (told,) * 3})
        for count in (1, 2)
    )
    assert one.explained
    assert verdict_on_posterior(one) == (
        "Some body that this problem allows explains every interaction but interaction 3, an "
        "outlier or a fault that came or went."
    )
    far = one.model_copy(update={"unexplained": (odd.model_copy(update={"residual": 68.0}),)})
    assert not far.explained
    assert verdict_on_posterior(far) == (
        "NO BODY THAT THIS PROBLEM ALLOWS explains interaction 3 (tilt), in which something "
        "happened that this model does not contain: readings lie 68 standard deviations off."
    )
    assert not two.explained
    only = one.model_copy(update={"predicted": one.predicted[:1]})
    assert not only.explained
    assert verdict_on_posterior(only) == (
        "NO BODY THAT THIS PROBLEM ALLOWS explains interaction 3, the only one (tilt)."
    )


def test_a_robot_that_is_most_likely_built_otherwise_is_not_explained(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        (stored, _) = run.posteriors()[-1]
    perhaps, probably = (
        stored.model_copy(update={"misspecification_probability": one}) for one in (0.8, 0.97)
    )
    assert perhaps.explained
    assert not probably.explained
    assert verdict_on_posterior(probably) == (
        "NO BODY THAT THIS PROBLEM ALLOWS is as probable as that the robot is built otherwise, or "
        "has changed on the way (97 %)."
    )


def test_where_searches_disagree_the_problem_is_not_blamed(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=UP) as run:
        (stored, _) = run.posteriors()[-1]
    noisy = stored.model_copy(update={"noisy": ("tilt",)})
    assert verdict_on_posterior(noisy).startswith("NO BODY THAT THIS PROBLEM ALLOWS explains tilt")
    assert verdict_on_posterior(noisy.model_copy(update={"coverage": 0.3})) == (
        "NO BODY THAT WAS FOUND explains tilt without more than twice the noise that is expected. "
        "But the searches found different ones, so that a better one may have been missed: more "
        "movements help, and a problem that leaves less open."
    )


@pytest.mark.parametrize("hinge", [None, UP])
@pytest.mark.parametrize(
    ("sign", "end", "asked"), [(-1, 0.25, "longer than 250.0"), (1, 0.05, "shorter than 50.0")]
)
def test_a_length_that_ends_where_the_range_ends_is_not_found_but_asked_about(
    tmp_path: Path, hinge: float | None, sign: int, end: float, asked: str
) -> None:
    crowded = [
        (TRUE_LENGTHS[0] + 1e-4 * row, end - sign * 0.01 * math.log1p(-row / 41), *TRUE_LENGTHS[2:])
        for row in range(41)
    ]
    with make_posterior_run(tmp_path, crowded, hinge=hinge) as run:
        (stored, cost) = run.posteriors()[-1]
        sure = {"probability_within_problem": 0.99, "too_early": False}
        run.save_posterior(0, stored.model_copy(update=sure), cost, None)
        result = summarise(run).model_copy(update=ENDED)
        page, _ = run_page(run, result)
    text = io.StringIO()
    print_result(Console(file=text, width=400), result, tmp_path / "run")
    for said in (text.getvalue(), page.replace("&#39;", "'")):
        assert "not found yet: the problem's range ends where the length of front does" in said
        assert f"May front be {asked} mm" in said
    assert "identify" in text.getvalue()
    assert "with the range widened" in text.getvalue()
    assert "surer" not in text.getvalue()
    assert result.posterior is not None
    assert [length.parts for length in result.posterior.at_ends] == [("front",)]
    assert Result.model_validate_json(result.model_dump_json()) == result
