"""The command line, as a person uses it: sentences, exit codes, files."""

from __future__ import annotations

import json
import os
import resource
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from typer.testing import CliRunner, Result

from estimator.cli.command_line import COMMANDS, app
from estimator.report import result, summarise
from estimator.report.evaluations import read_true_body
from estimator.storage.store import RunStore
from tests.estimator.evaluation.test_score import make_ended_run, make_run, write_truth
from tests.estimator.identification.test_run import generations_reach, start_identify
from tests.estimator.little_effort import little_effort
from tests.estimator.model_robot import (
    TRUE_LENGTHS,
    ModelRobot,
    make_capabilities,
    make_order,
    serving,
)
from tests.estimator.report.made_runs import made_run


def estimator(*arguments: str | Path) -> Result:
    with little_effort():
        return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three interactions, written down by hand."""
    folder = tmp_path_factory.mktemp("by_hand")
    (folder / "robot.json").write_text(json.dumps(make_capabilities().to_map()))
    path = folder / "readings.csv"
    path.write_text(
        "angle_deg_left,angle_deg_front,angle_deg_right,angle_deg_back,"
        "touch_1,touch_2,touch_3,touch_4,tilt_lr_deg,tilt_fb_deg,clearance_mm\n"
        "-25,10,-20,15,1,0,1,0,2,0.5,40\n"
        "10,-20,5,-30,0,1,0,1,,-3,35\n"
        "20,20,20,20,0,0,0,0,0,0,0\n"
    )
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, readings: Path) -> Path:
    folder = tmp_path_factory.mktemp("cli")
    problem = make_order(folder, "").problem
    ended = estimator(
        *("identify", "--robot", f"file:{readings}", "--problem", problem, "--seed", "1"),
        *(
            "--method",
            "paper",
            "--population",
            "4",
            "--generations",
            "1",
            "--jobs",
            "1",
            "--out",
            folder / "run",
        ),
    )
    assert ended.exit_code == 0, ended.output
    assert "Interaction 3" in ended.stderr
    assert "Sensor (subjective) error" in ended.stdout
    return folder / "run"


def test_identify_takes_all_that_was_recorded(run: Path) -> None:
    result = json.loads((run / "result.json").read_text())
    assert result["complete"]
    assert result["interactions"] == 3
    assert (result["population"], result["generations"]) == (4, 1)
    assert result["simulations_requested"] == 4 * (1 + 1 + 2 + 2 + 3 + 3)
    assert (run / "plots" / "lengths.png").exists()


@pytest.mark.parametrize("method", ["paper", "posterior"])
def test_readings_that_nothing_explains_come_first_and_fail_a_strict_run(
    tmp_path: Path, readings: Path, method: str
) -> None:
    problem = make_order(tmp_path, "").problem
    shutil.copy(readings.parent / "robot.json", tmp_path)
    columns = readings.read_text().splitlines()[0]
    on_end = "20,-20,20,-20,0,0,0,0,60,-50,0\n"  # on its edge, and flat on the ground
    (tmp_path / "readings.csv").write_text(f"{columns}\n{3 * on_end}")
    ended = estimator(
        *("identify", "--robot", f"file:{tmp_path / 'readings.csv'}", "--problem", problem),
        *("--seed", "1", "--method", method, "--jobs", "1", "--strict", "--out", tmp_path / "run"),
    )
    assert ended.exit_code == 1, ended.output
    wanted = {"paper": "NO BODY LIKE THE BEST MODEL explains", "posterior": "NO BODY THAT"}
    assert ended.stdout.startswith(f"Not found: no body explains it all.\n{wanted[method]}")
    _, checks, advice = ended.stdout.partition("Check, the likeliest first:\n")
    assert checks
    assert [line[:4] for line in advice.splitlines()[:5]] == [f"  {n}." for n in range(1, 6)]
    assert (tmp_path / "run" / "result.json").exists()
    assert wanted[method] in estimator("show", tmp_path / "run").stdout
    assert estimator("resume", tmp_path / "run").exit_code == 0
    assert estimator("resume", tmp_path / "run", "--strict").exit_code == 1


@pytest.mark.parametrize("method", ["paper", "posterior"])
def test_readings_that_are_explained_pass_a_strict_run(tmp_path: Path, method: str) -> None:
    path = Path(make_order(tmp_path, "").problem)
    text = path.read_text()
    for true in TRUE_LENGTHS:  # a small population finds what is nearly known
        near = f"length = [{true - 0.001:.3f}, {true + 0.001:.3f}]"
        text = text.replace("length = [0.05, 0.25]", near, 1)
    path.write_text(text)
    with serving(ModelRobot()) as uri:
        ended = estimator(
            *("identify", "--robot", uri, "--problem", path, "--seed", "1", "--method", method),
            *("--jobs", "1", "--strict", "--out", tmp_path / "run"),
        )
    assert ended.exit_code == 0, ended.output
    wanted = {"paper": "The best model explains every", "posterior": "Some body that this problem"}
    first, second, *_ = ended.stdout.splitlines()
    assert first.startswith("4 legs")
    assert second.startswith(wanted[method])


def test_show_says_how_far_a_run_has_come(run: Path) -> None:
    ended = estimator("show", run, "--details")
    assert ended.exit_code == 0
    assert "Problem legs, seed 1" in ended.stdout
    assert "Not finished" not in ended.stdout
    assert "in the population (mm)" in ended.stdout


def test_score_as_json_is_nothing_but_json(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.2, 0.16))
    store.close()
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4)
    ended = estimator("score", tmp_path / "run", "--truth", truth, "--json", "--jobs", "1")
    assert ended.exit_code == 0, ended.output
    assert json.loads(ended.stdout)["mean_leg_error_m"] == pytest.approx(0.015)
    assert (tmp_path / "run" / "plots" / "lengths_with_truth.png").exists()


def test_score_keeps_a_true_body_in_the_encoding_that_it_declares(tmp_path: Path) -> None:
    make_run(tmp_path, (0.17, 0.15, 0.2, 0.16)).close()
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4)
    text = truth.read_text("utf-8").replace('name="r"', 'name="Käfer"')
    truth.write_text(f'<?xml version="1.0" encoding="ISO-8859-1"?>{text}', "latin-1")
    ended = estimator("score", tmp_path / "run", "--truth", truth, "--jobs", "1")
    assert ended.exit_code == 0, ended.output
    kept = read_true_body(tmp_path / "run")
    assert kept is not None
    assert kept.name == "Käfer"


def test_score_for_people_parts_legs_that_never_touched(tmp_path: Path) -> None:
    store = make_run(tmp_path, (0.17, 0.15, 0.2, 0.16))
    store.close()
    truth = write_truth(tmp_path / "t.urdf", lengths=(0.16,) * 4)
    ended = estimator("score", tmp_path / "run", "--truth", truth, "--jobs", "1")
    text = " ".join(ended.stdout.split())
    assert "+40.0 never" in text
    assert "legs that touched the ground 6.7 mm; legs that never did 40.0 mm" in text
    assert "given by the problem, not searched" in text


def test_validate_over_the_wire(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("estimator.evaluation.validate.RANDOM_MODELS", 4)
    store = make_ended_run(tmp_path, TRUE_LENGTHS)
    store.close()
    with serving(ModelRobot()) as uri:
        ended = estimator(
            "validate", tmp_path / "run", "--robot", uri, "--programs", "2", "--jobs", "1"
        )
    assert ended.exit_code == 0, ended.output
    assert "Prediction error on 2 fresh motor programs" in ended.stdout
    saved = json.loads((tmp_path / "run" / "validation.json").read_text())
    assert saved["best_model"]["touch"] == 0


def test_a_validation_whose_outcome_was_not_written_is_told_and_moves_nothing_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("estimator.evaluation.validate.RANDOM_MODELS", 4)
    make_ended_run(tmp_path, TRUE_LENGTHS).close()
    robot, file = ModelRobot(), tmp_path / "run" / "validation.json"
    with serving(robot) as uri:
        command = ("validate", tmp_path / "run", "--robot", uri, "--programs", "2", "--jobs", "1")
        file.mkdir()  # so that no such file can be written
        unwritten = estimator(*command)
        assert unwritten.exit_code == 0, unwritten.output
        assert "cannot be written" in unwritten.stderr
        file.rmdir()
        written = estimator(*command)
        assert len(robot.motions) == 2
        outcome = file.read_text()
        estimator(*command)
        assert len(robot.motions) == 4
        file.write_text(outcome)  # as if the second had been killed before it wrote its own
        estimator(*command)
        assert len(robot.motions) == 4
    assert "Prediction error on 2 fresh motor programs" in unwritten.stdout
    assert written.stdout == f"{unwritten.stdout}Saved: {file}\n"
    assert file.read_text() != outcome


def test_ctrl_c_leaves_a_run_that_can_be_resumed(tmp_path: Path) -> None:
    with serving(ModelRobot()) as uri:
        process = start_identify(tmp_path, uri)
        reached = generations_reach(tmp_path / "run", 1)
        while not reached():
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.02)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120)
        assert process.returncode == 1
        assert "estimator: interrupted" in said
        assert f"estimator resume {tmp_path / 'run'}" in said
        assert "Traceback" not in said
        ended = estimator("resume", tmp_path / "run", "--jobs", "1")
    assert ended.exit_code == 0, ended.output
    assert "Not finished" not in ended.stdout


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["resume", "nowhere"], "nowhere holds no run"),
        (["show", "nowhere"], "nowhere holds no run"),
        (["score", "nowhere", "--truth", "body.urdf"], "nowhere holds no run"),
        (["identify", "--robot", "bob", "--problem", "parametric"], "'bob' names no robot"),
        (["identify", "--robot", "bob", "--problem", "x.toml"], "x.toml cannot be read"),
        (
            ["identify", "--robot", "file:no.csv", "--problem", "parametric"],
            "no.csv cannot be read",
        ),
    ],
)
def test_failure_is_a_sentence_and_exit_code_1(arguments: list[str], sentence: str) -> None:
    ended = estimator(*arguments)
    assert ended.exit_code == 1
    assert f"estimator: {sentence}" in ended.stderr
    assert not ended.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ["identify"],
        ["identify", "--robot", "bob", "--problem", "parametric", "--seed", "-1"],
        ["identify", "--robot", "bob", "--problem", "parametric", "--jobs", "0"],
        ["score", "run"],
        ["dance"],
    ],
)
def test_wrong_usage_is_exit_code_2(arguments: list[str]) -> None:
    assert estimator(*arguments).exit_code == 2


def test_a_run_is_not_overwritten(run: Path, readings: Path) -> None:
    problem = run.parent / "legs.toml"
    ended = estimator("identify", "--robot", f"file:{readings}", "--problem", problem, "--out", run)
    assert ended.exit_code == 1
    assert "holds a run already" in ended.stderr


@pytest.mark.parametrize("options", [(), ("--live", "--live-bind", "x")])
def test_of_an_older_run_nobody_says_that_it_goes_on(run: Path, options: tuple[str, ...]) -> None:
    """What failed would have been another one."""
    problem = run.parent / "legs.toml"
    ended = estimator("identify", "--robot", "bob", "--problem", problem, "--out", run, *options)
    assert ended.exit_code == 1
    assert "holds a run already" in ended.stderr
    assert "The run is safe" not in ended.stderr


def test_a_hand_written_table_with_a_missing_column_is_a_sentence(
    tmp_path: Path, readings: Path
) -> None:
    shutil.copy(readings.with_name("robot.json"), tmp_path)
    lines = readings.read_text().splitlines()
    table = "\n".join(line.partition(",")[2] for line in lines)
    (tmp_path / "readings.csv").write_text(table)
    problem = make_order(tmp_path, "").problem
    ended = estimator(
        *("identify", "--robot", f"file:{tmp_path}/readings.csv", "--problem", problem),
        *("--out", tmp_path / "run"),
    )
    assert ended.exit_code == 1
    assert "write the columns angle_deg_left" in ended.stderr
    assert not (tmp_path / "run").exists()


def test_a_run_that_another_process_works_on_is_left_alone(run: Path) -> None:
    with RunStore.open(run):
        ended = estimator("resume", run)
        assert ended.exit_code == 1
        assert "Another process works on" in ended.stderr
        assert estimator("show", run).exit_code == 0


@pytest.mark.parametrize("begins", ["before", "meanwhile"])
def test_show_leaves_the_files_of_a_run_to_the_process_that_works_on_it(
    begins: str, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which may end just when ``show`` has read the run, and then has written what is final."""
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    final = (copy / "result.json").read_bytes()
    (copy / "result.json").unlink()
    writer, summary = RunStore.open(copy) if begins == "before" else None, summarise.summarise

    def summarised_while_the_writer_ends(store: RunStore) -> result.Result:
        found = summary(store)
        with writer or RunStore.open(copy):
            (copy / "result.json").write_bytes(final)
        return found.model_copy(update={"complete": False})

    monkeypatch.setattr(summarise, "summarise", summarised_while_the_writer_ends)
    assert estimator("show", copy).exit_code == 0
    assert (copy / "result.json").read_bytes() == final


