"""What each part of the method is worth: development seeds, one part left out at a time.

``python -m bench.power.ablations``; a study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np

from bench.power.study import SEEDS
from bench.power.tables import Runs, run_table, success_table
from bench.power.trial import Figures, Trial, figures_of
from estimator.identification import posterior_method
from estimator.posterior.chains import population
from estimator.posterior.discovery import discovery
from estimator.posterior.model import likelihood
from estimator.posterior.model.likelihood import LEANS
from estimator.posterior.sampling.sampler import Effort


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """The method without one of its parts.

    Attributes:
        explore: Exploration rule; default: the method's.
        replaced: What stands in the part's place, by module and name.
    """

    explore: str | None = None
    replaced: Mapping[tuple[Any, str], Any] = field(default_factory=dict)


ABLATIONS: Final[Mapping[str, Ablation]] = {
    "nothing left out": Ablation(),
    "random movements": Ablation(explore="random"),
    "movements by disagreement": Ablation(explore="disagreement"),
    "no levels of wider noise": Ablation(replaced={(population, "HOTTEST"): 1.0}),
    "other rows are not tried": Ablation(replaced={(discovery, "_SWEPT"): ()}),
    "falls to no other side": Ablation(
        replaced={(likelihood, "_LOG_LIKELY"): np.log([1.0, *[1e-12] * (len(LEANS) - 1)])}
    ),
    "one population": Ablation(
        replaced={(posterior_method, "Effort"): partial(Effort, populations=1)}
    ),
}


def run(name: str, trial: Trial, seed: int, root: Path) -> Figures:
    """One run of ``figures_of``, without the part of that name."""
    with ExitStack() as stack:
        for (module, attribute), value in ABLATIONS[name].replaced.items():
            stack.enter_context(mock.patch.object(module, attribute, value))
        return figures_of(trial, seed, root)


def main() -> None:
    """Prints what came of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=4, help="so many development seeds")
    parser.add_argument("--only", nargs="*", choices=ABLATIONS, default=list(ABLATIONS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/power/ablations"))
    options = parser.parse_args()
    seeds = SEEDS["development"][: options.first]
    with ProcessPoolExecutor(options.jobs, max_tasks_per_child=1) as workers:
        waiting = [
            (trial, [workers.submit(run, name, trial, seed, options.out) for seed in seeds])
            for name in options.only
            for trial in [Trial(name=name, seeds=seeds, explore=ABLATIONS[name].explore)]
        ]
        runs: Runs = [(trial, [each.result() for each in futures]) for trial, futures in waiting]
    print(success_table(runs), run_table(runs))


if __name__ == "__main__":
    main()
