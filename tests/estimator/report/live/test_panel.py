"""The text of the live page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from estimator.report.live.panel import panel
from estimator.report.live.run_view import RunState, RunView
from tests.estimator.report.live.followed_run import FollowedRun


@pytest.fixture
def view(followed: FollowedRun) -> RunView:
    return followed[1][-1]


def test_it_says_verdict_lengths_and_reasons(view: RunView) -> None:
    text, posterior = panel(view, Path("runs/mine")), view.result.posterior
    assert posterior is not None
    assert posterior.verdict in text
    for leg, length in zip(view.result.legs, posterior.lengths_m, strict=True):
        assert f"{leg.joint}</td>" in text
        assert f">{1000 * length.median:.0f} mm</td>" in text
        assert f">{1000 * length.low:.0f}–{1000 * length.high:.0f}</td>" in text
    assert text.count("its models differ by") == 2
    assert "The run goes on." in text
    assert f'value="{view.progress.share:.3f}"' in text


def test_it_says_how_to_go_on_and_when_all_is_done(view: RunView) -> None:
    text = panel(replace(view, state=RunState.INTERRUPTED), Path("runs/a<b"))
    assert "<code>estimator resume runs/a&lt;b</code>" in text
    assert "The run is finished." in panel(replace(view, state=RunState.FINISHED), Path("runs"))


def test_a_verdict_against_the_problem_stands_out(view: RunView) -> None:
    assert view.result.posterior is not None
    unlike = {"overturned": 0, "verdict": "NO BODY."}
    refused = view.result.posterior.model_copy(update=unlike)
    result = view.result.model_copy(update={"posterior": refused})
    assert ">NO BODY.</b>" in panel(replace(view, result=result), Path("runs"))


def test_after_a_movement_nothing_may_be_known_or_explained(view: RunView) -> None:
    posterior = view.result.posterior
    assert posterior is not None
    assert "but not explained" not in panel(view, Path("runs"))
    first, second, *others = posterior.steps
    doubted = first.model_copy(update={"explained": False})
    steps = (doubted, second.model_copy(update={"probability": None}), *others)
    result = view.result.model_copy(
        update={"posterior": posterior.model_copy(update={"steps": steps})}
    )
    text = panel(replace(view, result=result), Path("runs"))
    assert text.count("% probable, but not explained") == 1
    assert text.count("bits gained, probability not known<") == 1


def test_names_of_robots_are_no_html(view: RunView) -> None:
    evil = "<img src='http://example.org/x.png'>"
    legs = tuple(leg.model_copy(update={"joint": evil, "mount": evil}) for leg in view.result.legs)
    result = view.result.model_copy(
        update={"robot": {"robot": evil}, "problem": evil, "legs": legs, "warnings": (evil,)}
    )
    items = tuple(replace(item, reason=evil) for item in view.interactions)
    assert "<img" not in panel(replace(view, result=result, interactions=items), Path(evil))
