import json
import math
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from estimator.cli.command_line import app
from estimator.readings.observation import Observation
from estimator.report import run_files
from estimator.report.outcome import next_steps
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.report.summarise import summarise
from estimator.storage.store import RunStore
from tests.estimator.evaluation.test_score import make_run
from tests.estimator.model_robot import JOINTS, PROBLEM, TRUE_LENGTHS
from tests.estimator.posterior_run import make_posterior_run
from tests.estimator.report.made_runs import made_run

ROBOT = "tcp://127.0.0.1:5750"


def test_a_run_in_numbers(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        result = summarise(store)
    assert not result.complete
    assert (result.problem, result.physics, result.seed) == ("legs", "pybullet", 1)
    assert result.modalities == ("touch", "tilt", "clearance")
    assert result.interactions == 1
    assert result.sensor_error == 1.0
    assert result.robot["joints"][0]["name"] == "left"
    assert {"python", "numpy", "pybullet", "bodyschema"} <= result.versions.keys()
    best, other = result.best_models
    assert best.leg_lengths_m == pytest.approx((0.17, 0.15, 0.18, 0.16))
    assert other.leg_lengths_m == pytest.approx((0.05,) * 4)
    part = best.parts[1]
    assert (part.name, part.parent, part.mount, part.hinge) == ("front", "main body", "front", "up")
    assert part.joint == "front"
    left = result.legs[0]
    assert left.length_m == pytest.approx(0.17)
    assert left.population_m == pytest.approx((0.05, 0.17))


def test_what_belongs_to_the_other_method_is_not_told_of_a_posterior(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        result = summarise(run)
    assert (result.search, result.objective) == (None, None)
    assert (result.population, result.generations) == (None, None)
    assert (result.simulations_invalid, result.simulations_undecided) == (None, None)


def test_a_part_is_as_sure_as_the_weights_of_the_samples_that_attach_it_alike(
    tmp_path: Path,
) -> None:
    folder = made_run(tmp_path / "run", "topological", "posterior", complete=False)
    with RunStore.open(folder) as run:
        latest, counters = run.posteriors()[-1]
        other = tuple(np.mod(np.array(latest.best) + 0.5, 1.0).tolist())  # every choice another
        stored = latest.model_copy(
            update={
                "genes": (latest.best, other, other),
                "scales": latest.scales[:3],
                "weights": (0.7, 0.2, 0.1),
            }
        )
        run.plan(3, (0.0,) * 8, reason="tells all apart", bits=1.0)
        run.observe(3, run.observations()[-1])
        run.save_posterior(3, stored, counters, None)
        parts = summarise(run).best_models[0].parts
    assert [part.agreement for part in parts if part.mount != "end"] == pytest.approx([0.7] * 4)


def test_a_leg_that_never_touched_is_warned_about(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        result = summarise(store)
    assert [leg.touched for leg in result.legs] == [True, True, False, True]
    (warning,) = result.warnings
    assert warning.startswith("The leg at right never touched the ground")


@pytest.mark.parametrize(
    ("right_legs", "diagnosed", "warned"),
    [
        ((0.18, 0.14, 0.22), False, True),
        ((0.18, 0.14, 0.22), True, False),  # its length is that of other movements
        ((0.18, 0.17, 0.19), False, False),  # other readings tell it
    ],
)
def test_a_leg_that_never_touched_is_warned_about_where_its_length_is_unknown(
    tmp_path: Path, right_legs: tuple[float, ...], diagnosed: bool, warned: bool
) -> None:
    left, front, _, back = TRUE_LENGTHS
    with make_posterior_run(tmp_path, [(left, front, one, back) for one in right_legs]) as run:
        ((stored, counters),) = run.posteriors()
        run.plan(1, (0.0,) * 4)
        run.observe(1, Observation(angles=(0.0,) * 4, touch=(True, True, False, True)))
        summary = stored.model_copy(update={"diagnosed": diagnosed})
        run.save_posterior(1, summary, counters, None)
        warnings = " ".join(summarise(run).warnings)
    assert ("The leg at right never touched the ground" in warnings) == warned


def test_a_radius_other_than_the_robots_is_warned_about(tmp_path: Path) -> None:
    thick = PROBLEM.replace("radius = 0.006", "radius = 0.009", 1)
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16), thick)
    with store:
        warning = summarise(store).warnings[0]
    assert warning == (
        "The robot states a radius of 6.0 mm for left, and the problem 9.0 mm: write "
        "radius = 0.006 there, or its lengths will be wrong."
    )


@pytest.mark.parametrize(
    ("uncertain", "says"),
    [
        ("", "Ground that slopes is taken for an accelerometer that is turned."),
        (
            "exact = true",
            "Neither ground that slopes nor an accelerometer that is turned is weighed",
        ),
    ],
)
def test_a_lean_in_the_zero_pose_is_warned_about(tmp_path: Path, uncertain: str, says: str) -> None:
    lean = math.radians(2.7)
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, lean=lean, uncertain=uncertain) as run:
        (warning, *_) = summarise(run).warnings
    assert warning.startswith("In its zero pose the robot leaned by 2.7°: put a spirit level on")
    assert says in warning


