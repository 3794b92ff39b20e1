"""The plots of a run: which there are, and what is to be seen in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from estimator.posterior.fitted import FittedPosterior
from estimator.report.plots.canvas import new_axes
from estimator.report.plots.generations import draw_errors, draw_lengths
from estimator.report.plots.posterior import plot_belief, plot_interval_lengths
from estimator.storage.records import Generation
from estimator.storage.store import RunStore

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LENGTHS: Final = "lengths"


@dataclass(frozen=True, kw_only=True)
class RunPlot:
    """One plot.

    Attributes:
        name: Stem of its file.
        caption: What is to be seen, for those who see it and for those who do not.
        figure: The plot.
    """

    name: str
    caption: str
    figure: Figure


def run_plots(
    store: RunStore, names: Sequence[str], true_lengths: Sequence[float] = ()
) -> tuple[RunPlot, ...]:
    """Draws what a run has to show so far; nothing where nothing was learnt yet.

    Args:
        store: The run.
        names: Names of the legs' joints.
        true_lengths: Of each leg, m, where they are known.
    """
    true = "; dots at the right: the true lengths" if true_lengths else ""
    history = FittedPosterior.history(store)
    if history:
        beliefs = [one.belief for one in history if one.belief is not None]
        expected = [item.bits for item in store.interactions()][: len(beliefs)]
        return (
            RunPlot(
                name="belief",
                caption="Stated probability of the attachments after each interaction, and the "
                "information that it was expected to give and gave.",
                figure=plot_belief(beliefs, expected),
            ),
            RunPlot(
                name=LENGTHS,
                caption="Length of each leg after each interaction: median and 90 % interval"
                f"{true}.",
                figure=plot_interval_lengths(history, names, true_lengths),
            ),
        )
    generations = with_last_word(store)
    if not generations:
        return ()
    (errors, errors_axes), (lengths, lengths_axes) = new_axes(), new_axes()
    draw_errors(errors_axes, generations)
    draw_lengths(lengths_axes, generations, store.genome, names, targets=true_lengths)
    return (
        RunPlot(
            name="errors",
            caption="Subjective error of every model over generations, and of the best one; dotted "
            "lines where a new interaction comes in.",
            figure=errors,
        ),
        RunPlot(
            name=LENGTHS,
            caption=f"Length of each leg of the best model over generations{true}.",
            figure=lengths,
        ),
    )


def with_last_word(store: RunStore) -> list[Generation]:
    """A run's generations, and after them the reference back-end's word as one more, if it had one.

    The best model of the last one is the best of the run, with the error that all tables give it.
    """
    generations = store.generations()
    finish, fitted = store.search_end.finish(), FittedPosterior.of(store)
    if finish is None or not finish.models or fitted is None or fitted.best is None:
        return generations
    last = generations[-1]
    word = replace(
        last,
        number=last.number + 1,
        iteration=last.iteration + 1,
        errors=finish.simulated,
        best=tuple(fitted.best.tolist()),
    )
    return [*generations, word]
