"""Against values from the literature and by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from estimator.reproduction.claims_table import ClaimsTable
from estimator.reproduction.paper_claims import (
    STATEMENTS,
    Panel,
    holm,
    judge,
    judge_successes,
    mean_and_deviation,
    mean_difference,
    rates_differ,
    share,
    signed_rank,
    tilt_alone,
    verdict_on,
)


def test_wilson_intervals() -> None:
    every = share(30, 30)
    z = 1.959964
    assert every.low == pytest.approx(30 / (30 + z * z))  # Wilson's formula for p = 1
    assert every.high == pytest.approx(1.0)
    papers = share(1, 10)
    assert (papers.low, papers.high) == pytest.approx((0.0179, 0.4042), abs=5e-5)


def test_holm_on_a_textbook_example() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def test_signed_ranks_of_differences_of_one_sign_are_one_of_all_signs() -> None:
    lower = [-1.0, -2.0, -3.0, -4.0, -5.0]
    assert signed_rank(lower, "less") == pytest.approx(0.5**5)
    assert signed_rank([-item for item in lower], "less") == pytest.approx(1.0)
    assert signed_rank(lower, "two-sided") == pytest.approx(2 * 0.5**5)


def test_signed_ranks_on_a_textbook_example() -> None:
    """Darwin's maize, crossed minus self-fertilised, in eighths of an inch; rank sums 96 and 24."""
    differences = [49.0, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48]
    assert signed_rank(differences, "two-sided") == pytest.approx(0.0413, abs=5e-5)


def test_equal_pairs_tell_nothing() -> None:
    assert signed_rank([0.0] * 4, "less") == signed_rank([0.0] * 4, "two-sided") == 1.0
    assert signed_rank([0.0, -1.0, 0.0], "less") == pytest.approx(0.5)


def test_a_mean_difference_lies_in_its_interval() -> None:
    differences = np.random.default_rng(1).normal(3.0, 1.0, 200)
    difference = mean_difference(differences.tolist())
    half = 1.96 / math.sqrt(200)
    assert difference.mean == pytest.approx(float(np.mean(differences)))
    assert (difference.low, difference.high) == pytest.approx(
        (difference.mean - half, difference.mean + half), abs=0.02
    )
    assert mean_difference(differences.tolist()) == difference


def test_an_interval_of_differences_that_do_not_vary_is_a_point() -> None:
    same = mean_difference([0.5] * 5)
    assert (same.low, same.mean, same.high) == (0.5, 0.5, 0.5)
    one = mean_difference([0.5])
    assert (one.low, one.mean, one.high) == (None, 0.5, None)


def test_fishers_tea() -> None:
    assert rates_differ(share(3, 4), share(1, 4)) == pytest.approx(34 / 70)


def test_mean_and_deviation_of_few() -> None:
    assert mean_and_deviation([1.0, 3.0]) == pytest.approx((2.0, math.sqrt(2)))
    assert mean_and_deviation([1.0]) == (1.0, None)
    assert mean_and_deviation([]) == (None, None)


WITH_TILT = {1, 2, 4, 6}
PANELS: tuple[Panel, ...] = ("3a", "3b")


def samples(level: Callable[[Panel, int], float]) -> dict[tuple[Panel, int], dict[int, float]]:
    rng = np.random.default_rng(0)
    return {
        (panel, number): dict(enumerate(level(panel, number) + rng.normal(0, 0.001, 30)))
        for panel in PANELS
        for number in range(1, 8)
    }


def as_the_paper_has_it(panel: Panel, number: int) -> float:
    good = number in WITH_TILT if panel == "3a" else number in (1, 2)
    return 0.02 if good else 0.06


def test_the_claims_are_those_that_were_declared() -> None:
    claims = [(item.panel, item.better, item.worse) for item in judge({})]
    assert len(claims) == len(set(claims)) == 4 * 3 + 2 * 5
    assert {better for panel, better, _ in claims if panel == "3a"} == WITH_TILT
    assert {worse for panel, _, worse in claims if panel == "3b"} == {3, 4, 5, 6, 7}


def test_what_the_paper_says_would_hold() -> None:
    comparisons = judge(samples(as_the_paper_has_it))
    assert {item.verdict for item in comparisons} == {"holds"}
    assert [verdict_on(statement, comparisons) for statement in STATEMENTS] == ["holds", "holds"]
    assert all(item.corrected >= item.p for item in comparisons if item.p and item.corrected)


def test_the_opposite_contradicts() -> None:
    comparisons = judge(samples(lambda panel, number: -as_the_paper_has_it(panel, number)))
    assert {item.verdict for item in comparisons} == {"contradicted"}
    assert verdict_on(STATEMENTS[0], comparisons) == "contradicted"


