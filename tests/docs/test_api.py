"""The programs of ``docs/extending.md`` are true: one identifies a simulated robot."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

from bench.daemons import simulator
from tests.docs.pages import ROOT, blocks, section

LIKELIHOOD, PROGRAM, ELSEWHERE, _ = blocks(section("extending", "From your own program"), "python")
(ASKED,) = blocks((ROOT / "README.md").read_text(encoding="utf-8"), "python")
QUESTIONS = ASKED.partition("\nwith RobotClient")[0] + LIKELIHOOD


def run(program: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", str(program)],
        cwd=program.parent,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_the_program_identifies_a_robot_with_parts_of_its_own(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    with simulator("--seed", "1") as robot:
        program.write_text(
            PROGRAM.replace("tcp://127.0.0.1:5750", robot.uri).replace(
                "explore=RULES.add(height),",
                "explore=RULES.add(height), interactions=2, generations=2, population=8,",
            ),
            encoding="utf-8",
        )
        ended = run(program)
    assert ended.returncode == 0, ended.stderr
    legs = re.findall(r"^(hip_\w+): \d+ mm$", ended.stdout, re.MULTILINE)
    assert legs == ["hip_left", "hip_front", "hip_right", "hip_back"]
    result = json.loads((tmp_path / "runs" / "mine" / "result.json").read_text())
    assert result["complete"]
    assert [result[name] for name in ("physics", "objective", "explore", "search")] == [
        "__main__:WeakServos",
        "__main__:SumOfErrors",
        "__main__:height",
        "deterministic-crowding",
    ]
    for part in ("physics", "objective", "explore"):
        assert result["versions"][result[part]] == "of the calling program"
    questions = tmp_path / "questions.py"
    parts = PROGRAM.partition("\nconfig = ")[0]
    asked = QUESTIONS.replace("runs/first", "runs/mine")
    questions.write_text(f"{parts}\nBACKENDS.add(WeakServos)\n{asked}", encoding="utf-8")
    answered = run(questions)
    assert answered.returncode == 0, answered.stderr
    assert re.search(r"^legs: \[.*\] mm$", answered.stdout, re.MULTILINE)
    assert re.search(r"^\[.*\]: in \d+ % of what may be$", answered.stdout, re.MULTILINE)
    assert answered.stdout.count("mean log-likelihood: ") == 2


def test_its_physics_serves_the_method_posterior_too(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    with simulator("--seed", "1") as robot:
        program.write_text(
            PROGRAM.replace("tcp://127.0.0.1:5750", robot.uri)
            .replace('    method="paper",\n', "    interactions=1,\n")
            .replace("    objective=OBJECTIVES.add(SumOfErrors),\n", "")
            .replace("    explore=RULES.add(height),\n", ""),
            encoding="utf-8",
        )
        ended = run(program)
    assert ended.returncode == 0, ended.stderr
    result = json.loads((tmp_path / "runs" / "mine" / "result.json").read_text())
    assert (result["method"], result["physics"]) == ("posterior", "__main__:WeakServos")


def test_its_work_is_done_by_the_workers_that_it_gives(tmp_path: Path) -> None:
    program = tmp_path / "elsewhere.py"
    with simulator("--seed", "1") as robot:
        program.write_text(
            ELSEWHERE.replace("tcp://127.0.0.1:5750", robot.uri)
            .replace("topological", "parametric")
            .replace("seed=1", "seed=1, interactions=1"),
            encoding="utf-8",
        )
        ended = run(program)
    assert ended.returncode == 0, ended.stderr
    result = json.loads((tmp_path / "runs" / "elsewhere" / "result.json").read_text())
    assert (result["method"], result["complete"]) == ("posterior", True)


def test_the_program_has_no_more_than_25_lines() -> None:
    assert sum(bool(line.strip()) for line in PROGRAM.splitlines()) <= 25
