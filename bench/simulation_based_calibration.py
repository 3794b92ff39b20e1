"""Does the posterior mean what it says? ``python -m bench.simulation_based_calibration``.

Bodies are drawn from the prior, readings from the posterior's own likelihood with statics as the
robot, movements chosen by expected information. Whatever is wrong then is the sampler's fault, not
the model's: the ranks of true lengths among the samples must be uniform, 90 % intervals hold nine
true lengths of ten, statements of 0.95 and more be right as often, and movements tell on average
what they were expected to tell. A study that was interrupted goes on where it stopped. Ranks are
told by how many lie in the lowest and in the highest tenth: true lengths are evener than draws one
by one, for which a test of uniformity would be right.

Of many legs nothing is observed, and of 66 bodies drawn one by one 13 % of the lengths lay in the
lowest tenth of the prior, so that good intervals seemed to fail. So lengths are points of a
scrambled Halton sequence, which cover the prior evenly; each by itself is a draw from it.

Robots are just as stated and known to be, unless ``--robots`` says otherwise: ``stated`` ones are
as stated, have noise as it is announced and no outliers, but are not known to be so: each that a
run finds faulty is a false alarm; ``built`` ones are as people build them: what may be otherwise is
drawn from the narrow components of the table of parameters, with their common scale from its prior.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, get_args

import numpy as np

from bench.prior_bodies import drawn_genes, on_robot
from bench.study_command import add_options, complete_by_command
from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.executors import ThisProcess
from estimator.exploration.information import Chooser
from estimator.exploration.information_gain import InformationGain
from estimator.parameters.table import CARE, MEDIAN_CARE
from estimator.physics.equivalence import PROGRAMS
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.indistinguishable import indistinguishable_points
from estimator.posterior.model.likelihood import GRAVITY_TILTS, LIKELY, Likelihood, apart
from estimator.posterior.model.noise import Noise, drawn, drawn_scales
from estimator.posterior.model.sensor_data import DENSITIES, SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.posterior.posterior import Posterior
from estimator.posterior.sampling.sampler import Effort, Sampler
from estimator.posterior.summary import information_gained, summarise
from estimator.problem.problem import Problem
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings
from estimator.reproduction.harness import BriefRun, made_by
from estimator.reproduction.tables import markdown
from estimator.storage.posteriors import SURE
from protocol.system.files import replace_text
from protocol.wire.capabilities import Capabilities
from sim_robot.world.body import DEFAULT

Robots: TypeAlias = Literal["exact", "stated", "built"]

BEYOND: Final = 0.1
_FAULTY: Final = 0.5  # share of the posterior with wide components, above which a robot is faulty


@dataclass(frozen=True, kw_only=True)
class StaticsRobot:
    """A robot whose readings are drawn from the likelihood.

    Attributes:
        predictor: Computes readings.
        body: Body and deviations of the robot, a point of the cube, shape (size,).
        scales: Logarithms of the robot's noise factors, shape (2,).
        noise: Noise of the sensors.
        cap: Range of the distance sensor, m.
        rng: Draws the noise.
    """

    predictor: Predictor
    body: Array
    scales: Array
    noise: Noise
    cap: float
    rng: np.random.Generator

    def perform(self, program: Array) -> Observation:
        """Observation after a motor program, rad, shape (motors,)."""
        noise, cap, rng = self.noise, self.cap, self.rng
        readings = self._where_it_falls(program)
        wide = np.exp(self.scales) * [noise.tilt, noise.clearance]
        outlier = rng.random() < noise.outlier
        beside = outlier and rng.random() < noise.nearby
        if beside:
            wide = np.hypot(wide, [DENSITIES["tilt"].beside, DENSITIES["clearance"].beside])
        tilt = readings.tilt[0] + wide[0] * drawn(2, rng)
        height = readings.clearance[0] + wide[1] * drawn(1, rng)[0]
        beyond = bool(readings.saturated[0]) or height >= cap
        doubtful = readings.touch_doubtful[0]
        wrong = rng.random(doubtful.size) < np.where(doubtful, 0.5, noise.touch)
        touch = readings.touch[0] != wrong
        anywhere = outlier and not beside
        if anywhere or readings.undecided[0] or not readings.valid[0]:
            tilt = rng.uniform(-math.pi / 2, math.pi / 2, 2)
            beyond = rng.random() < BEYOND
            height = rng.uniform(0, cap)
            touch = rng.random(touch.size) < 0.5
        return Observation(
            angles=tuple(program.tolist()),
            touch=tuple(bool(bit) for bit in touch),
            tilt=(float(tilt[0]), float(tilt[1])),
            clearance=cap if beyond else float(height),
            clearance_saturated=bool(beyond),
        )

    def _where_it_falls(self, program: Array) -> PredictedReadings:
        """One reading, of the plumb fall or of another side of a fork, by how likely each is."""
        body = np.repeat(self.body[None], len(GRAVITY_TILTS), axis=0)
        readings = self.predictor.read_all(body, program[None], GRAVITY_TILTS)
        sides, likely = [readings[:1]], [LIKELY[0]]
        for number in range(1, len(GRAVITY_TILTS)):
            landing = readings[number : number + 1]
            if all(apart(side, landing, self.noise)[0] for side in sides):
                sides.append(landing)
                likely.append(LIKELY[number])
        return sides[int(self.rng.choice(len(sides), p=np.array(likely) / sum(likely)))]


@dataclass(frozen=True, kw_only=True)
class BodyRun(BriefRun):
    """One body, and what was known of it after each interaction.

    Attributes:
        problem: Name or file of the problem.
        interactions: Number of interactions.
        seed: Seed of the body and of all else.
        robots: Whether the robot is just as stated, and known to be, or as people build them.
        random: Whether movements are random, and learnt from only after the last of them.
        robot: Name or file of the body of the robot that says what its main body is.
    """

    leaves = "figures.json"

    problem: str
    interactions: int
    seed: int
    robots: Robots = "exact"
    random: bool = False
    robot: str = DEFAULT

    @property
    def name(self) -> str:
        """Name, unique in the study."""
        kind = f"-{self.robots}" + "-random" * self.random
        kind += f"-{Path(self.robot).stem}" * (self.robot != DEFAULT)
        return f"{Path(self.problem).stem}-{self.interactions}{kind}/{self.seed}"

    def make(self, place: Path) -> None:
        """Writes what was known of the body."""
        replace_text(place / self.leaves, json.dumps(self.found()))

    def found(self) -> Any:
        """Figures of the body by interaction."""
        return trial(self)

    def figures(self, root: Path) -> Any:
        """Figures that a finished run has left."""
        return json.loads(self.file(root).read_text("utf-8"))

    def sentence(self, root: Path) -> str:
        """Says how the run went."""
        figures = self.figures(root)[-1]
        return f"{'right' if figures['right'] else 'wrong'}, stated {figures['probability']}"


def robot_of(run: BodyRun) -> tuple[StaticsRobot, Problem, Capabilities, float]:
    """The robot of a run, the problem, the robot's capabilities, and its factor of care."""
    problem, genome, capabilities = on_robot(run.problem, run.robot)
    noise, world = Noise.announced(capabilities), problem.settings(capabilities)
    unknowns = Unknowns(genome, () if run.robots == "exact" else problem.table)
    rng, scale = np.random.default_rng(run.seed), 0.0
    body = unknowns.as_stated(drawn_genes(genome, rng)[None])[0]
    body[unknowns.continuous] = evenly(run.seed, unknowns.continuous.size)
    if run.robots == "built":
        scale = MEDIAN_CARE * math.exp(CARE * rng.standard_normal())
        spreads = np.array([row.narrow * (scale if row.by_care else 1) for row in unknowns.table])
        body[unknowns.genes_size :] = spreads * rng.standard_normal(spreads.size)
    robot = StaticsRobot(
        predictor=Predictor(unknowns, StaticsPhysics(world)),
        body=body,
        scales=np.zeros(2) if run.robots == "stated" else drawn_scales(2, rng),
        noise=noise._replace(outlier=0.0) if run.robots == "stated" else noise,
        cap=world.clearance_cap,
        rng=rng,
    )
    return robot, problem, capabilities, scale


