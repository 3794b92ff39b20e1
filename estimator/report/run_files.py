"""The derived files of a run directory; everything in them comes from the run's database."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from estimator.body.morphology import Array
from estimator.posterior.fitted import FittedPosterior
from estimator.problem.genome import Genome
from estimator.readings import readings_csv
from estimator.report.canvas import as_png
from estimator.report.page.run_page import run_page
from estimator.report.plots import run_plots
from estimator.report.result import PAGE, RESULT, Result, write_document
from estimator.report.summarise import summarise
from estimator.storage.store import READINGS, ROBOT, RunStore
from protocol.system.files import replace_bytes, replace_file, replace_text
from protocol.system.process import interrupts_deferred

POSTERIOR: Final = "posterior.csv"
PLOTS: Final = "plots"
BODY: Final = "plots/body.png"
LENGTHS_WITH_TRUTH: Final = "plots/lengths_with_truth.png"


def write_report(store: RunStore, *, plots: bool = True, page: bool = False) -> Result:
    """Writes all derived files and returns what ``result.json`` holds.

    Each file is replaced as a whole, so nobody reads half of one.

    Args:
        store: The run.
        plots: Whether to draw plots if the run is finished; this takes longer than all the rest.
        page: Whether to draw plots, and write ``report.html``, even if the run is not finished.
    """
    result = summarise(store)
    write_files(store, result, plots=page or (plots and result.complete), page=page)
    return result


@interrupts_deferred()
def write_files(store: RunStore, result: Result, *, plots: bool = True, page: bool = False) -> None:
    """Writes the derived files for a result that is known already.

    ``result.json`` comes last: ``show`` takes the others for those of a finished run by it.

    Args:
        store: The run.
        result: The run in numbers.
        plots: Whether to draw plots; without them no ``report.html`` is written.
        page: Whether to write ``report.html`` even if the run is not finished.

    Raises:
        OSError: The directory cannot be written.
    """
    joints = [joint.name for joint in store.capabilities.joints]
    replace_file(
        store.directory / READINGS,
        lambda path: readings_csv.write(path, joints, store.observations()),
    )
    robot = json.dumps(store.capabilities.to_map(), indent=2)
    replace_text(store.directory / ROBOT, robot + "\n")
    fitted = FittedPosterior.of(store)
    if fitted is not None and fitted.summary is not None:
        replace_file(store.directory / POSTERIOR, lambda path: write_samples(path, fitted))
    if plots:
        drawn = run_plots(store, [leg.joint for leg in result.legs])
        for plot in drawn:
            replace_bytes(store.directory / PLOTS / f"{plot.name}.png", as_png(plot.figure))
        if page or result.complete:
            html, picture = run_page(store, result, drawn)
            if picture is not None:
                replace_bytes(store.directory / BODY, picture)
            replace_text(store.directory / PAGE, html)
    write_document(store.directory / RESULT, result)


def write_samples(path: Path, fitted: FittedPosterior) -> None:
    """Writes ``posterior.csv``: the samples of a posterior, one row each.

    Columns: ``weight``; then per gene what it stands for (a word, or a quantity); then the factors
    on the expected noise of tilt and clearance.

    Args:
        path: The file.
        fitted: The posterior after the last interaction.
    """
    genome = fitted.genome
    names = [f"{gene.name} ({gene.unit})" if gene.unit else gene.name for gene in genome.genes]
    columns = [_values(genome, column, fitted.samples) for column in range(len(names))]
    samples = zip(fitted.weights.tolist(), *columns, fitted.scales.tolist(), strict=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["weight", *names, "tilt noise factor", "clearance noise factor"])
        for weight, *values, scales in samples:
            writer.writerow(
                [f"{weight:.12g}", *values, *(f"{math.exp(scale):.3f}" for scale in scales)]
            )


def _values(genome: Genome, column: int, genes: Array) -> Sequence[str]:
    if genome.genes[column].choices:
        return genome.words(column, genes)
    return [f"{value:.2f}" for value in genome.quantities(column, genes[:, column]).tolist()]
