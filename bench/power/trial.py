"""One run through the protocol, compared with the truth after each interaction."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from bench.power.robots import Robot
from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array
from estimator.evaluation.attachments import Comparison, Truth
from estimator.evaluation.length_search import LengthSearch
from estimator.evaluation.score import length_search
from estimator.identification.method import Listener
from estimator.identification.run import identify
from estimator.physics.statics import StaticsPhysics
from estimator.problem.problem import Problem
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.reproduction.harness import BriefRun
from estimator.reproduction.robot_process import RobotProcess
from estimator.storage.posteriors import SURE, StoredPosterior
from estimator.storage.run_config import MethodName, RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS
from protocol.errors import BodyschemaError
from protocol.system.files import replace_text

RUN: Final = "run"
"""Folder of a trial's run."""

CLOSE: Final = 10.0
"""A length is wrong when it is farther off than this, mm, and outside its own 90 % interval."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What is run for each of some seeds.

    Attributes:
        name: Name, unique in its group; a row of the group's table is called so.
        seeds: Seeds of the robot and of the run.
        problem: Name of a problem that ships, or the text of one.
        interactions: Largest number of interactions.
        method: Method of the run; ``paper`` searches with statics here.
        explore: Exploration rule; default: the method's.
        robot: Robot that is simulated; default: the default robot.
    """

    name: str
    seeds: tuple[int, ...]
    problem: str = "topological"
    interactions: int = 6
    method: MethodName = "posterior"
    explore: str | None = None
    robot: Robot = Robot()


def as_stated(problem: str) -> str:
    """Text of a problem, by name or file, by which the robot is taken to be just as stated."""
    return f"{Problem.load(problem).source}\n[uncertain]\nexact = true\n"


class Step(BaseModel):
    """A run after one interaction.

    Attributes:
        probability: Probability stated of the attachments; ``None`` where the method states none.
        explained: Whether the run stood by its body, and did not say that no body explains the
            readings.
        cells: Number of configurations that are right, up to what no sensor can tell.
        leg_errors_mm: Estimated minus true length of each leg, mm.
        inside: Whether each leg's 90 % interval holds its true length.
        widths_mm: Widths of these intervals, mm.
        stated_widths_mm: Widths of the intervals if the robot were just as stated, mm.
        causes: Causes that are named for what may be otherwise, each with its probability, the most
            probable first.
        amounts: 90 % intervals of how far what may be otherwise is from what is stated, where that
            is open, by name in the table of parameters.
        cpu_seconds: CPU time of the estimator by then, s.
    """

    model_config = ConfigDict(frozen=True)

    probability: float | None
    explained: bool
    cells: int
    leg_errors_mm: tuple[float, ...]
    inside: tuple[bool, ...] = ()
    widths_mm: tuple[float, ...] = ()
    stated_widths_mm: tuple[float, ...] = ()
    causes: tuple[tuple[str, float], ...] = ()
    amounts: dict[str, tuple[float, float]] = {}
    cpu_seconds: float


class Figures(BaseModel):
    """Figures of one run.

    Attributes:
        seed: Seed of the robot and of the run.
        cpu_seconds: CPU time of the estimator, s.
        simulations: Number of simulations that it ran.
        explained: Whether it says that some body of the problem explains the readings.
        verdict: What it says of that, as a sentence, and the first warning; or why there was no
            run.
        cells: Number of configurations.
        steps: The run after each interaction.
    """

    model_config = ConfigDict(frozen=True)

    seed: int
    cpu_seconds: float
    simulations: int
    explained: bool
    verdict: str
    cells: int
    steps: tuple[Step, ...]

    @property
    def right(self) -> bool:
        """Whether all attachments are right in the end."""
        return bool(self.steps) and self.steps[-1].cells == self.cells

    @property
    def certain(self) -> bool:
        """Whether the run stands by its body: explained, and at least 0.95 probable."""
        return bool(self.steps and self.explained and (self.steps[-1].probability or 0.0) >= SURE)

    @property
    def certain_and_wrong(self) -> bool:
        """Whether the run is certain, and attachments or a length of its body are wrong."""
        return self.certain and (not self.right or self.lengths_wrong)

    @property
    def lengths_wrong(self) -> bool:
        """Whether the length of some leg is far off, and outside its own interval."""
        last = self.steps[-1]
        return any(
            abs(error) > CLOSE and not inside
            for error, inside in zip(last.leg_errors_mm, last.inside, strict=True)
        )