def trial(run: BodyRun) -> list[dict[str, Any]]:
    """Returns what was known of one body after each interaction."""
    robot, problem, capabilities, scale = robot_of(run)
    predictor, body, cap, rng = robot.predictor, robot.body, robot.cap, robot.rng
    unknowns, noise, effort = predictor.unknowns, Noise.announced(capabilities), Effort()
    sampler = Sampler(
        unknowns,
        partial(StaticsPhysics, problem.settings(capabilities)),
        effort,
        np.random.SeedSequence(run.seed).spawn(effort.populations + 1),
        workers=ThisProcess(),
    )
    ends = problem.program_range(capabilities)
    (true_body,) = unknowns.decode_all(body[None])
    anybody = leg_lengths(unknowns.decode_all(rng.random((2, unknowns.size))))
    open_legs = np.flatnonzero(anybody[0] != anybody[1])
    lengths = leg_lengths([true_body])[0, open_legs]
    truth = Posterior(
        values=body[None],
        scales=robot.scales[None],
        weights=np.ones(1),
        modes=(),
        adequate_fit=True,
    )
    programs = np.array([problem.random_program(rng, capabilities) for _ in range(PROGRAMS)])
    indistinguishable = partial(indistinguishable_points, predictor, programs, tuple(MODALITIES))
    gain = InformationGain(noise, cap, tuple(MODALITIES))
    posterior, figures = sampler.prior(), []
    observed: list[Observation] = []
    for movements_left in reversed(range(run.interactions)):
        if run.random:
            program, bits = problem.random_program(rng, capabilities), math.nan
        else:
            chosen = Chooser(predictor, gain, ends).choose(posterior, len(observed), rng)
            program, bits = chosen.program, chosen.bits
        observed.append(robot.perform(program))
        if run.random and movements_left:
            continue
        likelihood = Likelihood(SensorData.of(observed, tuple(MODALITIES), cap), noise)
        before, posterior = posterior, sampler.learn(likelihood)
        summary = summarise(posterior, predictor, likelihood, indistinguishable, before=before)
        leader = posterior.modes[0].point.copy()
        leader[unknowns.continuous] = body[unknowns.continuous]
        leader[unknowns.genes_size :] = body[unknowns.genes_size :]
        right = bool(indistinguishable(leader[None], body[None])[0])
        sampled = leg_lengths(unknowns.decode_all(posterior.values))[:, open_legs]
        low, high = np.quantile(
            sampled, (0.05, 0.95), axis=0, weights=posterior.weights, method="inverted_cdf"
        )
        figures.append(
            {
                "interactions": len(observed),
                "right": right,
                "probability": summary.probability,
                "ranks": (posterior.weights @ (sampled < lengths)).tolist(),
                "inside": ((low <= lengths) & (lengths <= high)).tolist(),
                "widths_mm": (1000 * (high - low)).tolist(),
                "scale": scale,
                "faulty": not summary.explained
                or sum(cause.probability for cause in summary.causes) > _FAULTY,
                "expected_bits": bits,
                "information_gain_bits": summary.information_gain_bits,
                "true_bits": information_gained(before, truth, predictor, likelihood),
            }
        )
    return figures


