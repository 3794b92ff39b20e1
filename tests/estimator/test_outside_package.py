"""An installed package changes what a run does, without a line of ours; the run names it.

A physics from outside is in ``physics/test_backends.py``, servos and sensors in
``tests/docs/test_drivers.py``.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from estimator import Objective, Result, Rule, Search
from estimator.cli.command_line import app
from estimator.errors import EstimatorError, RunDirectoryError, TruthError
from estimator.identification.paper.search import SEARCHES
from estimator.identification.run import identify, resume
from estimator.report.formats import Format
from estimator.storage.database import reading
from estimator.storage.records import Generation
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS
from tests.estimator import outside_parts
from tests.estimator.identification.test_run import Witness, outcome
from tests.estimator.model_robot import ModelRobot, make_order, serving, without_plots
from tests.estimator.outside_package import PHYSICS, THUMB, install, put_on_path
from tests.estimator.report.made_runs import made_run

SEARCH: type[Search] = outside_parts.RandomSearch
OBJECTIVE: type[Objective] = outside_parts.WrongTouches
RULE: Rule = outside_parts.steepest
FORMAT: Format = outside_parts.page
PACKAGE = {"bodyschema-parts": "1.2"}
POINTS = """
[bodyschema.search]
random = bodyschema_parts:RandomSearch
[bodyschema.objective]
touches = bodyschema_parts:WrongTouches
[bodyschema.exploration]
steepest = bodyschema_parts:steepest
[bodyschema.report]
html = bodyschema_parts:page
"""
CODE = Path(outside_parts.__file__).read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package, installed."""
    folder = install(
        tmp_path / "outside", POINTS, name="bodyschema-parts", version="1.2", code=CODE
    )
    put_on_path(folder, monkeypatch)


def run(folder: Path, **choices: str) -> tuple[Result, list[Generation], list[str]]:
    """A run with the package's parts: its result, its generations, and why each program."""
    with serving(ModelRobot()) as uri:
        order = RunConfig(**{**vars(make_order(folder, uri)), "physics": "statics", **choices})
        result = identify(folder / "run", order, IN_THIS_PROCESS, Witness(), report=without_plots)
    with RunStore.open(folder / "run", to_write=False) as store:
        assert store.settings.plugins == PACKAGE
        reasons = [interaction.reason for interaction in store.interactions()]
        generations = store.generations()
    assert result.complete
    assert PACKAGE.items() <= result.versions.items()
    return result, generations, reasons


def show(directory: Path, form: str) -> str:
    """What ``estimator show`` prints, or complains."""
    return CliRunner().invoke(app, ["show", str(directory), "--format", form]).output