@dataclass(frozen=True, kw_only=True)
class TrialRun(BriefRun):
    """A trial with one of its seeds, as a run of a study.

    Attributes:
        group: Group that the trial belongs to.
        trial: What to run.
        seed: One of the trial's seeds.
    """

    leaves = "figures.json"

    group: str
    trial: Trial
    seed: int

    @property
    def name(self) -> str:
        """Name, unique in the study."""
        words = (re.sub(r"\W+", "-", text) for text in (self.group, self.trial.name))
        return "/".join([*words, str(self.seed)])

    @property
    def work(self) -> float:
        """Amount of work, roughly, in movements."""
        return self.trial.interactions

    def make(self, place: Path) -> None:
        """Makes the run, and writes its figures."""
        shutil.rmtree(place / RUN, ignore_errors=True)
        figures = _run(self.trial, self.seed, place)
        replace_text(place / self.leaves, figures.model_dump_json(indent=2))

    def figures(self, root: Path) -> Figures:
        """Figures that a finished run has left."""
        return Figures.model_validate_json(self.file(root).read_text("utf-8"))

    def sentence(self, root: Path) -> str:
        """Says how the run went."""
        run = self.figures(root)
        if not run.steps:
            return run.verdict
        last = run.steps[-1]
        stated = "" if last.probability is None else f", stated {last.probability:.2f}"
        errors = " ".join(f"{error:+.1f}" for error in last.leg_errors_mm)
        return (
            f"{last.cells} of {run.cells}{stated}, legs {errors} mm, {run.cpu_seconds:.0f} s of "
            f"CPU. {'CERTAIN AND WRONG. ' * run.certain_and_wrong}{run.verdict}"
        )


def _run(trial: Trial, seed: int, place: Path) -> Figures:
    robot, body = trial.robot, trial.robot.body(seed)
    (place / "body.urdf").write_text(body, encoding="utf-8")
    (place / "truth.urdf").write_text(robot.truth(body), encoding="utf-8")
    robot.write_files(place, seed)
    problem = trial.problem
    if "\n" in problem:
        problem = str(place / "problem.toml")
        Path(problem).write_text(trial.problem, encoding="utf-8")
    options = [option.replace("{folder}", str(place)) for option in robot.options]
    with RobotProcess(seed, ["--body", str(place / "body.urdf"), *options]) as process:
        order = RunConfig(
            robot=process.uri,
            problem=problem,
            seed=seed,
            method=trial.method,
            physics="statics",
            explore=trial.explore,
            interactions=trial.interactions,
        )
        started = time.process_time()
        spent: list[float] = []

        def report(store: RunStore) -> Result:
            spent.append(time.process_time() - started)
            return write_report(store, plots=False)

        try:
            result = identify(place / RUN, order, IN_THIS_PROCESS, Listener(), report=report)
        except BodyschemaError as error:
            message = str(error).replace(str(place), "").replace(process.uri, "the robot")
            return Figures(
                seed=seed,
                cpu_seconds=time.process_time() - started,
                simulations=0,
                explained=False,
                verdict=f"Refused: {message}",
                cells=0,
                steps=(),
            )
    with RunStore.open(place / RUN, to_write=False) as store:
        cells, steps = held_against(store, place / "truth.urdf", spent)
    return Figures(
        seed=seed,
        cpu_seconds=spent[-1],
        simulations=result.simulations_run,
        explained=result.judged is None or result.judged.explained,
        verdict=" ".join(
            [*([result.judged.verdict] if result.judged else []), *result.warnings[:1]]
        ),
        cells=cells,
        steps=steps,
    )


