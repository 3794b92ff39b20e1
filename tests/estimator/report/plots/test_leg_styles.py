import numpy as np
import pytest

from estimator.report.plots.leg_styles import leg_colour, leg_markers

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
