"""The derived files of a run directory; everything in them comes from the run's database."""

from __future__ import annotations

import json
from typing import Final

from estimator.posterior.fitted import FittedPosterior
from estimator.readings import readings_csv
from estimator.report.page.run_page import PageSources, run_page
from estimator.report.plots.canvas import as_png
from estimator.report.plots.run import run_plots
from estimator.report.posterior import samples_csv
from estimator.report.result import Result
from estimator.report.summarise import summarise
from estimator.storage.store import READINGS, ROBOT, RunStore
from protocol.system.files import replace_bytes, replace_file, replace_text
from protocol.system.process import interrupts_deferred

RESULT: Final = "result.json"
POSTERIOR: Final = "posterior.csv"
PLOTS: Final = "plots"
BODY: Final = "plots/body.png"
PAGE: Final = "report.html"
LENGTHS_WITH_TRUTH: Final = "plots/lengths_with_truth.png"


def write_report(store: RunStore, *, plots: bool = True, page: bool = False) -> Result:
    """Writes all derived files and returns what ``result.json`` holds.

    Each file is replaced as a whole, so nobody reads half of one.

    Args:
        store: The run.
        plots: Whether to draw once the run is finished, which takes longer than all the rest.
        page: Whether to draw, and write ``report.html``, even though the run is not finished.
    """
    result = summarise(store)
    write_files(store, result, plots=page or (plots and result.complete), page=page)
    return result


@interrupts_deferred()
def write_files(store: RunStore, result: Result, *, plots: bool = True, page: bool = False) -> None:
    """Writes the derived files for a result that is known already.

    Args:
        store: The run.
        result: What is known of it.
        plots: Whether to draw.
        page: Whether to write ``report.html`` even though the run is not finished.

    Raises:
        OSError: The directory cannot be written.
    """
    joints = [joint.name for joint in store.capabilities.joints]
    replace_text(store.directory / RESULT, result.model_dump_json(indent=2) + "\n")
    replace_file(
        store.directory / READINGS,
        lambda path: readings_csv.write(path, joints, store.observations()),
    )
    robot = json.dumps(store.capabilities.to_map(), indent=2)
    replace_text(store.directory / ROBOT, robot + "\n")
    fitted = FittedPosterior.of(store)
    if fitted is not None and fitted.belief is not None:
        replace_file(store.directory / POSTERIOR, lambda path: samples_csv.write(path, fitted))
    if plots:
        drawn = run_plots(store, [leg.joint for leg in result.legs])
        for plot in drawn:
            replace_bytes(store.directory / PLOTS / f"{plot.name}.png", as_png(plot.figure))
        if page or result.complete:
            sources = PageSources.of(store, result, drawn)
            if sources.picture is not None:
                replace_bytes(store.directory / BODY, sources.picture)
            replace_text(store.directory / PAGE, run_page(store, sources))
