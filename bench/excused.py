"""How often is the best model of a run excused from an interaction, and does that hide a misfit?

``python -m bench.excused RUN…`` takes finished runs that statics searched, such as those of
``estimator identify --method paper --physics statics``, and prints a line for each and a total.

A pose is *undecided* where the model is balanced, and then the model is excused from that
interaction. What the excuse hides is told by the model's neighbours, whose genes differ by a
thousandth of their range: if none of those that are decided in that pose explains it as well as the
model's error claims, the model does not explain it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.identification.paper.objectives import LargestError
from estimator.physics.statics import StaticsPhysics
from estimator.storage.store import RunStore

NEIGHBOURS: Final = 30
NEAR: Final = 1e-3


@dataclass(frozen=True)
class Excused:
    """Counts of generations.

    Attributes:
        generations: All generations of a run.
        excused: Generations whose best model is excused from an interaction.
        hidden: Excused generations in which the excuse hides a misfit.
        ends: Excused generations that end an iteration.
        final: 1 if the search's last best model is excused, else 0.
    """

    generations: int = 0
    excused: int = 0
    hidden: int = 0
    ends: int = 0
    final: int = 0

    def __add__(self, other: Excused) -> Excused:
        return Excused(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def __str__(self) -> str:
        return (
            f"{self.generations} generations, {self.excused} excused "
            f"({self.excused / self.generations:.1%}), {self.hidden} hide a misfit, "
            f"{self.ends} end an iteration, {self.final} the run"
        )


def count(directory: Path) -> Excused:
    """Counts the generations of a run."""
    rng = np.random.default_rng(0)
    counted = Excused()
    with RunStore.open(directory, to_write=False) as store:
        settings, genome = store.settings, store.genome
        observations = store.observations()
        generations = store.generations()
        with StaticsPhysics(store.world) as physics:
            for item in generations:
                genes, observed = np.array(item.best), observations[: item.iteration + 1]
                body = genome.decode(genes)
                readings = physics.read([(body, np.array(target.angles)) for target in observed])
                balanced = np.flatnonzero(readings.undecided & readings.valid)
                if not balanced.size:
                    counted += Excused(generations=1)
                    continue
                neighbours = np.clip(genes + rng.normal(0, NEAR, (NEIGHBOURS, len(genes))), 0, 1)
                hides = False
                for turn in balanced:
                    target = observed[turn]
                    angles = np.array(target.angles)
                    around = physics.read([(genome.decode(row), angles) for row in neighbours])
                    errors = LargestError().terms(around, target, settings.modalities)
                    hides |= _least_error(errors, around.undecided) > min(item.errors)
                end = item.number % (settings.generations + 1) == settings.generations
                is_last = item.number == len(generations) - 1
                counted += Excused(1, 1, int(hides), int(end), int(is_last))
    return counted


def _least_error(errors: Array, undecided: Flags) -> float:
    return float(np.min(errors[~undecided], initial=np.inf))


def main(arguments: Sequence[str]) -> None:
    """Prints the counts of each run, and their total."""
    total = Excused()
    for name in arguments:
        of_run = count(Path(name))
        print(f"{name}: {of_run}", flush=True)
        total += of_run
    print(f"total: {total}")


if __name__ == "__main__":
    main(sys.argv[1:])
