"""What a person sees who presses Ctrl-C before a command got to its work."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path

import pytest

from protocol.system.missing_library import install_command
from robot.cli.command_line import main as robotd
from sim_robot.command_line import main as sim_robotd

pytestmark = pytest.mark.every_python
PROGRAM = "import sys; from robot.cli.startup import start; sys.exit(start('crawl', 'command'))"
PRESS = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"


def run(folder: Path, *, loading: str = "", working: str = "") -> subprocess.CompletedProcess[str]:
    (folder / "command.py").write_text(
        f"{loading}\nprint('loaded')\ndef main():\n    {working or 'pass'}\n    return 7\n"
    )
    return subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={"PYTHONPATH": f"{folder}:{Path(__file__).parents[3]}"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_command_says_how_it_ended(tmp_path: Path) -> None:
    ended = run(tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (7, "loaded\n", "")


@pytest.mark.parametrize("when", ["loading", "working"])
def test_an_interrupt_waits_for_the_libraries_and_ends_in_a_sentence(
    tmp_path: Path, when: str
) -> None:
    ended = run(tmp_path, **{when: PRESS})
    assert (ended.returncode, ended.stdout) == (1, "loaded\n")
    assert ended.stderr == "crawl: interrupted\n"


@pytest.mark.parametrize("lines", [1, 10_000])
def test_a_reader_that_leaves_is_no_error(tmp_path: Path, lines: int) -> None:
    (tmp_path / "command.py").write_text(
        f"def main():\n    print('much\\n' * {lines})\n    return 0\n"
    )
    left, written = os.pipe()
    os.close(left)
    with os.fdopen(written, "w") as nobody:
        ended = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            env={"PYTHONPATH": f"{tmp_path}:{Path(__file__).parents[3]}"},
            stdout=nobody,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (ended.returncode, ended.stderr) == (1, "")


@pytest.mark.parametrize("when", ["loading", "working"])
def test_what_is_not_installed_is_named(tmp_path: Path, when: str) -> None:
    ended = run(tmp_path, **{when: "import no_such_library.part"})
    assert ended.returncode == 1
    assert ended.stderr == (
        f"crawl: needs no_such_library, which is not installed: {install_command()}\n"
    )


@pytest.mark.parametrize(
    ("module", "extra", "library"),
    [
        ("estimator", "estimator", "numpy"),
        ("estimator", "estimator", "typer"),
        ("sim_robot", "sim", "numpy"),
        ("sim_robot", "sim", "pydantic_xml"),
    ],
)
def test_the_base_install_names_the_extra_and_its_version(
    module: str, extra: str, library: str
) -> None:
    code = f"""
import sys
class BaseInstall:
    def find_spec(self, name, path=None, target=None):
        if name == {library!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, BaseInstall())
from {module}.__main__ import main
sys.exit(main())
"""

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", code, *options],
            cwd=Path(__file__).parents[3],
            capture_output=True,
            text=True,
            check=False,
        )

    ended = run("--version")
    command = module.replace("sim_robot", "sim-robotd")
    version = metadata.version("bodyschema")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == f"{command} (bodyschema) {version}\n"
    ended = run("show", "DIR") if module == "estimator" else run("--help")
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.endswith(
        f": needs {library}, which is not installed: {install_command(extra)}\n"
    )
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("noted", "command"),
    [
        (
            {"url": "file:///home/ann/my%20checkout", "dir_info": {"editable": True}},
            "pip install --editable '/home/ann/my checkout[live]'",
        ),
        (
            {"url": "file:///home/ann/checkout", "dir_info": {}},
            "pip install '/home/ann/checkout[live]'",
        ),
        (
            {"url": "file:///tmp/body-1.whl", "archive_info": {}},
            "pip install '/tmp/body-1.whl[live]'",
        ),
        (
            {"url": "https://example.org/body-1.whl", "archive_info": {}},
            "pip install 'bodyschema[live] @ https://example.org/body-1.whl'",
        ),
        (
            {
                "url": "https://example.org/body.git",
                "vcs_info": {"vcs": "git", "requested_revision": "main", "commit_id": "0123abc"},
            },
            "pip install 'bodyschema[live] @ git+https://example.org/body.git@0123abc'",
        ),
        (None, "pip install 'bodyschema[live]'"),
    ],
)
def test_what_is_to_be_typed_names_where_it_was_installed_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, noted: object, command: str
) -> None:
    for place in ("in the way", "bodyschema"):
        info = tmp_path / place / "bodyschema-0.1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bodyschema\nVersion: 0.1.0\n")
    if noted is not None:
        (info / "direct_url.json").write_text(json.dumps(noted))
    monkeypatch.setattr(sys, "path", [str(tmp_path / "in the way"), str(tmp_path / "bodyschema")])
    assert install_command("live") == command


@pytest.mark.parametrize(("name", "main"), [("robotd", robotd), ("sim-robotd", sim_robotd)])
def test_version(
    name: str, main: Callable[[Sequence[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"{name} (bodyschema) {metadata.version('bodyschema')}\n"