def test_help_lists_the_commands() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "estimator", "--help"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    for command in ("identify", "resume", "show", "score", "validate", "doctor", "reproduce"):
        assert command in said.split()


LARGE = "numpy pydantic scipy numba llvmlite pybullet mujoco matplotlib jinja2 distributed"


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (("--help",), ""),
        (("show", "DIR"), "numpy pydantic"),
        (("doctor", "--robot", "tcp://127.0.0.1:1"), "numpy pydantic"),
    ],
    ids=["help", "show", "doctor"],
)
def test_a_command_loads_no_large_library_that_it_does_not_use(
    run: Path, arguments: tuple[str, ...], needed: str
) -> None:
    code = f"""
import sys
from estimator.__main__ import main
sys.argv = {["estimator", *(str(run) if word == "DIR" else word for word in arguments)]!r}
try:
    main()
finally:
    print(*sorted(set({LARGE.split()!r}) & sys.modules.keys()))
"""
    ended = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True
    )
    loaded = ended.stdout.splitlines()[-1].split()
    assert set(loaded) <= set(needed.split()), ended.stderr


def test_help_says_of_each_command_what_its_own_help_says() -> None:
    for name, (_, does) in COMMANDS.items():
        said = " ".join(estimator(name, "--help").stdout.replace("│", " ").split())
        assert does in said