def evenly(number: int, size: int) -> Array:
    """Point of a scrambled Halton sequence in the unit cube, shape (size,), by its number."""
    stats: Any = importlib.import_module("scipy.stats")  # takes a second
    points = stats.qmc.Halton(size, seed=0)
    points.fast_forward(number)
    point: Array = points.random(1)[0]
    return point


def table(trials: Iterable[list[dict[str, Any]]]) -> str:
    """Table of the trials' results, in Markdown."""
    header = (
        *("after interaction", "called faulty", "right", "not known", "stated ≥ 0.95"),
        *("of these right", "log score", "legs inside 90 % interval", "its median width (mm)"),
        *("ranks in the lowest and the highest tenth", "expected bits", "gained bits"),
        "by the true body",
    )
    rows = []
    for steps in zip(*trials, strict=True):
        known = [step for step in steps if step["probability"] is not None]
        sure = [step for step in known if step["probability"] >= SURE]
        stated = np.clip([step["probability"] for step in known], 1e-6, 1 - 1e-6)
        right = np.array([step["right"] for step in known], dtype=bool)
        score = np.mean(np.log(np.where(right, stated, 1 - stated))) if known else math.nan
        values = {
            name: np.array([one for step in steps for one in step[name]])
            for name in ("ranks", "inside", "widths_mm")
        }
        expected, gained, true = (
            np.mean([step[name] for step in steps])
            for name in ("expected_bits", "information_gain_bits", "true_bits")
        )
        tenths = np.histogram(values["ranks"], bins=10, range=(0, 1))[0]
        rows.append(
            (
                str(steps[0]["interactions"]),
                str(sum(step["faulty"] for step in steps)),
                f"{sum(step['right'] for step in steps)} of {len(steps)}",
                str(len(steps) - len(known)),
                str(len(sure)),
                str(sum(step["right"] for step in sure)),
                f"{score:.2f}",
                f"{values['inside'].sum()} of {values['inside'].size}",
                f"{np.median(values['widths_mm']):.1f}",
                f"{tenths[0]} and {tenths[-1]} of {tenths.sum()}",
                *(f"{bits:.2f}" for bits in (expected, gained, true)),
            )
        )
    return markdown(header, rows) + "\n"


def add_bodies(parser: argparse.ArgumentParser, *, bodies: int, interactions: int) -> None:
    """Adds the options of which bodies are drawn, and of which robots."""
    parser.add_argument("--problem", default="topological")
    parser.add_argument("--robot", default=DEFAULT, help="its body, by name or file (%(default)s)")
    parser.add_argument("--bodies", type=int, default=bodies)
    parser.add_argument("--interactions", type=int, default=interactions)
    parser.add_argument("--robots", choices=get_args(Robots), default="exact")


def bodies_by_command(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Arguments of the ``BodyRun`` of each body."""
    names = ("problem", "robot", "interactions", "robots")
    shared = {name: getattr(options, name) for name in names}
    return [{**shared, "seed": seed} for seed in range(options.bodies)]


def main() -> None:
    """Makes the trials and prints their table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--random", action="store_true", help="random movements, learnt from after the last"
    )
    add_options(parser, Path("runs/simulation-based-calibration"))
    add_bodies(parser, bodies=300, interactions=4)
    options = parser.parse_args()
    runs = [BodyRun(**of_body, random=options.random) for of_body in bodies_by_command(options)]
    complete_by_command(runs, options.out, options)
    print(table(run.figures(options.out) for run in runs), made_by(options.out, runs), sep="\n")


if __name__ == "__main__":
    importlib.import_module("bench.simulation_based_calibration").main()  # so workers find runs
