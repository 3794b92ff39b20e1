"""The options that the commands of studies share, and how these do the runs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from estimator.cli.console import err, errors_as_sentences, fail
from estimator.cli.options import CORES
from estimator.cli.screen import Screen
from estimator.cluster import Cluster
from estimator.reproduction.harness import Run, complete
from protocol.text import command_line


def add_options(parser: argparse.ArgumentParser, out: Path) -> None:
    """Adds the options of where a study's runs are done and kept; ``out``: the default folder."""
    parser.add_argument("--jobs", type=int, default=CORES, help="runs at a time (%(default)s)")
    parser.add_argument("--dask", metavar="ADDRESS", help="of a scheduler, instead of --jobs")
    parser.add_argument("--out", type=Path, default=out, help="folder (%(default)s)")


def complete_by_command(runs: Sequence[Run], root: Path, options: argparse.Namespace) -> None:
    """Does the runs that are not finished; exits where one of them fails, or with Ctrl-C.

    Args:
        runs: Runs of the study.
        root: Directory of the study.
        options: Parsed options, as ``add_options`` defines them.
    """
    with (
        errors_as_sentences(None),
        nullcontext() if options.dask is None else Cluster(options.dask) as cluster,
        Screen(err) as screen,
    ):
        completed = complete(
            root,
            runs,
            screen,
            jobs=options.jobs,
            cluster=cluster,
            command=command_line(*sys.orig_argv[1:]),
        )
    if completed.failures:
        fail(f"{len(completed.failures)} runs failed: the same command tries them again", None)
