from collections.abc import Sequence

import numpy as np
import pytest

from estimator.body.morphology import Array
from estimator.identification.paper.fit import Modeller
from estimator.identification.paper.objectives import LargestError
from estimator.identification.paper.search import DeterministicCrowding
from estimator.physics.base import Pair, Physics
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.problem.genome import Genome
from estimator.readings.observation import Observation, PredictedReadings
from estimator.storage.records import Counters
from tests.estimator.model_robot import make_capabilities, make_problem

MODALITIES = ("touch", "tilt", "clearance")


class ToyPhysics(Physics):
    """Tilt grows with the first length and the angle; counts what it is asked."""

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        self.simulations += len(pairs)
        readings = PredictedReadings.empty(len(pairs), 4)
        readings.valid[:] = True
        readings.tilt[:, 0] = [body.parts[0].length * program[0] for body, program in pairs]
        return readings


def make_observations(count: int) -> list[Observation]:
    rng = np.random.default_rng(0)
    return [
        Observation(angles=(angle, 0.0, 0.0, 0.0), touch=(False,) * 4, tilt=(0.17 * angle, 0.0))
        for angle in rng.uniform(-0.5, 0.5, count).tolist()
    ]


@pytest.fixture
def genome() -> Genome:
    problem = make_problem()
    return Genome(problem, problem.base(make_capabilities()))


def in_full(
    genome: Genome, genes: Array, physics: ToyPhysics, observations: Sequence[Observation]
) -> Array:
    columns = []
    for observation in observations:
        program = np.array(observation.angles)
        pairs = [(body, program) for body in genome.decode_all(genes)]
        columns.append(LargestError().terms(physics.read(pairs), observation, MODALITIES))
    found: Array = np.max(columns, axis=0)
    return found


@pytest.mark.parametrize("approximation", [None, StaticsPhysics()], ids=["none", "wrong"])
def test_the_early_verdict_decides_as_full_evaluation_would(
    genome: Genome, approximation: StaticsPhysics | None
) -> None:
    # Toy bodies do not move as statics says, so that its guesses put interactions in any order.
    observations = make_observations(4)
    quick, full = (DeterministicCrowding(20, 4, np.random.default_rng(1)) for _ in range(2))
    physics, reference = ToyPhysics(), ToyPhysics()
    modeller = Modeller(
        genome,
        physics,
        MODALITIES,
        Counters(),
        approximation=approximation,
        objective=LargestError(),
    )
    for count in range(1, 5):
        modeller.introduce(quick, observations[:count])
        if count > 1:
            full.forget_errors()
        full.tell(in_full(genome, full.ask(), reference, observations[:count]))
        for _ in range(5):
            modeller.evolve(quick, observations[:count])
            full.tell(in_full(genome, full.ask(), reference, observations[:count]))
        assert np.array_equal(quick.population, full.population)
        assert np.array_equal(quick.errors, full.errors)
    counters = modeller.counters(1.0)
    assert counters.simulations_requested == reference.simulations
    assert counters.simulations_run == physics.simulations < 0.8 * reference.simulations


def test_the_requested_total_is_the_papers_for_its_topological_run(genome: Genome) -> None:
    # 300 models, 40 generations, nine interactions: re-evaluations included.
    observations = make_observations(9)
    modeller = Modeller(genome, ToyPhysics(), MODALITIES, Counters(), objective=LargestError())
    search = DeterministicCrowding(6, 4, np.random.default_rng(1))
    for count in range(1, 10):
        modeller.introduce(search, observations[:count])
        for _ in range(40):
            modeller.evolve(search, observations[:count])
    assert modeller.counters(0.0).simulations_requested * 50 == 553_500


def test_counting_goes_on_where_an_earlier_process_stopped(genome: Genome) -> None:
    before = Counters(simulations_requested=100, simulations_run=60, steps=18_000)
    modeller = Modeller(genome, ToyPhysics(), MODALITIES, before, objective=LargestError())
    search = DeterministicCrowding(6, 4, np.random.default_rng(1))
    modeller.introduce(search, make_observations(1))
    after = modeller.counters(2.5)
    assert (after.simulations_requested, after.simulations_run) == (106, 66)
    assert (after.steps, after.wall_seconds) == (18_000, 2.5)


def test_real_physics_tells_the_true_model_from_others(
    genome: Genome, physics: PyBulletPhysics
) -> None:
    true = np.array([0.6, 0.5, 0.65, 0.55])
    angles = np.radians([20.0, -25.0, -20.0, 15.0])
    felt = physics.read([(genome.decode(true), angles)])
    observation = Observation(
        angles=tuple(angles.tolist()),
        touch=tuple(felt.touch[0].tolist()),
        tilt=(float(felt.tilt[0, 0]), float(felt.tilt[0, 1])),
        clearance=float(felt.clearance[0]),
    )
    search = DeterministicCrowding(
        2, 4, np.random.default_rng(0), population=np.array([true, true * 0.5])
    )
    Modeller(genome, physics, MODALITIES, Counters(), objective=LargestError()).introduce(
        search, [observation]
    )
    assert search.errors[0] == pytest.approx(float(felt.speed[0]), abs=1e-9)
    assert search.errors[1] > 1.0


def test_foresight_saves_simulations_and_changes_no_verdict(genome: Genome) -> None:
    observations = make_observations(5)
    found = []
    for approximation in (None, StaticsPhysics()):
        search = DeterministicCrowding(16, 4, np.random.default_rng(1))
        with PyBulletPhysics() as physics:
            modeller = Modeller(
                genome,
                physics,
                MODALITIES,
                Counters(),
                approximation=approximation,
                objective=LargestError(),
            )
            modeller.introduce(search, observations)
            for _ in range(4):
                modeller.evolve(search, observations)
            found.append((search.population, search.errors, physics.simulations))
    blind, seeing = found
    assert np.array_equal(blind[0], seeing[0])
    assert np.array_equal(blind[1], seeing[1])
    assert seeing[2] < 0.9 * blind[2]
