"""Whole runs of the method posterior over a real wire, and what interrupts them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from estimator import best_programs, load
from estimator.body.limbs import driven_limbs
from estimator.errors import EstimatorError
from estimator.identification import posterior_method
from estimator.identification.method import Listener
from estimator.identification.run import identify, resume
from estimator.posterior.model.sensor_data import MODEL_TILT
from estimator.posterior.sampling.sampler import Effort
from estimator.report.result import Result
from estimator.report.run_files import write_report
from estimator.storage.posteriors import NotKnown, StoredPosterior
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS
from tests.estimator.little_effort import little_effort, usual_weighing
from tests.estimator.model_robot import (
    PROBLEM,
    TRUE_LENGTHS,
    ModelRobot,
    changed,
    make_order,
    serving,
    without_plots,
)


class Interrupting(Listener):
    """Interrupts after some pieces of work, as Ctrl-C does."""

    def __init__(self, after: int | None = None):
        self.reasons: list[str] = []
        self._after = after
        self._pieces = 0

    def chosen(self, number: int, reason: str, bits: float | None) -> None:
        self.reasons.append(reason)

    def worked(self, work: float, what: str) -> None:
        self._pieces += 1
        if self._pieces == self._after:
            raise KeyboardInterrupt


@pytest.fixture(scope="module", autouse=True)
def soon_done() -> Iterator[None]:
    with little_effort(), usual_weighing():
        yield


def order(folder: Path, uri: str) -> RunConfig:
    return changed(make_order(folder, uri), method="posterior", interactions=2)


def outcome(result: Result) -> dict[str, object]:
    assert result.complete
    return result.model_dump(
        exclude={"wall_seconds", "robot_uri", "robot", "versions", "problem_asked"}
    )


def whole(folder: Path, interrupt_after: int | None = None) -> Result:
    run = folder / "run"
    with serving(ModelRobot()) as uri, pytest.MonkeyPatch.context() as patched:
        patched.setattr(
            posterior_method, "PRECISE", 1.0
        )  # m: any length is known, and alternatives
        asked, listener = order(folder, uri), Interrupting(interrupt_after)
        if interrupt_after is None:
            return identify(run, asked, IN_THIS_PROCESS, listener, report=write_report)
        with pytest.raises(KeyboardInterrupt):
            identify(run, asked, IN_THIS_PROCESS, listener, report=without_plots)
        return resume(run, IN_THIS_PROCESS, Interrupting(), robot=uri, report=without_plots)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    folder = tmp_path_factory.mktemp("posterior")
    return whole(folder), folder / "run"


def test_lengths_are_found_with_intervals_that_hold_them(
    uninterrupted: tuple[Result, Path],
) -> None:
    result, _ = uninterrupted
    assert result.posterior is not None
    assert result.posterior.explained
    assert (
        result.posterior.probability == 1 - result.posterior.misspecification_probability
    )  # of known attachments
    assert 0 < result.posterior.misspecification_probability < 0.15
    assert result.interactions == 2
    assert result.simulations_requested >= result.simulations_run > 0
    for length, true in zip(result.posterior.lengths_m, TRUE_LENGTHS, strict=True):
        assert length.low - 0.003 < true < length.high + 0.003
    assert result.posterior.simulated > 0
    assert len(result.posterior.steps) == len(result.posterior.predicted) == 2
    assert result.best_models[0].leg_lengths_m == pytest.approx(TRUE_LENGTHS, abs=0.02)


def test_everything_is_on_disk(uninterrupted: tuple[Result, Path]) -> None:
    result, directory = uninterrupted
    for name in ("result.json", "posterior.csv", "plots/probability.png", "plots/lengths.png"):
        assert (directory / name).stat().st_size > 100
    with RunStore.open(directory, to_write=False) as store:
        assert store.complete
        assert len(store.posteriors()) == 2
        weights = store.posteriors()[-1][0].weights
    assert np.sum(weights) == pytest.approx(1.0)
    assert result.posterior is not None
    rows = (directory / "posterior.csv").read_text().splitlines()
    assert len(rows) == 1 + result.posterior.samples


def test_a_program_gets_what_the_run_knows(uninterrupted: tuple[Result, Path]) -> None:
    result, directory = uninterrupted
    known = load(directory)
    assert result.posterior is not None
    assert known.probability == result.posterior.probability
    assert known.attachments == result.posterior.attachments
    assert len(known) == result.posterior.samples
    assert known.best_body is not None
    lengths = [limb.length for limb in driven_limbs(known.best_body)]
    assert tuple(lengths) == result.best_models[0].leg_lengths_m
    assert (known.capabilities.robot, known.problem.name) == ("model", result.problem)
    present = sum(
        known.weights @ known.log_likelihood(item.angles, item) for item in known.observations
    )
    assert present / 2 > 5.0  # nats: where it is known, and by noise that is small
    low, high = known.program_range.T
    programs, heights = best_programs(
        lambda some: known.predict(some).clearance @ known.weights,
        known.program_range,
        np.random.default_rng(1),
        candidates=np.random.default_rng(2).uniform(low, high, (30, 4)),
    )
    assert known.predict(programs[0]).clearance @ known.weights == pytest.approx(heights[0])


@pytest.mark.parametrize("after", [1, 2])
def test_a_run_that_was_broken_off_ends_as_one_that_never_was(
    uninterrupted: tuple[Result, Path], tmp_path: Path, after: int
) -> None:
    assert outcome(whole(tmp_path, after)) == outcome(uninterrupted[0])


def test_what_is_left_open_comes_with_the_movement_that_would_decide(tmp_path: Path) -> None:
    with serving(ModelRobot()) as uri:
        asked = changed(order(tmp_path, uri), interactions=1)
        path = tmp_path / "legs.toml"
        path.write_text(PROBLEM.replace('hinge = "up"', 'hinge = "unknown"'))
        result = identify(
            tmp_path / "run", asked, IN_THIS_PROCESS, Interrupting(), report=without_plots
        )
    assert result.posterior is not None
    assert result.posterior.explained  # who is not sure of a body says nothing of all others
    assert any(not rival.indistinguishable for rival in result.posterior.rivals)
    movement = result.posterior.next_movement
    assert movement is not None
    assert movement.bits > 0.5
    assert movement.reason.startswith("tells apart: ")
    assert all(abs(angle) <= np.radians(30) for angle in movement.program)


def test_what_is_only_roughly_known_is_found_along(tmp_path: Path) -> None:
    listener = Interrupting()
    with serving(ModelRobot(askew=np.radians(1.5))) as uri:
        asked = changed(order(tmp_path, uri), learn="lengths")
        (tmp_path / "legs.toml").write_text(PROBLEM + "[uncertain]\naccelerometer_deg = 2.0\n")
        result = identify(tmp_path / "run", asked, IN_THIS_PROCESS, listener, report=without_plots)
    assert "accelerometer's own tilt" in listener.reasons[0]
    assert listener.reasons[1].startswith("narrows the lengths by ")
    assert result.posterior is not None
    of = {item.name: item for item in result.posterior.parameters}
    tilt = of["accelerometer's own tilt, left/right"]
    assert np.degrees(tilt.interval.low) < 1.5 < np.degrees(tilt.interval.high)
    assert np.degrees(tilt.interval.high - tilt.interval.low) < 3.0  # before: 6.6
    assert "ground that rises so to the left" in tilt.sentence
    assert len(result.posterior.as_stated_m) == len(TRUE_LENGTHS)


def test_a_robot_that_leans_in_its_zero_pose_is_read_there_once(tmp_path: Path) -> None:
    listener, interrupted = Interrupting(), Interrupting(after=1)
    with serving(ModelRobot(askew=np.radians(2.7))) as uri:
        asked = changed(order(tmp_path, uri), interactions=3)
        result = identify(tmp_path / "run", asked, IN_THIS_PROCESS, listener, report=without_plots)
    with RunStore.open(tmp_path / "run") as store:
        moved = [any(item.program) for item in store.interactions()]
        tilts = [row.narrow for row in store.problem.table if row.group == "accelerometer_deg"]
    assert moved == [True, False, True]
    assert listener.reasons[1].startswith(
        "moves nothing, since the robot leans by 2.7° in its zero pose: the ground slopes"
    )
    assert np.degrees(tilts) == pytest.approx([2.7, 2.7])
    with serving(ModelRobot(askew=np.radians(2.7))) as uri:
        asked = changed(asked, robot=uri)
        with pytest.raises(KeyboardInterrupt):
            identify(tmp_path / "again", asked, IN_THIS_PROCESS, interrupted, report=without_plots)
        again = resume(tmp_path / "again", IN_THIS_PROCESS, Listener(), report=without_plots)
    assert outcome(again) == outcome(result)


@pytest.mark.parametrize(
    ("askew", "uncertain"), [(0.9, ""), (2.7, "exact = true"), (2.7, "accelerometer_deg = 0")]
)
def test_a_robot_that_hardly_leans_or_is_as_stated_is_not_read_in_its_zero_pose(
    tmp_path: Path, askew: float, uncertain: str
) -> None:
    with serving(ModelRobot(askew=np.radians(askew))) as uri:
        asked = changed(order(tmp_path, uri), learn="lengths", interactions=2)
        (tmp_path / "legs.toml").write_text(PROBLEM + f"[uncertain]\n{uncertain}\n")
        identify(tmp_path / "run", asked, IN_THIS_PROCESS, Interrupting(), report=without_plots)
    with RunStore.open(tmp_path / "run") as store:
        assert all(any(item.program) for item in store.interactions())


def test_a_robot_that_is_exactly_as_stated_has_nothing_else_open(tmp_path: Path) -> None:
    with serving(ModelRobot()) as uri:
        asked = changed(order(tmp_path, uri), interactions=1)
        (tmp_path / "legs.toml").write_text(PROBLEM + "[uncertain]\nexact = true\n")
        result = identify(
            tmp_path / "run", asked, IN_THIS_PROCESS, Interrupting(), report=without_plots
        )
    assert result.posterior is not None
    assert not result.posterior.parameters
    assert not result.posterior.causes
    assert not result.posterior.as_stated_m


def test_a_run_ends_as_soon_as_it_is_sure(tmp_path: Path) -> None:
    with serving(ModelRobot()) as uri:
        asked = changed(order(tmp_path, uri), interactions=9, sure=0.9)
        result = identify(
            tmp_path / "run", asked, IN_THIS_PROCESS, Listener(), report=without_plots
        )
    assert result.complete
    assert result.interactions < 9
    assert result.posterior is not None
    with RunStore.open(tmp_path / "run") as store:
        (before, _), (belief, cost) = store.posteriors()[-2:]
        # the last one was reweighted since, the one before it stands as it was
        assert before.as_stated_m
        assert all(one.high - one.low <= 2 * posterior_method.PRECISE for one in before.as_stated_m)
        # as if the simulator had made it less sure
        unsure = belief.model_copy(update={"misspecification_probability": 0.5})
        store.save_posterior(result.interactions - 1, unsure, cost, None)
    again = resume(tmp_path / "run", IN_THIS_PROCESS, Listener(), report=without_plots)
    assert again.interactions == result.interactions  # no robot is there that could be moved


def test_a_run_that_is_sure_at_once_puts_it_to_the_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(posterior_method, "PRECISE", 1.0)  # m: any length is known
    with serving(ModelRobot()) as uri:
        asked = changed(order(tmp_path, uri), interactions=9, sure=0.9)
        result = identify(
            tmp_path / "run", asked, IN_THIS_PROCESS, Listener(), report=without_plots
        )
    assert result.interactions == 2
    assert result.posterior is not None
    assert result.posterior.next_movement is None


def test_a_run_is_not_sure_while_causes_compete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And at its end it says which movement would tell them apart."""
    monkeypatch.setattr(posterior_method, "PRECISE", 1.0)
    monkeypatch.setattr(StoredPosterior, "knows_cause", lambda *_: False)
    with serving(ModelRobot()) as uri:
        asked = changed(order(tmp_path, uri), interactions=3, sure=0.9)
        result = identify(
            tmp_path / "run", asked, IN_THIS_PROCESS, Listener(), report=without_plots
        )
    assert result.interactions == 3
    assert result.posterior is not None
    assert result.posterior.next_movement is not None


def test_a_robot_that_changes_on_the_way_is_not_explained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once two movements have left it as sure: one statement of 0.95 in twenty may be wrong."""
    monkeypatch.setattr(posterior_method, "probability_of", lambda *_: 0.01)
    with serving(ModelRobot()) as uri:
        result = identify(
            tmp_path / "run",
            changed(order(tmp_path, uri), interactions=3, seed=1),
            IN_THIS_PROCESS,
            Listener(),
            report=without_plots,
        )
    assert result.posterior is not None
    assert [step.explained for step in result.posterior.steps] == [True, True, False]
    assert "explains both interactions 1 to 2, after which another was sure, and" in (
        result.posterior.verdict
    )


def test_what_a_robot_has_otherwise_is_named_with_its_amount(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also by a run that was broken off before its last word.

    And it has not changed, though other attachments were sure before that was known.
    """
    monkeypatch.setattr(posterior_method, "probability_of", lambda *_: 0.01)
    more = Effort(levels=4, chains_per_level=32, steps=40, rounds=2, particles=256, samples=128)
    monkeypatch.setattr(posterior_method, "Effort", lambda: more)
    with serving(ModelRobot(travel=1.25)) as uri:
        asked = changed(order(tmp_path, uri), interactions=4, seed=2)
        run = tmp_path / "run"
        with pytest.raises(KeyboardInterrupt):
            identify(run, asked, IN_THIS_PROCESS, Interrupting(4), report=without_plots)
        result = resume(run, IN_THIS_PROCESS, Listener(), robot=uri, report=without_plots)
    assert result.posterior is not None
    assert result.posterior.explained
    assert result.posterior.causes[0].name == "travel of all servos"
    assert re.search(r"all servos turning 1\.[23]\d* times", result.posterior.verdict)
    assert result.posterior.causes[0].check in result.posterior.verdict
    assert result.posterior.misspecification_probability > 0.1  # as much reads like one amount
    assert "or something that no check looks for" in result.posterior.verdict


