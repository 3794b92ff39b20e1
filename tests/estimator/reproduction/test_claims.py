"""Verdicts that must follow from samples that could not be clearer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from estimator.reproduction.claims import (
    STATEMENTS,
    Panel,
    judge,
    judge_successes,
    overall,
    tilt_alone,
)
from estimator.reproduction.claims_table import ClaimsTable
from estimator.reproduction.statistics import share

WITH_TILT = {1, 2, 4, 6}
PANELS: tuple[Panel, ...] = ("3a", "3b")


def samples(level: Callable[[Panel, int], float]) -> dict[tuple[Panel, int], list[float]]:
    rng = np.random.default_rng(0)
    return {
        (panel, number): (level(panel, number) + rng.normal(0, 0.001, 30)).tolist()
        for panel in PANELS
        for number in range(1, 8)
    }


def as_the_paper_has_it(panel: Panel, number: int) -> float:
    good = number in WITH_TILT if panel == "3a" else number in (1, 2)
    return 0.02 if good else 0.06


def test_the_claims_are_those_that_were_declared() -> None:
    found = [(item.panel, item.better, item.worse) for item in judge({})]
    assert len(found) == len(set(found)) == 4 * 3 + 2 * 5
    assert {better for panel, better, _ in found if panel == "3a"} == WITH_TILT
    assert {worse for panel, _, worse in found if panel == "3b"} == {3, 4, 5, 6, 7}


def test_what_the_paper_says_would_hold() -> None:
    found = judge(samples(as_the_paper_has_it))
    assert {item.verdict for item in found} == {"holds"}
    assert [overall(statement, found) for statement in STATEMENTS] == ["holds", "holds"]
    assert all(item.corrected >= item.p for item in found if item.p and item.corrected)


def test_the_opposite_contradicts() -> None:
    found = judge(samples(lambda panel, number: -as_the_paper_has_it(panel, number)))
    assert {item.verdict for item in found} == {"contradicted"}
    assert overall(STATEMENTS[0], found) == "contradicted"


def test_no_difference_shows_nothing() -> None:
    found = judge(samples(lambda panel, number: 0.05))
    assert "holds" not in {item.verdict for item in found}
    assert overall(STATEMENTS[0], found) == "not shown"


def test_one_weak_claim_weakens_the_sentence() -> None:
    found = judge(
        samples(lambda panel, number: 0.06 if number == 6 else as_the_paper_has_it(panel, number))
    )
    assert overall(STATEMENTS[0], found) == "not shown"
    assert overall(STATEMENTS[1], found) == "holds"


def test_a_variant_without_runs_is_not_shown() -> None:
    known = samples(as_the_paper_has_it)
    del known["3a", 7]
    missing = [item for item in judge(known) if item.panel == "3a" and item.worse == 7]
    assert {item.verdict for item in missing} == {"not shown"}
    assert all(item.p is None for item in missing)


@pytest.mark.parametrize(
    ("successes", "runs", "verdict"),
    [
        (1, 10, "holds"),
        (0, 10, "holds"),
        (0, 2, "not shown"),  # any rate might give that
        (12, 30, "not shown"),  # the interval leaves out 10 %, but 1 of 10 might be 40 %, too
        (28, 30, "contradicted"),
    ],
)
def test_success_rates(successes: int, runs: int, verdict: str) -> None:
    assert judge_successes(share(successes, runs)).verdict == verdict


def test_tilt_alone_is_compared_but_claimed_neither_way() -> None:
    found = tilt_alone(samples(as_the_paper_has_it))
    assert [(item.panel, item.other) for item in found] == [
        *(("3a", 1), ("3a", 2), ("3b", 1), ("3b", 2))
    ]
    assert found[2].p is not None
    assert found[2].p < 1e-6


def test_the_table_says_that_the_paper_contradicts_itself(tmp_path: Path) -> None:
    table = ClaimsTable.of(samples(as_the_paper_has_it), share(12, 30))
    text = "\n".join(table.markdown())
    assert "The paper says both" in text
    assert "Figure 3b: variant 6 (tilt) is worse than 2 (tilt, clearance)" in text
    assert "Figure 3a: variant 6 (tilt) is not told apart from 1" in text
    assert "Figure 6: not shown" in text
    table.write(tmp_path)
    assert len((tmp_path / "claims.csv").read_text().splitlines()) == 1 + 22
