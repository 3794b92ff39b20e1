"""``docs/formats.md`` is true: its examples are read, run, and compared with what is written."""

from __future__ import annotations

import csv
import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from estimator import Result, RunConfig, identify
from estimator.cli.command_line import app
from estimator.report.result import result_schema
from sim_robot.world.sensor_noise import NoiseLevels, load_noise
from tests.estimator.little_effort import little_effort
from tests.once import made_once

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
SCHEMA = json.loads((ROOT / "docs" / "result.schema.json").read_text(encoding="utf-8"))
URDF = ROOT / "sim_robot" / "bodies" / "quadruped.urdf"


def blocks(section: str, language: str) -> list[str]:
    text = PAGE.partition(f"# {section}\n")[2]
    text = re.split(r"^##+ ", text, flags=re.MULTILINE)[0]
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def estimator(*arguments: str) -> None:
    ended = CliRunner().invoke(app, arguments)
    assert ended.exit_code == 0, ended.output


@pytest.fixture(scope="module")
def by_posterior(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run of the page's own commands, with all that other commands add to it."""
    return made_once("by_hand", _run_by_hand, tmp_path_factory) / "runs" / "by-hand"


def _run_by_hand(folder: Path) -> None:
    (table,), (robot,) = blocks("`readings.csv`", "csv"), blocks("`robot.json`", "json")
    (folder / "readings.csv").write_text(table)
    (folder / "robot.json").write_text(robot)
    (script,) = blocks("`robot.json`", "sh")
    with pytest.MonkeyPatch.context() as here, little_effort():
        here.chdir(folder)
        for line in script.splitlines():
            estimator(*shlex.split(line)[1:], "--jobs", "1")
        stiff = re.sub(r'(name="knee_\w+" type=)"revolute"', r'\1"fixed"', URDF.read_text())
        Path("truth.urdf").write_text(stiff)
        estimator("score", "runs/by-hand", "--truth", "truth.urdf", "--jobs", "1")


@pytest.fixture(scope="module")
def by_paper(tmp_path_factory: pytest.TempPathFactory, by_posterior: Path) -> Path:
    """A run of the other method on what was written down."""

    def run(folder: Path) -> None:
        _run_of_the_paper(folder / "run", by_posterior)

    return made_once("by_paper", run, tmp_path_factory) / "run"


def _run_of_the_paper(run: Path, by_posterior: Path) -> None:
    config = RunConfig(
        robot=f"file:{by_posterior / 'readings.csv'}",
        problem="topological",
        method="paper",
        physics="statics",
        population=8,
        generations=1,
        seed=1,
    )
    identify(run, config)


def files(run: Path) -> set[str]:
    return {str(path.relative_to(run)) for path in run.rglob("*") if path.is_file()}


def test_the_files_of_a_run_are_those_of_the_table(by_posterior: Path, by_paper: Path) -> None:
    (table,) = re.findall(r"^# A run directory\n\n(.*?)\n\n", PAGE.replace("##", "#"), re.M | re.S)
    rows = [row.split("|")[1] for row in table.splitlines()[2:]]
    assert {name for row in rows for name in re.findall(r"`(.+?)`", row)} == (
        files(by_posterior) | files(by_paper)
    )


def test_show_writes_what_was_deleted_again(by_posterior: Path, tmp_path: Path) -> None:
    run = tmp_path / "moved"
    run.mkdir()
    shutil.copy(by_posterior / "run.sqlite", run)
    estimator("show", str(run))
    scored = {"plots/lengths_with_truth.png", "score.json", "truth.urdf"}
    later = scored | {"validation.json", "run.lock"}
    assert files(run) == files(by_posterior) - later
    assert json.loads((run / "result.json").read_text()) == json.loads(
        (by_posterior / "result.json").read_text()
    )


def result_of(run: Path) -> dict[str, Any]:
    result: dict[str, Any] = json.loads((run / "result.json").read_text())
    return result


def test_the_schema_is_that_of_the_program() -> None:
    advice = "run: python -m estimator.report.result > docs/result.schema.json"
    assert result_schema() == SCHEMA, advice
    Draft202012Validator.check_schema(SCHEMA)
    for record in (SCHEMA, *SCHEMA["$defs"].values()):
        assert record.get("description"), f"{record['title']} lacks its meaning"
        for name, field in record.get("properties", {}).items():  # an enumeration has none
            assert field.get("description"), f"{record['title']}.{name} lacks its meaning"


def test_results_of_both_methods_follow_the_schema(by_posterior: Path, by_paper: Path) -> None:
    validator = Draft202012Validator(SCHEMA)
    for run, method in ((by_posterior, "posterior"), (by_paper, "paper")):
        result = result_of(run)
        assert result["method"] == method
        validator.validate(result)
        assert Result.model_validate(result).model_dump(mode="json") == result
        for name in Result.model_fields:
            assert not validator.is_valid({key: result[key] for key in result if key != name})
    assert not validator.is_valid({**result, "interactions": "two"})


def run_in(folder: Path, program: str) -> str:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout


def test_the_program_that_reads_a_result(by_posterior: Path, by_paper: Path) -> None:
    (program,) = blocks("`result.json`", "python")
    for run in (by_posterior, by_paper):
        lines = run_in(run, program).splitlines()
        legs = [f"hip_{side}: " for side in ("left", "front", "right", "back")]
        assert [line[: len(leg)] for line, leg in zip(lines, legs, strict=False)] == legs
        assert len(lines) == 4 + (run == by_posterior)


def test_the_samples_are_as_described(by_posterior: Path) -> None:
    with (by_posterior / "posterior.csv").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    (example,) = blocks("`posterior.csv`", "csv")
    shown, *samples = csv.reader(example.splitlines())
    assert header[: len(shown)] == shown
    assert {len(sample) for sample in samples} == {len(shown)}
    genes = result_of(by_posterior)["searched"]
    assert [name.removesuffix(" (mm)") for name in header] == [
        *("weight", *genes),
        *("tilt noise factor", "clearance noise factor"),
    ]
    assert sum(float(row[0]) for row in rows) == pytest.approx(1)
    (program,) = blocks("`posterior.csv`", "python")
    assert re.fullmatch(r"leg 1 sits on the left with \d+ %\n", run_in(by_posterior, program))


def test_a_validation_is_as_described(by_posterior: Path) -> None:
    (example,) = blocks("`validation.json`", "json")
    written = json.loads((by_posterior / "validation.json").read_text())

    def shape(value: object) -> object:
        return {key: shape(one) for key, one in value.items()} if isinstance(value, dict) else None

    assert shape(written) == shape(json.loads(example))


def test_the_noise_file_holds_the_defaults(tmp_path: Path) -> None:
    (example,) = blocks("Noise files", "toml")
    assert tomllib.loads(example) == asdict(NoiseLevels())
    (tmp_path / "noise.toml").write_text(example.replace("tilt_deg = 0.3", "tilt_deg = 0.5"))
    assert load_noise(str(tmp_path / "noise.toml")) == NoiseLevels(tilt_deg=0.5)
