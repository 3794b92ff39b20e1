"""What each part of the method is worth: development seeds, one part left out at a time.

``python -m bench.power.ablations``; a study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np

from bench.power.study import SEEDS
from bench.power.tables import RUNS, SUMMARY, by_group, run_rows, summary_rows
from bench.power.trial import Trial, TrialRun
from bench.study_command import add_options, complete_by_command
from estimator.identification import posterior_method
from estimator.posterior.discovery import discovery, population
from estimator.posterior.model import likelihood
from estimator.posterior.model.likelihood import GRAVITY_TILTS
from estimator.posterior.sampling import sampler
from estimator.posterior.sampling.sampler import Effort
from estimator.posterior.sampling.weighing import WeighedModes
from estimator.reproduction.harness import made_by
from estimator.reproduction.tables import markdown


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """The method without one of its parts.

    Attributes:
        explore: Exploration rule; default: the method's.
        replaced: What stands in the part's place, by module and name.
    """

    explore: str | None = None
    replaced: Mapping[tuple[Any, str], Any] = field(default_factory=dict)


def _as_weighed(modes: WeighedModes, *_: object) -> WeighedModes:
    return modes


GROUP: Final = "ablations"
ABLATIONS: Final[Mapping[str, Ablation]] = {
    "nothing left out": Ablation(),
    "random movements": Ablation(explore="random"),
    "movements by disagreement": Ablation(explore="disagreement"),
    "no levels of wider noise": Ablation(replaced={(population, "HOTTEST"): 1.0}),
    "other attachments are not tried": Ablation(replaced={(discovery, "_SWEPT"): ()}),
    "falls to no other side": Ablation(
        replaced={(likelihood, "_LOG_LIKELY"): np.log([1.0, *[1e-12] * (len(GRAVITY_TILTS) - 1)])}
    ),
    "no chains to bodies that no search has found": Ablation(
        replaced={(sampler, "mixed"): _as_weighed}
    ),
    "one population": Ablation(
        replaced={(posterior_method, "Effort"): partial(Effort, populations=1)}
    ),
}


class AblationRun(TrialRun):
    """A run without the part of the method that its trial is named after."""

    def make(self, place: Path) -> None:
        """Makes the run, and writes its figures."""
        with ExitStack() as stack:
            for (module, attribute), value in ABLATIONS[self.trial.name].replaced.items():
                stack.enter_context(mock.patch.object(module, attribute, value))
            super().make(place)


def main() -> None:
    """Does the runs that are left, and prints the results of each ablation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=4, help="so many development seeds")
    parser.add_argument("--only", nargs="*", choices=ABLATIONS, default=list(ABLATIONS))
    add_options(parser, Path("runs/ablations"))
    options = parser.parse_args()
    seeds = SEEDS["development"][: options.first]
    runs = [
        AblationRun(group=GROUP, trial=trial, seed=seed)
        for name in options.only
        for trial in [Trial(name=name, seeds=seeds, explore=ABLATIONS[name].explore)]
        for seed in seeds
    ]
    complete_by_command(runs, options.out, options)
    trials = by_group(runs, options.out)[GROUP]
    for header, rows in ((SUMMARY, summary_rows(trials)), (RUNS, run_rows(trials))):
        print(markdown(header, rows), end="\n\n")
    print(made_by(options.out, runs))


if __name__ == "__main__":
    importlib.import_module("bench.power.ablations").main()  # workers find runs by this name
