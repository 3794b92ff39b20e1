"""``estimator resume``: goes on with a run that was interrupted."""

from __future__ import annotations

from typing import Annotated

import typer

from estimator.cli.console import (
    err,
    errors_as_sentences,
    exit_if_unexplained,
    out,
    print_run_directory,
)
from estimator.cli.live import LIVE_BIND, LiveScreen, LiveView
from estimator.cli.options import (
    CORES,
    Dask,
    Directory,
    Jobs,
    Keys,
    Live,
    LiveBind,
    Strict,
    executors,
)
from estimator.identification.run import resume
from estimator.report.outcome import print_result
from estimator.report.run_files import write_report


def command(
    directory: Directory,
    *,
    robot: Annotated[
        str | None, typer.Option(help="Where the robot is now. Default: where it was.")
    ] = None,
    strict: Strict = False,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
    live: Live = False,
    live_bind: LiveBind = LIVE_BIND,
) -> None:
    """Go on with an interrupted run; the result is that of an uninterrupted one."""
    with errors_as_sentences(directory), LiveView(directory, live_bind if live else None) as view:
        with executors(jobs, dask) as workers, LiveScreen(err, view) as screen:
            result = resume(directory, workers, screen, robot=robot, keys=keys, report=write_report)
        print_result(out, result, directory)
        print_run_directory(directory)
        view.stay(err)
    if strict:
        exit_if_unexplained(result)
