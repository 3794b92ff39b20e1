"""``estimator identify`` and ``resume``: a run to its end; ``RunConfig`` has the options of one."""

from __future__ import annotations

import inspect
import secrets
import time
from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import Annotated, Any, Final, get_args

import typer
from pydantic import ValidationError
from pydantic.fields import FieldInfo

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
from estimator.identification import run
from estimator.identification.method import Listener
from estimator.problem.values import complaint
from estimator.report.outcome import print_result
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import Executors

_NUMBER_TYPES: Final = (bool, int, float)


def _with_config(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command, which takes ``config``, an option for each field of ``RunConfig``."""

    @wraps(command)
    def with_options(**values: Any) -> None:
        fields = {name: values.pop(name) for name in RunConfig.model_fields}
        if (modalities := fields["modalities"]) is not None:
            fields["modalities"] = tuple(modality.strip() for modality in modalities.split(","))
        try:
            config = RunConfig(**fields)
        except ValidationError as error:
            raise typer.BadParameter(complaint(error, "such a run cannot be")) from error
        command(config=config, **values)

    declared = inspect.signature(command, eval_str=True).parameters
    options = [_option(name, field) for name, field in RunConfig.model_fields.items()]
    parameters = [*options, *(item for name, item in declared.items() if name != "config")]
    with_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {item.name: item.annotation for item in parameters}
    return with_options


def _option(name: str, field: FieldInfo) -> inspect.Parameter:
    """Makes a field an option: what is no number is text, and checked by ``RunConfig`` alone."""
    number_types = [kind for kind in _nested_types(field.annotation) if kind in _NUMBER_TYPES]
    kind: Any = number_types[0] if number_types else str
    default = field.default
    option = typer.Option(f"--{name.replace('_', '-')}", help=field.description)
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if field.is_required() else default,
        annotation=Annotated[kind if default is not None else kind | None, option],
    )


def _nested_types(annotation: Any) -> list[Any]:
    """All types in an annotation, also nested ones."""
    arguments = get_args(annotation)
    return [annotation, *(kind for argument in arguments for kind in _nested_types(argument))]


@_with_config
def identify(
    *,
    config: RunConfig,
    strict: Strict = False,
    jobs: Jobs = CORES,
    dask: Dask = None,
    keys: Keys = None,
    live: Live = False,
    live_bind: LiveBind = LIVE_BIND,
    directory: Annotated[
        Path | None, typer.Option("--out", help="Run directory. Default: a new one in runs/.")
    ] = None,
) -> None:
    """Identify a robot: act, sense, model, again and again."""
    seed = secrets.randbelow(2**32) if config.seed is None else config.seed
    name = f"{time.strftime('%Y%m%d-%H%M%S')}-{Path(config.problem).stem}-{seed}"
    place = directory or Path("runs") / name
    config = config.model_copy(update={"seed": seed})
    with errors_as_sentences(None):
        RunStore.check_free(place)
    work = partial(run.identify, place, config, keys=keys, report=write_report)
    bind = live_bind if live else None
    _carry_out(work, place, jobs=jobs, dask=dask, bind=bind, strict=strict)


def resume(
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
    work = partial(run.resume, directory, robot=robot, keys=keys, report=write_report)
    bind = live_bind if live else None
    _carry_out(work, directory, jobs=jobs, dask=dask, bind=bind, strict=strict)


def _carry_out(
    work: Callable[[Executors, Listener], Result],
    place: Path,
    *,
    jobs: int,
    dask: str | None,
    bind: str | None,
    strict: bool,
) -> None:
    """Does the work of a run, shown on the screen and on a page, and prints what came out."""
    with errors_as_sentences(place), LiveView(place, bind) as live_view:
        with executors(jobs, dask) as workers, LiveScreen(err, live_view) as screen:
            result = work(workers, screen)
        print_result(out, result, place)
        print_run_directory(place)
        live_view.stay(err)
    if strict:
        exit_if_unexplained(result)