def test_noise_that_is_not_announced_is_no_other_body(tmp_path: Path) -> None:
    with serving(ModelRobot(noise=3 * MODEL_TILT)) as uri:
        asked = changed(order(tmp_path, uri), interactions=4, seed=4)
        path = tmp_path / "legs.toml"
        exact = "[uncertain]\nexact = true\n"
        path.write_text(PROBLEM.replace('hinge = "up"', 'hinge = "unknown"', 1) + exact)
        result = identify(
            tmp_path / "run", asked, IN_THIS_PROCESS, Listener(), report=without_plots
        )
    assert result.posterior is not None
    assert result.posterior.not_known is NotKnown.POOR_FIT
    assert result.posterior.explained
    assert "but poorly" in result.posterior.verdict


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"population": 4}, "belong to the method paper"),
        ({"search": "deterministic-crowding"}, "belong to the method paper"),
        ({"objective": "largest"}, "search, objective, .* belong to the method paper"),
        ({"method": "paper", "sure": 0.9}, "sure belongs to the method posterior"),
        ({"method": "paper", "learn": "mass"}, "learn mass belongs to the method posterior"),
        ({"explore": "random", "learn": "mass"}, "is for the rule information"),
        ({"physics": "pybullet"}, "needs a physics that takes arrays"),
    ],
)
def test_what_the_method_cannot_do_is_refused(
    tmp_path: Path, changes: dict[str, object], reason: str
) -> None:
    with serving(ModelRobot()) as uri:
        asked = changed(order(tmp_path, uri), **changes)
        with pytest.raises(EstimatorError, match=reason):
            identify(tmp_path / "run", asked, IN_THIS_PROCESS, Listener(), report=without_plots)
    assert not (tmp_path / "run").exists()