def test_no_difference_shows_nothing() -> None:
    comparisons = judge(samples(lambda panel, number: 0.05))
    assert "holds" not in {item.verdict for item in comparisons}
    assert verdict_on(STATEMENTS[0], comparisons) == "not shown"


def test_one_weak_claim_weakens_the_sentence() -> None:
    comparisons = judge(
        samples(lambda panel, number: 0.06 if number == 6 else as_the_paper_has_it(panel, number))
    )
    assert verdict_on(STATEMENTS[0], comparisons) == "not shown"
    assert verdict_on(STATEMENTS[1], comparisons) == "holds"


def test_a_variant_without_runs_is_not_shown() -> None:
    known = samples(as_the_paper_has_it)
    del known["3a", 7]
    missing = [item for item in judge(known) if item.panel == "3a" and item.worse == 7]
    assert {item.verdict for item in missing} == {"not shown"}
    assert all(item.p is None for item in missing)


def test_runs_are_compared_seed_by_seed() -> None:
    """Seeds differ a hundred times as much as the variants, of which one is always a little better.

    A test for independent samples sees nothing there; and the order of the seeds does not matter.
    """
    rng = np.random.default_rng(0)
    level = rng.uniform(0.0, 0.1, 30)
    worse = dict(enumerate(level))
    better = {seed: worse[seed] - 0.001 - 1e-5 * seed for seed in rng.permutation(30).tolist()}
    comparisons = judge({("3a", 1): better, ("3a", 3): worse})
    (item,) = [
        item for item in comparisons if (item.panel, item.better, item.worse) == ("3a", 1, 3)
    ]
    assert item.verdict == "holds"
    assert item.p == pytest.approx(0.5**30)
    assert item.difference is not None
    assert item.difference.mean == pytest.approx(-0.001 - 1e-5 * 14.5)


def test_a_seed_that_only_one_variant_has_is_left_out() -> None:
    known = samples(as_the_paper_has_it)
    known["3a", 1][1029] = 1e6
    del known["3a", 3][4]
    comparisons = [item for item in judge(known) if item.panel == "3a" and item.worse == 3]
    assert [item.pairs for item in comparisons] == [29] * 4
    assert comparisons[0].means == pytest.approx((0.02, 0.06), abs=0.001)


@pytest.mark.parametrize("sign", [1, -1])
def test_differences_below_zero_speak_for_the_paper(sign: int) -> None:
    comparisons = judge(samples(lambda panel, number: sign * as_the_paper_has_it(panel, number)))
    for item in comparisons:
        difference = item.difference
        assert difference is not None
        assert difference.low is not None
        assert difference.high is not None
        assert difference.low < difference.mean < difference.high
        assert difference.mean == pytest.approx(-0.04 * sign, abs=0.001)


@pytest.mark.parametrize(
    ("successes", "runs", "verdict", "refuting"),
    [
        (1, 10, "not refuted", 7),
        (0, 10, "not refuted", 7),
        (0, 2, "not refuted", 2),
        (0, 1, "not refuted", None),  # nothing that one run gives can be told from 1 of 10
        (12, 30, "not refuted", 15),
        (28, 30, "contradicted", 15),
    ],
)
def test_success_rates(successes: int, runs: int, verdict: str, refuting: int | None) -> None:
    judged = judge_successes(share(successes, runs))
    assert (judged.verdict, judged.refuting) == (verdict, refuting)


def test_tilt_alone_is_compared_but_claimed_neither_way() -> None:
    asides = tilt_alone(samples(as_the_paper_has_it))
    assert [(item.panel, item.other) for item in asides] == [
        *(("3a", 1), ("3a", 2), ("3b", 1), ("3b", 2))
    ]
    assert asides[2].p is not None
    assert asides[2].p < 1e-6


def test_the_table_says_that_the_paper_contradicts_itself(tmp_path: Path) -> None:
    table = ClaimsTable.of(samples(as_the_paper_has_it), share(12, 30))
    text = "\n".join(table.markdown())
    assert "The paper says both" in text
    assert "Figure 3b: variant 6 (tilt) is worse than 2 (tilt, clearance)" in text
    assert "Figure 3a: variant 6 (tilt) is not told apart from 1" in text
    assert "Figure 6: not refuted" in text
    assert "at least 15 successes in 30 runs" in text
    assert "Wilcoxon" in text
    first = table.findings[0].difference
    assert first is not None
    assert f"{first.mean * 1000:+.1f} (" in text
    table.write(tmp_path)
    assert len((tmp_path / "claims.csv").read_text().splitlines()) == 1 + 22