def test_show_prints_what_a_finished_run_has_kept(run: Path, tmp_path: Path) -> None:
    """And writes all of it again where its result is gone, damaged, or of another version."""
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    kept = copy / "result.json"
    text, expected = kept.read_text(), estimator("show", copy).stdout
    before = kept.stat().st_mtime_ns
    assert estimator("show", copy).stdout == expected
    assert kept.stat().st_mtime_ns == before
    version = metadata.version("bodyschema")
    for damaged in (None, "{", text.replace(f'"bodyschema": "{version}"', '"bodyschema": "0.0"')):
        assert damaged != text
        kept.unlink()
        if damaged is not None:
            kept.write_text(damaged)
        assert estimator("show", copy).stdout == expected
        assert kept.read_text() == text


def test_version() -> None:
    ended = estimator("--version")
    assert ended.exit_code == 0
    assert ended.stdout == f"estimator (bodyschema) {metadata.version('bodyschema')}\n"


@pytest.mark.parametrize("library", ["numpy", "rich.console"])
def test_ctrl_c_while_the_libraries_load_is_no_traceback(library: str) -> None:
    code = f"""
import os, signal, sys
class Interruption:
    def find_spec(self, name, path=None, target=None):
        if name == {library!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interruption())
from estimator.__main__ import main
sys.argv = ["estimator", "show", "nowhere"]
main()
"""
    ended = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True
    )
    assert (ended.returncode, ended.stderr) == (1, "estimator: interrupted\n")


