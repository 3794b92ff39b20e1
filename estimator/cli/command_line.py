"""``estimator``: identifies a robot's body, and says how good the result is.

Exit codes: 0 done, 1 failed (with a sentence), 2 wrong usage, 3 ``monitor`` found the body changed.

A command's module is imported when the command is called: most of them load libraries for seconds
that others, and ``--help``, do not need. So the line that ``--help`` has of each stands here.
"""

from __future__ import annotations

import importlib
from importlib import metadata
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup
from typer.main import get_command

from protocol.system.process import interrupts_deferred

COMMANDS: Final = {
    "identify": (
        "identify:identify",
        "Identify a robot: act, sense, model, again and again.",
    ),
    "resume": (
        "identify:resume",
        "Go on with an interrupted run; the result is that of an uninterrupted one.",
    ),
    "show": (
        "show:show",
        "Show how far a run has come; writes the files of one that was broken off, if it can.",
    ),
    "score": (
        "evaluate:score",
        "Compare the best model with the true body (the objective error).",
    ),
    "report": (
        "results:report",
        "Write report.html: the body to be turned and posed, and all that is known of it.",
    ),
    "compare": (
        "results:compare",
        "Compare runs, finished or not, as a table and as a picture.",
    ),
    "validate": (
        "evaluate:validate",
        "Predict fresh motor programs, then perform them (the prediction error).",
    ),
    "pose": (
        "use:pose",
        "Move the robot so that its sensors read as wanted, whatever body it may have.",
    ),
    "monitor": (
        "use:monitor",
        "Move the robot now and then, and say whether its body is still the same; 3: it is not.",
    ),
    "diagnose": (
        "use:diagnose",
        "Find out by a few movements what has changed on the robot since it was identified.",
    ),
    "export": (
        "results:export",
        "Write a run's best model, or another one, as URDF, MJCF, JSON or a package for ROS 2.",
    ),
    "watch": (
        "live:watch",
        "Show a run on a page in the browser, also while another process works on it.",
    ),
    "doctor": (
        "doctor:doctor",
        "Find out whether a robot, and a problem, can be identified, and why not; moves nothing.",
    ),
    "reproduce": (
        "reproduce:command",
        "Do the paper's runs on simulated robots, and draw its figures; goes on where it was left.",
    ),
}
"""For each command its module in this package and its function, and what it does."""


class _Group(TyperGroup):
    """The group of commands; the function of a command is loaded when the command is called."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name, command, remaining_args = super().resolve_command(ctx, args)
        return name, command if name is None else command_named(name), remaining_args


def command_named(name: str) -> Any:
    """Returns a command as its function declares it."""
    module_name, function_name = COMMANDS[name][0].split(":")
    with interrupts_deferred():
        module = importlib.import_module(f"estimator.cli.{module_name}")
    command_app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    command_app.command(name)(getattr(module, function_name))
    return get_command(command_app)


app = typer.Typer(
    cls=_Group,
    help="Identifies a robot's body from what its sensors read when it moves.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for _name, (_, _help_line) in COMMANDS.items():
    app.command(_name, help=_help_line)(lambda: None)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"estimator (bodyschema) {metadata.version('bodyschema')}")
        raise typer.Exit


@app.callback()
def _before_any_command(
    *,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass
