"""What a person reads about configurations."""

from io import StringIO
from pathlib import Path

from rich.console import Console

from estimator.evaluation.attachments import Configuration
from estimator.evaluation.score import Score
from estimator.report.summarise import summarise
from estimator.report.tables.terminal import print_result, print_score
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import PROBLEM


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
    assert "not felt" in foot
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
            print_result(console, summarise(each))
            assert isinstance(console.file, StringIO)
            texts.append(console.file.getvalue())
    assert "sits on" not in texts[0]
    lines = [line for line in texts[1].splitlines() if line.startswith("back ")]
    assert lines[-1].split() == ["back", "right", "front", "up", "100.0"]
