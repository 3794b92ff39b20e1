"""``estimator validate``: fresh motor programs, predicted and then performed."""

from __future__ import annotations

from contextlib import closing
from typing import Annotated

import typer

from estimator.cli.console import err, errors_as_sentences, out
from estimator.cli.options import CORES, Dask, Directory, Jobs, Keys, Robot, computers
from estimator.cli.screen import Screen
from estimator.evaluation.validate import validate
from estimator.identification.run import reconnect
from estimator.report.evaluations import VALIDATION, print_validation
from estimator.storage.store import RunStore
from protocol.system.replace_file import replace_text


def command(
    directory: Directory,
    robot: Robot,
    *,
    programs: Annotated[int, typer.Option(min=1, help="Fresh motor programs.")] = 20,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
) -> None:
    """Predict fresh motor programs, then perform them (the prediction error)."""
    with (
        errors_as_sentences(None),
        RunStore.open(directory) as store,
        computers(jobs, dask) as opened,
        Screen(err) as screen,
    ):
        with (
            closing(opened.open_physics(store.settings.physics, store.world)) as physics,
            closing(reconnect(store, robot, screen, keys=keys)) as link,
        ):
            validation = validate(store, physics, link, programs=programs, listener=screen)
        replace_text(directory / VALIDATION, validation.model_dump_json(indent=2) + "\n")
    print_validation(out, validation)
    out.print(f"Saved: {directory / VALIDATION}", soft_wrap=True)
