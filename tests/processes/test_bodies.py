"""Robots of all shapes go through the whole path: identified, validated and scored alike."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pytest

from bench.daemons import simulator
from estimator.evaluation.score import Score, score
from estimator.evaluation.validate import validate
from estimator.identification.method import Listener
from estimator.identification.run import identify, reconnect
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.storage.run_config import RunConfig
from estimator.storage.store import RunStore
from estimator.workplaces import IN_THIS_PROCESS
from sim_robot.world.body import body_path
from tests.estimator.model_robot import without_plots


def whole_path(folder: Path, body: str, problem: str) -> Score:
    """A run on the smallest of budgets, its validation and its score."""
    with simulator("--body", body, "--seed", "1") as robot:
        order = RunConfig(
            robot=robot.uri,
            problem=problem,
            method="paper",
            seed=7,
            interactions=2,
            population=4,
            generations=1,
        )
        result = identify(folder / "run", order, IN_THIS_PROCESS, Listener(), report=without_plots)
        assert result.complete
        assert len(result.best_models[0].leg_lengths_m) == len(result.legs)
        with RunStore.open(folder / "run") as store:
            with (
                closing(PyBulletPhysics(store.world)) as physics,
                closing(reconnect(store, robot.uri, Listener())) as link,
            ):
                found = validate(store, physics, link, programs=2, saved=None, listener=Listener())
                assert found.programs == 2
                assert found.random_models["tilt_deg"] is not None
            world = store.world
            with StaticsPhysics(world) as exact, closing(PyBulletPhysics(world)) as reference:
                return score(store, body_path(body), exact, reference)


@dataclass(frozen=True)
class Case:
    body: str
    problem: str
    lengths: tuple[float, ...]
    configurations: int
    unsayable: str = ""


CASES = (
    Case("damaged_leg", "topological-20", (0.22, 0.22, 0.13, 0.22), 20),
    Case("plate", "tripod", (0.18, 0.2, 0.22), 9),
    Case("leg_on_leg", "topological", (0.2, 0.18, 0.2, 0.2, 0.12), 15),
    Case("twisted_hinge", "topological", (0.19,) * 4, 12, "hip_back has its axis 30 degrees"),
)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.body)
def test_any_body_is_identified_validated_and_scored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: Case
) -> None:
    monkeypatch.setattr("estimator.evaluation.validate.RANDOM_MODELS", 4)
    found = whole_path(tmp_path, case.body, case.problem)
    assert found.true_lengths_m == pytest.approx(case.lengths, abs=1e-6)
    assert found.configurations_total == case.configurations
    assert 0 < found.configurations_right <= found.configurations_right_up_to_equivalence
    assert [text.startswith(case.unsayable) for text in found.not_representable] == (
        [True] if case.unsayable else []
    )