EVIL = "le[/x]ft $\\frac{ \x1b[31m"


def test_a_joint_may_have_any_name(tmp_path: Path, readings: Path) -> None:
    for name in ("readings.csv", "robot.json"):
        escaped = json.dumps(EVIL)[1:-1] if name == "robot.json" else EVIL
        text = readings.with_name(name).read_text().replace("left", escaped)
        (tmp_path / name).write_text(text)
    run = tmp_path / "run"
    ended = estimator(
        *("identify", "--robot", f"file:{tmp_path / 'readings.csv'}", "--seed", "1"),
        *("--problem", make_order(tmp_path, "").problem, "--population", "2"),
        *(
            "--method",
            "paper",
            "--generations",
            "1",
            "--physics",
            "statics",
            "--jobs",
            "1",
            "--out",
            run,
        ),
    )
    assert ended.exit_code == 0, ended.output
    shown = estimator("show", run)
    assert shown.exit_code == 0, shown.output
    assert "le[/x]ft" in shown.stdout
    assert "\x1b" not in ended.output + shown.output


@contextmanager
def unwritable(folder: Path) -> Iterator[None]:
    """A directory that this process can read and not write, also where root runs the tests."""
    for place in (folder, *(path for path in folder.rglob("*") if path.is_dir())):
        place.chmod(0o555)
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)  # nobody
    try:
        yield
    finally:
        os.seteuid(user)
        for place in (folder, *(path for path in folder.rglob("*") if path.is_dir())):
            place.chmod(0o755)


