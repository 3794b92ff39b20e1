"""``best_programs``: whatever the score, its best programs are found."""

from __future__ import annotations

import numpy as np
import pytest

from estimator import EstimatorError, best_programs
from estimator.body.morphology import Array
from estimator.exploration.best_programs import Score

ENDS = np.radians([[-30.0, 30.0], [-30.0, 30.0], [0.0, 0.0]])
GOAL = np.radians([17.0, -23.0, 0.0])


def near_the_goal(programs: Array) -> Array:
    distances: Array = np.sqrt(np.sum((programs - GOAL) ** 2, axis=1))
    return -distances


def test_programs_are_refined_beyond_what_was_drawn() -> None:
    candidates = np.random.default_rng(1).uniform(ENDS[:, 0], ENDS[:, 1], (50, 3))
    programs, scores = best_programs(
        near_the_goal, ENDS, np.random.default_rng(2), candidates=candidates
    )
    assert programs.shape == (20, 3)
    assert np.array_equal(scores, near_the_goal(programs))
    assert list(scores) == sorted(scores, reverse=True)
    assert scores[0] > near_the_goal(candidates).max()
    assert np.degrees(-scores[0]) < 3.0
    assert np.all((programs >= ENDS[:, 0]) & (programs <= ENDS[:, 1]))


def test_a_joint_that_is_not_moved_keeps_its_target() -> None:
    candidates = np.random.default_rng(1).uniform(ENDS[:, 0], ENDS[:, 1], (50, 3))
    moved = np.ones((50, 3), dtype=bool)
    moved[:, 1] = False
    programs, _ = best_programs(
        near_the_goal, ENDS, np.random.default_rng(2), candidates=candidates, moved=moved
    )
    kept, found = set(candidates[:, 1].tolist()), set(candidates[:, 0].tolist())
    assert set(programs[:, 1].tolist()) <= kept
    assert not set(programs[:, 0].tolist()) <= found


@pytest.mark.parametrize("low", [-30.0, 0.0])
def test_targets_of_zero_are_varied_also_where_a_range_ends_there(low: float) -> None:
    ends = np.radians([[low, 30.0], [-30.0, -low], [0.0, 0.0]])
    programs, scores = best_programs(
        near_the_goal, ends, np.random.default_rng(1), candidates=np.zeros((1, 3))
    )
    assert len(programs) == 20
    assert np.degrees(-scores[0]) < 22.0  # from 29
    assert np.all(programs[0, :2] != 0)
    assert not programs[:, 2].any()


def test_a_rough_score_spares_the_others_and_a_sure_one_has_the_last_word() -> None:
    asked = {"rough": 0, "good": 0, "sure": 0}

    def counted(name: str, sign: float = 1.0) -> Score:
        def score(programs: Array) -> Array:
            asked[name] += len(programs)
            return sign * near_the_goal(programs)

        return score

    programs, scores = best_programs(
        counted("good"),
        ENDS,
        np.random.default_rng(3),
        rough=counted("rough"),
        sure=counted("sure", -1.0),
    )
    assert asked == {"rough": 1000, "good": 100 + 2 * 64, "sure": 20}
    assert np.array_equal(scores, -near_the_goal(programs))
    assert list(scores) == sorted(scores, reverse=True)


def test_the_same_generator_finds_the_same() -> None:
    one, two = (best_programs(near_the_goal, ENDS, np.random.default_rng(4)) for _ in range(2))
    assert np.array_equal(one[0], two[0])


@pytest.mark.parametrize(
    ("ends", "candidates", "score", "sentence"),
    [
        (ENDS[:, 0], None, near_the_goal, r"has the shape \(joints, 2\), not \(3,\)"),
        (ENDS, np.zeros((4, 2)), near_the_goal, r"shape \(1000, 3\), .* not \(4, 2\)"),
        (ENDS, np.zeros((0, 3)), near_the_goal, r"not \(0, 3\)"),
        (ENDS, None, lambda programs: programs, r"shape \(1000,\), not \(1000, 3\)"),
        (ENDS, None, lambda programs: programs[:, 0] * np.nan, "but 1000 of 1000 scores are NaN$"),
    ],
)
def test_what_is_no_score_is_said(
    ends: Array, candidates: Array | None, score: Score, sentence: str
) -> None:
    with pytest.raises(EstimatorError, match=sentence):
        best_programs(score, ends, np.random.default_rng(1), candidates=candidates)


def test_what_is_moved_is_said_of_each_candidate() -> None:
    with pytest.raises(EstimatorError, match=r"the candidates, \(4, 3\), not \(3,\)"):
        best_programs(
            near_the_goal,
            ENDS,
            np.random.default_rng(1),
            candidates=np.zeros((4, 3)),
            moved=np.ones(3, dtype=bool),
        )
