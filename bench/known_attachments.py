"""Do intervals of bodies hold whose attachments are known? ``python -m bench.known_attachments``.

Robots as people build them, or just as stated: bodies are drawn from the prior, what may be
otherwise from the narrow components of the table of parameters, readings after random movements
from the posterior's own likelihood with statics as the robot. Of each body the true attachments
alone are weighed; told is how many true lengths lie in the 90 % intervals of the particles that
give the evidence, and of the samples that stand for the posterior, which have settled. A study that
was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import importlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.prior_bodies import drawn_genes, on_robot
from bench.simulation_based_calibration import StaticsRobot, build, evenly
from bench.study_command import add_options, complete_by_command
from estimator.body.morphology import Array
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.likelihood import Likelihood, Noise
from estimator.posterior.model.noise import drawn_scales
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import softmax
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.sampling.integrals import Hypothesis, Integrals
from estimator.posterior.sampling.sampler import Effort
from estimator.readings.modalities import MODALITIES
from estimator.reproduction.harness import BriefRun, made_by
from protocol.system.files import replace_text
from sim_robot.world.body import DEFAULT

_ENDS: Final = (0.05, 0.95)


@dataclass(frozen=True, kw_only=True)
class BodyRun(BriefRun):
    """One body.

    Attributes:
        problem: Name or file.
        robot: Body of the robot that says what its main body is, by name or file.
        interactions: How many.
        seed: Of the body and of all else.
        stated: Whether the robot is just as stated, and known to be.
    """

    leaves = "figures.json"

    problem: str
    robot: str
    interactions: int
    seed: int
    stated: bool

    @property
    def name(self) -> str:
        """Its own in the study."""
        kind = "stated" if self.stated else "built"
        return f"{Path(self.problem).stem}-{self.interactions}-{kind}/{self.seed}"

    def make(self, place: Path) -> None:
        """Leaves which lengths lay inside."""
        replace_text(place / self.leaves, json.dumps(inside(self)))

    def told(self, root: Path) -> dict[str, Any]:
        """What a finished run has left."""
        return dict(json.loads(self.file(root).read_text("utf-8")))

    def sentence(self, root: Path) -> str:
        """How it went."""
        told = self.told(root)
        return f"{sum(told['settled'])} of {len(told['settled'])} lengths inside"


def inside(run: BodyRun) -> dict[str, Any]:
    """Which true lengths of one body lie in their intervals."""
    problem, genome, capabilities = on_robot(run.problem, run.robot)
    noise, world = Noise.announced(capabilities), problem.settings(capabilities)
    unknowns, rng = (
        Unknowns(genome, () if run.stated else problem.table),
        np.random.default_rng(run.seed),
    )
    predictor = Predictor(unknowns, StaticsPhysics(world))
    body = unknowns.as_stated(drawn_genes(genome, rng)[None])[0]
    body[unknowns.continuous] = evenly(run.seed, unknowns.continuous.size)
    if not run.stated:
        build(body, unknowns, rng)
    robot = StaticsRobot(
        predictor=predictor,
        body=body,
        scales=drawn_scales(2, rng),
        noise=noise,
        cap=world.clearance_cap,
        rng=rng,
    )
    programs = [problem.random_program(rng, capabilities) for _ in range(run.interactions)]
    observed = [robot.perform(program) for program in programs]
    likelihood = Likelihood(SensorData.of(observed, tuple(MODALITIES), world.clearance_cap), noise)
    integrals, effort = Integrals(predictor, likelihood), Effort()
    known = Hypothesis(0, unknowns.as_stated(unknowns.cube(body[None]))[0])
    ((one, particles),), _ = integrals.with_cost(([known], effort.particles, True, run.seed))
    rows = np.resize(rng.permutation(len(particles.own)), effort.samples)
    settled, _ = integrals.settled_with_cost((one, particles.own[rows], run.seed))

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
        "settled": holds(settled),
    }


def main() -> None:
    """Does the runs and prints what they say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problem", default="topological")
    parser.add_argument("--robot", default=DEFAULT, help="its body, by name or file (%(default)s)")
    parser.add_argument("--bodies", type=int, default=80)
    parser.add_argument("--interactions", type=int, default=6)
    parser.add_argument("--stated", action="store_true", help="robots that are just as stated")
    add_options(parser, Path("runs/known-attachments"))
    options = parser.parse_args()
    runs = [
        BodyRun(
            problem=options.problem,
            robot=options.robot,
            interactions=options.interactions,
            seed=seed,
            stated=options.stated,
        )
        for seed in range(options.bodies)
    ]
    complete_by_command(runs, options.out, options)
    told = [run.told(options.out) for run in runs]
    for name in ("particles", "settled"):
        every = np.array([one for figures in told for one in figures[name]])
        share = f"{every.sum()} of {every.size} lengths ({100 * every.mean():.0f} %)"
        print(f"{name}, {told[0]['dimensions']} dimensions: {share} inside their 90 % intervals")
    print(made_by(options.out, runs))


if __name__ == "__main__":
    importlib.import_module("bench.known_attachments").main()  # so workers find runs
