"""Whole runs with real physics over a real wire, on a small budget; and what interrupts them."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from estimator.errors import EstimatorError, InteractionError, ProblemError, RunDirectoryError
from estimator.executors import ThisProcess
from estimator.identification.method import Listener
from estimator.identification.robot_link import open_robot
from estimator.identification.run import identify, resume
from estimator.physics.backends import REFERENCE, in_this_process
from estimator.physics.base import Physics, WorldSettings
from estimator.report.outcome import print_result
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.records import Generation
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS as HERE
from estimator.workplaces import Executors, on_this_computer
from protocol.errors import RobotError, RobotUnreachableError
from tests.estimator.model_robot import ModelRobot, changed, make_order, serving, without_plots


class Witness(Listener):
    """Notes what is said, and interrupts after some pieces of work."""

    def __init__(self, interrupt_after: int | None = None):
        self.heard: list[str] = []
        self.pieces = 0
        self._interrupt_after = interrupt_after

    def say(self, sentence: str) -> None:
        self.heard.append(sentence)

    def worked(self, work: float, what: str) -> None:
        self.pieces += 1
        if self.pieces == self._interrupt_after:
            raise KeyboardInterrupt


def outcome(result: Result) -> dict[str, object]:
    """What must not depend on interruptions."""
    kept = result.model_dump(
        exclude={"wall_seconds", "robot_uri", "robot", "versions", "problem_asked"}
    )
    assert kept["complete"]
    return kept


def history(directory: Path) -> list[Generation]:
    with RunStore.open(directory, to_write=False) as store:
        return store.generations()


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    folder = tmp_path_factory.mktemp("uninterrupted")
    with serving(ModelRobot()) as uri:
        result = identify(
            folder / "run", make_order(folder, uri), HERE, Witness(), report=write_report
        )
    return result, folder / "run"


def test_a_run_finds_the_legs_that_touched(uninterrupted: tuple[Result, Path]) -> None:
    result, directory = uninterrupted
    assert result.complete
    assert (result.interactions, result.simulations_requested) == (2, 8 * (1 + 2 + 2 + 2 * 2))
    assert 0 < result.simulations_run <= result.simulations_requested
    assert result.simulations_run < result.steps < 300 * result.simulations_run  # stops at rest
    assert [leg.joint for leg in result.legs] == ["left", "front", "right", "back"]
    errors = [min(generation.errors) for generation in history(directory)]
    assert errors[2] <= errors[1] <= errors[0]
    for name in ("result.json", "readings.csv", "robot.json", "plots/errors.png"):
        assert (directory / name).stat().st_size > 0
    assert Result.model_validate_json((directory / "result.json").read_text()) == result


@pytest.mark.parametrize("pieces", [1, 3, 4, 6])
def test_an_interrupted_run_resumes_to_the_same_result(
    tmp_path: Path, uninterrupted: tuple[Result, Path], pieces: int
) -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        with pytest.raises(KeyboardInterrupt):
            identify(
                tmp_path / "run",
                make_order(tmp_path, uri),
                HERE,
                Witness(pieces),
                report=without_plots,
            )
        result = resume(tmp_path / "run", HERE, Witness(), report=without_plots)
    assert outcome(result) == outcome(uninterrupted[0])
    assert len(robot.motions) == 2


def test_a_finished_run_needs_no_robot_to_resume(
    uninterrupted: tuple[Result, Path],
) -> None:
    result, directory = uninterrupted
    assert outcome(resume(directory, HERE, Witness(), report=without_plots)) == outcome(result)


def test_a_replay_gives_the_same_result(tmp_path: Path, uninterrupted: tuple[Result, Path]) -> None:
    result, directory = uninterrupted
    again = identify(
        tmp_path / "run",
        make_order(tmp_path, f"replay:{directory}"),
        HERE,
        Witness(),
        report=without_plots,
    )
    assert outcome(again) == outcome(result)


def test_where_pybullet_is_not_installed_mujoco_has_the_last_word(
    tmp_path: Path,
    uninterrupted: tuple[Result, Path],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    opened: list[str] = []

    def opening(name: str, settings: WorldSettings) -> Physics:
        opened.append(name)
        return in_this_process(name, settings)

    executors = Executors(open_physics=opening, workers=ThisProcess())
    monkeypatch.setattr("estimator.identification.run.REFERENCE", "mujoco")
    order = make_order(tmp_path, f"replay:{uninterrupted[1]}")
    order = changed(order, physics="statics")
    result = identify(tmp_path / "run", order, executors, Witness(), report=without_plots)
    assert opened == ["statics", "mujoco"]
    assert result.reference == "mujoco"
    assert result.finish is not None
    print_result(Console(width=200), result, details=True)
    assert "mujoco had the last word" in capsys.readouterr().out
    monkeypatch.undo()
    opened.clear()
    resume(tmp_path / "run", executors, Witness(), report=without_plots)
    assert "pybullet" not in opened


def test_a_run_is_not_complete_before_the_reference_has_had_its_word(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    def interrupted(name: str, settings: WorldSettings) -> Physics:
        if name == REFERENCE:
            raise KeyboardInterrupt
        return in_this_process(name, settings)

    order = make_order(tmp_path, f"replay:{uninterrupted[1]}")
    order = changed(order, physics="statics")
    executors = Executors(open_physics=interrupted, workers=ThisProcess())
    with pytest.raises(KeyboardInterrupt):
        identify(tmp_path / "run", order, executors, Witness(), report=without_plots)
    with RunStore.open(tmp_path / "run", to_write=False) as store:
        settings = store.settings
        assert len(store.generations()) == settings.interactions * (settings.generations + 1)
        assert not store.complete
    result = resume(tmp_path / "run", HERE, Witness(), report=without_plots)
    assert result.complete
    assert result.finish is not None


def test_its_own_readings_serve_as_readings_by_hand(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    result, directory = uninterrupted
    order = make_order(tmp_path, f"file:{directory}/readings.csv")
    again = identify(tmp_path / "run", order, HERE, Witness(), report=without_plots)
    assert again.interactions == 2
    for one, two in zip(again.legs, result.legs, strict=True):
        assert (one.joint, one.touched) == (two.joint, two.touched)
        assert one.length_m == pytest.approx(two.length_m, abs=1e-3)


def test_the_sensors_that_count_are_those_that_the_robot_has(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    _, directory = uninterrupted
    rows = [row.split(",") for row in (directory / "readings.csv").read_text().splitlines()]
    kept = [column for column, name in enumerate(rows[0]) if "clearance" not in name]
    assert len(kept) < len(rows[0])
    table = tmp_path / "readings.csv"
    table.write_text("\n".join(",".join(row[column] for column in kept) for row in rows))
    shutil.copy(directory / "robot.json", tmp_path)
    order = make_order(tmp_path, f"file:{table}")
    result = identify(tmp_path / "run", order, HERE, Witness(), report=without_plots)
    assert result.modalities == ("touch", "tilt")


def test_a_run_whose_record_was_moved_goes_on_where_it_lies_now(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    result, directory = uninterrupted
    shutil.copytree(directory, tmp_path / "record")
    order = make_order(tmp_path, f"replay:{tmp_path}/record")
    with pytest.raises(KeyboardInterrupt):
        identify(tmp_path / "run", order, HERE, Witness(1), report=without_plots)
    (tmp_path / "record").rename(tmp_path / "moved")
    asked = r"record, where the readings of .*run come from, is not there: add --robot replay: and"
    with pytest.raises(RunDirectoryError, match=asked):
        resume(tmp_path / "run", HERE, Witness(), report=without_plots)
    moved = f"replay:{tmp_path}/moved"
    again = resume(tmp_path / "run", HERE, Witness(), robot=moved, report=without_plots)
    assert again.legs == result.legs


def test_a_record_that_was_changed_meanwhile_is_refused(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    _, directory = uninterrupted
    for name in ("readings.csv", "robot.json"):
        shutil.copy(directory / name, tmp_path)
    table = tmp_path / "readings.csv"
    order = make_order(tmp_path, f"file:{table}")
    with pytest.raises(KeyboardInterrupt):
        identify(tmp_path / "run", order, HERE, Witness(1), report=without_plots)
    head, first, *rest = table.read_text().splitlines()
    column = head.split(",").index("clearance_mm")
    cells = first.split(",")
    cells[column] = f"{float(cells[column]) + 10:.1f}"
    table.write_text("\n".join([head, ",".join(cells), *rest]))
    with pytest.raises(InteractionError, match="interaction 1: is no longer what this run has"):
        resume(tmp_path / "run", HERE, Witness(), report=without_plots)


def test_the_number_of_processes_does_not_show(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    result, directory = uninterrupted
    order = make_order(tmp_path, f"replay:{directory}")
    with on_this_computer(2) as executors:
        again = identify(tmp_path / "run", order, executors, Witness(), report=without_plots)
    assert outcome(again) == outcome(result)


# --- killed ---------------------------------------------------------------------------------------


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "estimator", *arguments, "--jobs", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def start_identify(folder: Path, uri: str) -> subprocess.Popen[str]:
    order = make_order(folder, uri)
    arguments = ["--robot", uri, "--problem", order.problem, "--seed", str(order.seed)]
    little = ("--method", "paper", "--jobs", "1")
    return start("identify", *little, *arguments, "--out", str(folder / "run"))


def kill(process: subprocess.Popen[str]) -> None:
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()


def test_killed_while_the_robot_moves_the_outcome_is_fetched(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    robot, witness = ModelRobot(manual=True), Witness()
    with serving(robot) as uri:
        process = start_identify(tmp_path, uri)
        assert robot.begun.acquire(timeout=120)
        kill(process)
        robot.complete()
        robot.manual = False
        result = resume(tmp_path / "run", HERE, witness, report=without_plots)
    assert "Interaction 1 was under way; its outcome was still there." in witness.heard
    assert len(robot.motions) == 2
    assert outcome(result) == outcome(uninterrupted[0])


def generations_reach(directory: Path, count: int) -> Callable[[], bool]:
    def reached() -> bool:
        try:
            return len(history(directory)) >= count
        except RunDirectoryError:
            return False

    return reached


def test_killed_while_it_models_nothing_is_lost(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    robot = ModelRobot()
    with serving(robot) as uri:
        process = start_identify(tmp_path, uri)
        reached = generations_reach(tmp_path / "run", 2)
        while not reached():
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.02)
        kill(process)
        result = resume(tmp_path / "run", HERE, Witness(), report=without_plots)
    assert outcome(result) == outcome(uninterrupted[0])
    assert len(robot.motions) == 2
    done, reference = history(tmp_path / "run"), history(uninterrupted[1])
    assert [item.errors for item in done] == [item.errors for item in reference]
    assert [item.best for item in done] == [item.best for item in reference]


def test_the_daemon_restarts_in_mid_motion(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    robot, witness = ModelRobot(manual=True), Witness()
    with serving(robot) as uri:
        process = start_identify(tmp_path, uri)
        assert robot.begun.acquire(timeout=120)
    fresh = ModelRobot()
    with serving(fresh, bind=uri):
        _, said = process.communicate(timeout=120)
        assert process.returncode == 1
        assert "the robot's daemon restarted while the motion was under way" in said
        assert f"Go on with: estimator resume {tmp_path / 'run'}" in said
        assert not fresh.motions
        result = resume(tmp_path / "run", HERE, witness, report=without_plots)
    assert any("performed anew" in sentence for sentence in witness.heard)
    assert len(fresh.motions) == 2
    assert outcome(result) == outcome(uninterrupted[0])


def test_a_robot_that_is_not_planar_waits_for_a_person(tmp_path: Path) -> None:
    robot = ModelRobot()
    robot.refusals.append(RobotError("not_planar", "It leans."))
    with serving(robot) as uri:
        with pytest.raises(InteractionError, match="as it lay or stood"):
            identify(
                tmp_path / "run",
                make_order(tmp_path, uri),
                HERE,
                Witness(),
                report=without_plots,
            )
        result = resume(tmp_path / "run", HERE, Witness(), report=without_plots)
    assert result.complete
    assert len(robot.motions) == 3


# --- refused --------------------------------------------------------------------------------------


def test_nothing_is_left_behind_where_no_robot_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("estimator.identification.robot_link.PATIENCE", 0.5)
    with serving(ModelRobot()) as uri:
        pass
    order = make_order(tmp_path, uri)
    with pytest.raises(RobotUnreachableError, match="no robot daemon runs"):
        identify(tmp_path / "run", order, HERE, Witness(), report=without_plots)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("changes", "kind", "sentence"),
    [
        ({"problem": "nonsense"}, ProblemError, "no problem named 'nonsense'"),
        ({"modalities": ("smell",)}, EstimatorError, "modalities must be"),
        ({"interactions": 9}, EstimatorError, "holds 2 interactions, not 9"),
        ({"physics": "clay"}, EstimatorError, "no physics 'clay': choose pybullet"),
        ({"explore": "boldly"}, EstimatorError, "no exploration rule 'boldly': choose information"),
    ],
)
def test_what_cannot_be_done_is_refused_with_a_sentence(
    tmp_path: Path,
    uninterrupted: tuple[Result, Path],
    changes: dict[str, object],
    kind: type[Exception],
    sentence: str,
) -> None:
    order = changed(make_order(tmp_path, f"replay:{uninterrupted[1]}"), **changes)
    with pytest.raises(kind, match=sentence):
        identify(tmp_path / "run", order, HERE, Witness(), report=without_plots)
    assert not (tmp_path / "run").exists()


def test_another_robot_cannot_take_a_run_over(tmp_path: Path) -> None:
    robot = ModelRobot()
    with serving(robot) as uri, pytest.raises(KeyboardInterrupt):
        identify(
            tmp_path / "run",
            make_order(tmp_path, uri),
            HERE,
            Witness(1),
            report=without_plots,
        )
    other = ModelRobot()
    object.__setattr__(other.capabilities, "base_mass", 9.0)
    with (
        serving(other) as uri,
        pytest.raises(InteractionError, match="other joints, sensors or another main body"),
    ):
        resume(tmp_path / "run", HERE, Witness(), report=without_plots, robot=uri)
    assert not other.motions


@pytest.mark.parametrize("interactions", [1, 2])
def test_a_record_does_not_answer_for_a_movement_that_it_never_made(
    tmp_path: Path, uninterrupted: tuple[Result, Path], interactions: int
) -> None:
    robot = ModelRobot()
    replay = changed(make_order(tmp_path, f"replay:{uninterrupted[1]}"), interactions=interactions)
    identify(tmp_path / "record", replay, HERE, Witness(), report=without_plots)
    with serving(robot) as uri:
        order = make_order(tmp_path, uri, seed=4)
        with pytest.raises(KeyboardInterrupt):
            identify(tmp_path / "run", order, HERE, Witness(1), report=without_plots)
        robot.refusals.append(RobotError("fault", "A servo fell off."))
        with pytest.raises(InteractionError, match="A servo fell off"):
            resume(tmp_path / "run", HERE, Witness(), report=without_plots)
    record = f"replay:{tmp_path / 'record'}"
    with pytest.raises(InteractionError, match="interaction 2: the record does not hold the motor"):
        resume(tmp_path / "run", HERE, Witness(), report=without_plots, robot=record)


def test_a_table_answers_for_the_programs_that_it_states_rounded(
    tmp_path: Path, uninterrupted: tuple[Result, Path]
) -> None:
    _, directory = uninterrupted
    with RunStore.open(directory, to_write=False) as store:
        planned = [item.program for item in store.interactions()]
    table = f"file:{directory}/readings.csv"
    link = open_robot(table, driven=lambda _: range(4), client_id="me", first_id=1)
    for number, program in enumerate(planned):
        assert program not in (link.recorded or ())
        felt = link.perform(number, program, None, lambda *_: None)
        assert felt.angles == pytest.approx(program, abs=1e-4)