def test_a_package_that_is_installed_while_we_run_is_there(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    os.utime(outside, ns=(0, 0))  # else it may change within one tick of the clock of files
    assert "other" not in SEARCHES.names()
    install(outside, "[bodyschema.search]\nother = other:Search\n", name="other")
    assert {"random", "other"} <= set(SEARCHES.names())


def test_an_exploration_rule_that_looks_at_the_models(tmp_path: Path) -> None:
    result, _, reasons = run(tmp_path, explore="steepest")
    assert result.explore == "steepest"
    assert [reason.split(" by ")[0] for reason in reasons] == ["tilts"] * 2
    assert reasons[0] != reasons[1]


def test_another_aggregation_of_the_error(tmp_path: Path) -> None:
    result, generations, _ = run(tmp_path, objective="touches")
    assert result.objective == "touches"
    errors = np.array([generation.errors for generation in generations])
    assert errors.max() <= 8  # touches in two interactions
    assert np.array_equal(errors, errors.round())


def test_a_search_that_is_interrupted_and_resumed(tmp_path: Path) -> None:
    whole, generations, _ = run(tmp_path, search="random")
    assert whole.search == "random"
    best = [min(generation.errors) for generation in generations[3:]]  # on both interactions
    assert best == sorted(best, reverse=True)
    folder = tmp_path / "interrupted"
    folder.mkdir()
    with serving(ModelRobot()) as uri:
        order = RunConfig(
            **{**vars(make_order(folder, uri)), "physics": "statics", "search": "random"}
        )
        with pytest.raises(KeyboardInterrupt):
            identify(folder / "run", order, IN_THIS_PROCESS, Witness(4), report=without_plots)
        resumed = resume(folder / "run", IN_THIS_PROCESS, Witness(), report=without_plots)
    assert outcome(resumed) == outcome(whole)


def test_a_run_whose_package_is_gone_names_it_and_can_be_shown(tmp_path: Path) -> None:
    whole, *_ = run(tmp_path, search="random")
    shutil.rmtree(tmp_path / "outside")
    assert Result.model_validate(json.loads(show(tmp_path / "run", "json"))) == whole
    asked = "run was made with bodyschema-parts 1.2, which is not installed here: install it"
    with pytest.raises(RunDirectoryError, match=rf"{asked} \(there is no search 'random'"):
        resume(tmp_path / "run", IN_THIS_PROCESS, Witness(), report=without_plots)
    with (
        pytest.raises(RunDirectoryError, match=rf"{asked} \(no parameter is called 'cable'\)"),
        RunStore.open(tmp_path / "run", to_write=False) as store,
        reading(store.directory),
    ):
        raise ValueError("no parameter is called 'cable'")
    with (
        pytest.raises(TruthError, match="no such leg"),
        RunStore.open(tmp_path / "run", to_write=False),
    ):
        raise TruthError("no such leg")


def test_a_report_in_html(tmp_path: Path) -> None:
    result, *_ = run(tmp_path, explore="steepest")
    html = show(tmp_path / "run", "html")
    assert html.startswith("<!doctype html><title>legs</title><table><tr><td>left<td>")
    assert '<img src="plots/lengths.png">' in html
    assert Result.model_validate(json.loads(show(tmp_path / "run", "json"))) == result
    assert "there is no report format 'pdf': choose json, html" in show(tmp_path / "run", "pdf")


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (
            "raise LookupError('no such leg')",
            r"bodyschema-svg 0.1 failed in .*bodyschema_svg\.py, line 2: LookupError: no such leg",
        ),
        (
            "raise OSError(28, 'No space left', 'legs.svg')",
            r"bodyschema-svg 0.1 failed in .*, line 2: OSError: \[Errno 28\] No space left",
        ),
        (
            "return None",
            "the report format 'svg' of bodyschema-svg 0.1 gave None: it must give text",
        ),
    ],
)
def test_a_report_format_that_fails_is_named(
    body: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = "[bodyschema.report]\nsvg = bodyschema_svg:write\n"
    code = f"def write(result, directory):\n    {body}\n"
    folder = install(tmp_path / "svg", points, name="bodyschema-svg", version="0.1", code=code)
    put_on_path(folder, monkeypatch)
    assert re.match(
        f"estimator: {reason}", show(made_run(tmp_path / "run", "parametric", "posterior"), "svg")
    )


FAILS = """
from bodyschema_parts import RandomSearch, WrongTouches
from estimator import StaticsPhysics


def fail(*given, **named):
    raise LookupError("no such leg")


class Search(RandomSearch):
    ask = fail


class Objective(WrongTouches):
    total = fail


class Physics(StaticsPhysics):
    read_bodies = fail


class Unmade:
    algorithm = "none"
    __init__ = fail
"""


@pytest.mark.parametrize(
    ("part", "point"),
    [
        ("explore", "exploration]\nbad = bodyschema_bad:fail"),
        ("search", "search]\nbad = bodyschema_bad:Unmade"),
        ("search", "search]\nbad = bodyschema_bad:Search"),
        ("objective", "objective]\nbad = bodyschema_bad:Unmade"),
        ("objective", "objective]\nbad = bodyschema_bad:Objective"),
        ("physics", "physics]\nbad = bodyschema_bad:Physics"),
    ],
)
def test_a_part_of_a_run_that_fails_is_named(
    part: str, point: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = f"[bodyschema.{point}\n"
    folder = install(tmp_path / "bad", points, name="bodyschema-bad", version="0.1", code=FAILS)
    put_on_path(folder, monkeypatch)
    sentence = "bodyschema-bad 0.1 failed in .*bodyschema_bad.py, line 7: LookupError: no such leg"
    with pytest.raises(EstimatorError, match=sentence):
        run(tmp_path, **{part: "bad"})


@pytest.mark.parametrize(
    ("method", "given", "sentence"),
    [
        ("terms", "-1.0", "gave -1.0 for 8 models: it must give each an error of at least 0"),
        ("total", "terms[0] * float('nan')", "gave .*nan.* in total of 8 models: it must give"),
    ],
)
def test_an_objective_that_gives_no_error_of_a_model_is_refused(
    method: str, given: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = f"""
from bodyschema_parts import WrongTouches


class Bad(WrongTouches):
    def {method}(self, terms, *others):
        return {given}
"""
    points = "[bodyschema.objective]\nbad = bodyschema_bad:Bad\n"
    folder = install(tmp_path / "bad", points, name="bodyschema-bad", version="0.1", code=code)
    put_on_path(folder, monkeypatch)
    with pytest.raises(EstimatorError, match=f"the objective Bad {sentence}"):
        run(tmp_path, objective="bad")


def test_all_together_and_a_physics_of_a_second_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(install(tmp_path / "thumb", THUMB, code=PHYSICS), monkeypatch)
    monkeypatch.setitem(PACKAGE, "bodyschema-thumb", "0.3")
    result, *_ = run(
        tmp_path, physics="thumb", search="random", objective="touches", explore="steepest"
    )
    assert (result.physics, result.search) == ("thumb", "random")
    assert (result.objective, result.explore) == ("touches", "steepest")