def test_doubtful_interactions_are_warned_about(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        store.plan(1, (0.0,) * 4)
        store.observe(
            1,
            Observation(
                angles=(0.0,) * 4,
                touch=(True,) * 4,
                settled=False,
                saturated_joints=("left",),
                measured=(0.0, 0.1, 0.0, 0.0),
                off_target={"front": "sagging"},
                tilt=(0.0, 0.0),
            ),
        )
        warnings = summarise(store).warnings
    assert warnings == (
        "The robot was not at rest when interaction 2 was read.",
        "At the end of what they can reach stood, at times: left.",
        "The joint front is sagging: it was not where it was sent in interaction 2.",
    )


def test_without_an_accelerometer_nobody_says_that_the_robot_moved(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        store.plan(1, (0.0,) * 4)
        store.observe(1, Observation(angles=(0.0,) * 4, touch=(True,) * 4, settled=False))
        (warning,) = summarise(store).warnings
    assert warning == "The robot cannot tell whether it was at rest: it has no accelerometer."


def test_to_go_on_the_problem_is_named_as_it_was(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=2.5 / 6) as run:
        result = summarise(run)
        assert result.problem_asked == run.settings.problem
    asked = result.model_copy(
        update={"complete": True, "problem_asked": "mine/arm.toml", "robot_uri": ROBOT}
    )
    (again,) = [step for step in next_steps(asked, tmp_path) if "identify" in step]
    assert "--problem mine/arm.toml --interactions" in again


def test_what_is_advised_can_be_typed_whatever_the_names_are(tmp_path: Path) -> None:
    place = Path("my run")
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3, hinge=2.5 / 6) as run:
        begun = summarise(run)
    asked = begun.model_copy(
        update={"complete": True, "problem_asked": "my arm.toml", "robot_uri": ROBOT}
    )
    assert words(begun, place) == [["estimator", "resume", "my run"]]
    again, posed, *others = words(asked, place)
    assert again[:6] == ["estimator", "identify", "--robot", ROBOT, "--problem", "my arm.toml"]
    assert posed == ["estimator", "pose", "my run", "--robot", ROBOT, "--highest"]
    assert [command[2] for command in others] == ["my run", "my run"]
    validated = words(asked.model_copy(update={"posterior": None}), place)
    assert validated[0] == ["estimator", "validate", "my run", "--robot", ROBOT]


def test_every_run_that_is_not_finished_says_how_to_go_on(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path / "doubted", [TRUE_LENGTHS] * 3, misspecified=0.9) as run:
        doubted = summarise(run)
    with make_run(tmp_path / "begun", (0.17, 0.15, 0.18, 0.16)) as run:
        run._database.execute("DELETE FROM checkpoint")
        run._database.execute("DELETE FROM generations")
        begun = summarise(run)
    assert begun.legs == ()
    first, *others = next_steps(doubted, Path("run"))
    assert first == "Check, the likeliest first:"
    resume = ["Next:", "  estimator resume run    goes on"]
    assert others[-2:] == next_steps(begun, Path("run")) == resume
    ended = doubted.model_copy(update={"complete": True})
    assert next_steps(ended, Path("run")) == [first, *others[:-2]]
    assert next_steps(begun, None) == []


def words(result: Result, directory: Path) -> list[list[str]]:
    """Words of the commands that are proposed next, as a shell takes them."""
    return [
        shlex.split(step.strip().split("    ")[0]) for step in next_steps(result, directory)[1:]
    ]


def test_of_a_record_no_movement_is_asked(tmp_path: Path) -> None:
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 3) as run:
        unsure = summarise(run).model_copy(update={"complete": True})
    without_posterior = unsure.model_copy(update={"posterior": None})
    for result, first in ((unsure, "identify"), (without_posterior, "validate")):
        assert commands(result, ROBOT) == [first, "pose", "export", "show"]
        for record in ("file:readings.csv", "replay:runs/first"):
            assert commands(result, record) == ["export", "show"]