def commands_on(directory: Path, readings: Path, problem: str) -> list[tuple[str | Path, ...]]:
    """All that look at a run directory or make one."""
    return [
        ("identify", "--robot", f"file:{readings}", "--problem", problem, "--out", directory),
        ("identify", "--robot", f"replay:{directory}", "--problem", problem, "--out", "unused"),
        ("resume", directory),
        ("show", directory),
        ("report", directory),
        ("compare", directory, directory),
        ("export", directory, "--format", "urdf"),
        ("score", directory, "--truth", "body.urdf"),
        ("validate", directory, "--robot", "tcp://127.0.0.1:1"),
        ("watch", directory),
        ("reproduce", "fig2", "--out", directory),
    ]


def test_a_name_that_is_too_long_is_a_sentence(tmp_path: Path, readings: Path) -> None:
    long = tmp_path / (256 * "n")
    for command in commands_on(long, readings, make_order(tmp_path, "").problem):
        ended = estimator(*command)
        assert ended.exit_code == 1, ended.output
        assert str(long) in ended.stderr
        assert ended.stderr.endswith(": File name too long.\n")
        assert "Errno" not in ended.stderr


@contextmanager
def closed_to_us(folder: Path) -> Iterator[None]:
    """A directory that this process may not enter, also where root runs the tests."""
    folder.chmod(0)
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)  # nobody
    try:
        yield
    finally:
        os.seteuid(user)
        folder.chmod(0o755)


def test_a_folder_of_somebody_else_is_a_sentence(readings: Path) -> None:
    with TemporaryDirectory() as name:  # pytest's is closed
        folder = Path(name)
        folder.chmod(0o755)
        for file in (readings, readings.with_name("robot.json")):
            shutil.copy(file, folder)
        private = folder / "private"
        private.mkdir()
        make_run(private, (0.17, 0.15, 0.2, 0.16)).close()
        problem = make_order(folder, "").problem
        run, table = private / "run", folder / readings.name
        commands = commands_on(run, table, problem)
        for command in commands:  # with what libraries load late
            estimator(command[0], "--help")
        with closed_to_us(private):
            ended = [estimator(*command) for command in commands]
    for item in ended:
        assert item.exit_code == 1, item.output
        assert str(run) in item.stderr
        assert item.stderr.endswith(": Permission denied.\n")
        assert "Errno" not in item.stderr


def test_show_score_report_and_compare_need_no_writable_directory() -> None:
    with TemporaryDirectory() as name, TemporaryDirectory() as open_to_all:  # pytest's is closed
        folder = Path(name)
        folder.chmod(0o755)
        store = make_run(folder, (0.17, 0.15, 0.2, 0.16))
        store.close()
        truth = write_truth(folder / "t.urdf", lengths=(0.16,) * 4)
        elsewhere, run = Path(open_to_all), folder / "run"
        elsewhere.chmod(0o777)
        commands = (
            ("show", run),
            ("score", run, "--truth", truth),
            ("report", run, "--out", elsewhere / "report.html"),
            ("compare", run, run, "--out", elsewhere / "comparison.png"),
        )
        for command in commands:  # with what libraries load late
            assert estimator(*command).exit_code == 0
        before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
        with unwritable(folder):
            ended = [estimator(*command) for command in commands]
            refused = estimator("report", run)
        assert len(list(elsewhere.iterdir())) == 2
        assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    for item in ended:
        assert item.exit_code == 0, item.output
        assert "not finished" in item.stdout.lower()
    for item in ended[:2]:
        assert "cannot be written (Permission denied): files there may be missing or" in item.stderr
    assert refused.exit_code == 1
    assert "say where the report is to go, with --out FILE" in refused.stderr


def test_show_says_that_files_are_missing_and_how_to_get_them(tmp_path: Path) -> None:
    place = made_run(tmp_path / "my run", "parametric", "paper", complete=False)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        ended = estimator("show", place)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert ended.exit_code == 0, ended.output
    assert (place / "readings.csv").exists()
    assert not (place / "result.json").exists()
    assert "(File too large): files there may be missing or old." in ended.stderr
    _, command, _ = ended.stderr.split("`")
    assert shlex.split(command) == ["estimator", "show", str(place)]
    assert not estimator(*shlex.split(command)[1:]).stderr
    assert (place / "result.json").exists()