class Judge:
    """Compares bodies of a run with the truth.

    Args:
        store: The run.
        truth: URDF of the body that its robot's readings describe.
        physics: Predicts the readings by which bodies are equivalent or not.

    Attributes:
        legs: True length of each leg, m.
    """

    def __init__(self, store: RunStore, truth: Path, physics: StaticsPhysics) -> None:
        self._store, self._physics = store, physics
        self._truth = Truth.read(truth, store.problem, store.capabilities)
        self._search: LengthSearch | None = None
        self.legs = np.array([leg.limb.length for leg in self._truth.legs.values()])

    def of(self, genes: Array) -> tuple[int, int, list[float]]:
        """Numbers of right and of all configurations of a body, and errors of its legs, mm."""
        store = self._store
        body = store.genome.decode(genes)
        comparison = Comparison(store.problem, store.genome, body, self._truth)
        self._search = self._search or length_search(store, comparison.true_body, self._physics)
        cells = comparison.configurations(self._search.is_like)
        errors: list[float] = (1000 * (leg_lengths([body])[0] - self.legs)).tolist()
        return sum(cell.right_up_to_equivalence for cell in cells), len(cells), errors


def held_against(
    store: RunStore, truth: Path, cpu_seconds: Sequence[float]
) -> tuple[int, tuple[Step, ...]]:
    """Number of configurations, and the best body after each interaction beside the truth.

    Args:
        store: The run.
        truth: URDF of the body that its robot's readings describe.
        cpu_seconds: CPU time spent by the end of each interaction, s.
    """
    count, steps = 0, []
    with StaticsPhysics(store.world) as physics:
        judge = Judge(store, truth, physics)
        for (genes, posterior), seconds in zip(_best_bodies(store), cpu_seconds, strict=False):
            right, count, errors = judge.of(np.array(genes))
            stated = _stated(store, posterior, judge.legs)
            steps.append(
                Step(cells=right, leg_errors_mm=tuple(errors), cpu_seconds=seconds, **stated)
            )
    return count, tuple(steps)


def _stated(store: RunStore, posterior: StoredPosterior | None, legs: Array) -> dict[str, Any]:
    """What a run states of attachments, lengths and all else that is open, as fields of a step."""
    if posterior is None:
        return {"probability": None, "explained": True}
    weights = np.array(posterior.weights)
    lengths = leg_lengths(store.genome.decode_all(np.array(posterior.genes)))
    low, high = _interval(lengths, weights)
    amounts = {}
    for name, deviations in posterior.amounts.items():
        values = np.array(deviations)
        (deviating,) = np.nonzero(values)
        lowest, highest = _interval(values[deviating, None], weights[deviating])
        amounts[name] = (float(lowest[0]), float(highest[0]))
    return {
        "probability": posterior.probability,
        "explained": posterior.explained,
        "inside": ((low <= legs) & (legs <= high)).tolist(),
        "widths_mm": (1000 * (high - low)).tolist(),
        "stated_widths_mm": [1000 * (ends.high - ends.low) for ends in posterior.as_stated_m],
        "causes": tuple((row.name, posterior.stated(row.probability)) for row in posterior.causes),
        "amounts": amounts,
    }


def _interval(values: Array, weights: Array) -> Array:
    """Ends of the 90 % intervals of columns, shape (2, columns)."""
    ends: Array = np.quantile(values, (0.05, 0.95), axis=0, weights=weights, method="inverted_cdf")
    return ends


def _best_bodies(store: RunStore) -> Iterator[tuple[Sequence[float], StoredPosterior | None]]:
    """Genes of the best body after each interaction, and the posterior, if the method has one."""
    for posterior, _ in store.posteriors():
        yield posterior.best, posterior
    last_generations = {one.iteration: one for one in store.generations()}
    for _, generation in sorted(last_generations.items()):
        yield generation.best, None