def commands(result: Result, uri: str) -> list[str]:
    """Names of the commands that are proposed next, where this was the robot."""
    result = result.model_copy(update={"robot_uri": uri})
    heading, *steps = next_steps(result, Path("run"))
    assert heading == "Next:"
    return [step.split()[1] for step in steps]


def test_before_the_first_generation_there_is_a_result_without_models(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        store._database.execute("DELETE FROM checkpoint")
        store._database.execute("DELETE FROM generations")
        result = write_report(store)
    assert (result.sensor_error, result.legs, result.best_models) == (None, (), ())
    assert not (store.directory / "plots").exists()


def test_plots_are_drawn_once_a_run_is_finished_or_when_its_page_is_asked_for(
    tmp_path: Path,
) -> None:
    for name, complete in (("half", False), ("whole", True)):
        place = made_run(tmp_path / name, "parametric", "posterior", complete=complete)
        with RunStore.open(place, to_write=False) as store:
            assert write_report(store).complete is complete
            assert (place / "plots").exists() is complete
            if not complete:
                write_report(store, page=True)
        assert (place / "plots" / "lengths.png").exists()


def test_show_writes_what_was_left_when_the_last_writing_was_broken_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken_off(*_: object) -> str:
        raise KeyboardInterrupt

    place = made_run(tmp_path / "run", "parametric", "posterior")
    page = place / "report.html"
    page.write_text("of two interactions")
    with RunStore.open(place, to_write=False) as store, monkeypatch.context() as patch:
        patch.setattr(run_files, "run_page", broken_off)
        with pytest.raises(KeyboardInterrupt):
            write_report(store)
    shown = CliRunner().invoke(app, ["show", str(place)])
    assert shown.exit_code == 0, shown.output
    assert page.read_text() != "of two interactions"


def test_result_json_has_no_infinity_in_it(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        store._database.execute("UPDATE generations SET errors = '[Infinity, Infinity]'")
        result = write_report(store)
    assert result.warnings[0].startswith("No model could be simulated")

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    text = (store.directory / "result.json").read_text()
    assert json.loads(text, parse_constant=refuse)["sensor_error"] is None
    assert Result.model_validate_json(text) == result


def test_robot_and_readings_stand_beside_the_result(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.18, 0.16))
    with store:
        write_report(store)
    header, row = (store.directory / "readings.csv").read_text().splitlines()
    assert header.split(",")[:4] == [f"angle_deg_{joint}" for joint in JOINTS]
    assert row.split(",")[4:8] == ["1", "1", "0", "1"]
    robot = json.loads((store.directory / "robot.json").read_text())
    assert robot["base_mass"] == 0.3
    assert not list(store.directory.rglob(".*"))  # no half-written files
