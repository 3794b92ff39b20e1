"""Do intervals hold true lengths, attachments known? ``python -m bench.known_attachments``.

Bodies and robots are drawn as by ``bench.simulation_based_calibration``, movements at random. For
each body the true attachments alone are weighed; printed is how many true lengths lie in the 90 %
intervals of the particles that give the evidence, and of the samples that stand for the posterior,
which have equilibrated. A study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.simulation_based_calibration import BodyRun, add_bodies, bodies_by_command, robot_of
from bench.study_command import add_options, complete_by_command
from estimator.body.morphology import Array
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import softmax
from estimator.posterior.sampling.integrals import Hypothesis, Integrals
from estimator.posterior.sampling.sampler import Effort
from estimator.readings.modalities import MODALITIES
from estimator.reproduction.harness import made_by

_ENDS: Final = (0.05, 0.95)


class KnownRun(BodyRun):
    """One body of known attachments, after random movements."""

    def found(self) -> Any:
        """Which true lengths lay inside their intervals."""
        return inside(self)

    def sentence(self, root: Path) -> str:
        """Says how the run went."""
        equilibrated = self.figures(root)["equilibrated"]
        return f"{sum(equilibrated)} of {len(equilibrated)} lengths inside"


def inside(run: BodyRun) -> dict[str, Any]:
    """Which true lengths of one body lie in their intervals."""
    robot, problem, capabilities, _ = robot_of(run)
    predictor, body, rng = robot.predictor, robot.body, robot.rng
    unknowns, noise = predictor.unknowns, Noise.announced(capabilities)
    programs = [problem.random_program(rng, capabilities) for _ in range(run.interactions)]
    observed = [robot.perform(program) for program in programs]
    likelihood = Likelihood(SensorData.of(observed, tuple(MODALITIES), robot.cap), noise)
    integrals, effort = Integrals(predictor, likelihood), Effort()
    known = Hypothesis(unknowns.as_stated(unknowns.cube(body[None]))[0])
    ((one, particles),), _ = integrals.with_cost(([known], effort.particles, True, run.seed))
    rows = np.resize(rng.permutation(len(particles.own)), effort.samples)
    equilibrated, _ = integrals.equilibrated_with_cost((one, particles.own[rows], run.seed))

    def holds(values: Array) -> list[bool]:
        misfits = likelihood.misfits_of(predictor, values)
        scales = likelihood.drawn_scales(misfits, rng)
        as_found = likelihood.of(misfits, scales=scales)
        ratios = likelihood.normalised(predictor, values, scales) - as_found
        lengths, true = values[:, unknowns.continuous], body[unknowns.continuous]
        low, high = np.quantile(
            lengths, _ENDS, axis=0, weights=softmax(ratios.sum(axis=1)), method="inverted_cdf"
        )
        return list(((low <= true) & (true <= high)).tolist())

    return {
        "dimensions": particles.own.shape[1],
        "particles": holds(particles.values),
        "equilibrated": holds(equilibrated),
    }


def main() -> None:
    """Does the runs and prints how many lengths lie inside their intervals."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser, Path("runs/known-attachments"))
    add_bodies(parser, bodies=80, interactions=6)
    options = parser.parse_args()
    runs = [KnownRun(**of_body, random=True) for of_body in bodies_by_command(options)]
    complete_by_command(runs, options.out, options)
    results = [run.figures(options.out) for run in runs]
    for name in ("particles", "equilibrated"):
        values = np.array([value for figures in results for value in figures[name]])
        share = f"{values.sum()} of {values.size} lengths ({100 * values.mean():.0f} %)"
        print(f"{name}, {results[0]['dimensions']} dimensions: {share} inside their 90 % intervals")
    print(made_by(options.out, runs))


if __name__ == "__main__":
    importlib.import_module("bench.known_attachments").main()  # so workers find runs
