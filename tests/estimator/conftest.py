"""Random bodies, one engine of each kind and a cluster for the estimator's tests."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest

from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.body.mounts import HINGES, BaseMount, Hinge, PartMount
from estimator.cluster import Cluster
from estimator.exploration.rules import RULES
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.identification.paper.search import SEARCHES
from estimator.physics.backends import BACKENDS
from estimator.physics.pybullet import PyBulletPhysics
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.model.unknowns import Predictor, Unknowns
from tests.estimator.dask_cluster import Dask, Process, dask
from tests.estimator.two_unknown_rows import make_predictor

MakeBody: TypeAlias = Callable[[np.random.Generator], Morphology]
BODY = Base(size=(0.14, 0.14, 0.085), mass=1.0)
DENSITY = 1000.0


@pytest.fixture(autouse=True)
def no_parts_of_another_test() -> Iterator[None]:
    """What a test gave the API of its own is gone after it, as it is in a new process."""
    yield
    for registry in (BACKENDS, OBJECTIVES, RULES, SEARCHES):
        registry._added.clear()


@pytest.fixture(scope="session")
def physics() -> Iterator[PyBulletPhysics]:
    with PyBulletPhysics() as engine:
        yield engine


@pytest.fixture(scope="session")
def statics() -> Iterator[StaticsPhysics]:
    with StaticsPhysics() as engine:
        yield engine


@pytest.fixture(scope="session")
def random_quadruped() -> MakeBody:
    def make(rng: np.random.Generator) -> Morphology:
        upper = [
            Part(parent=BASE, mount=leg, hinge=2, length=length, radius=0.013, motor=leg)
            for leg, length in enumerate(rng.uniform(0.01, 0.2, 4).tolist())
        ]
        lower = [
            Part(parent=leg, mount=1, hinge=2, length=length, radius=0.006, sensor=leg)
            for leg, length in enumerate(rng.uniform(0.01, 0.2, 4).tolist())
        ]
        return Morphology(base=BODY, parts=(*upper, *lower), density=DENSITY)

    return make


@pytest.fixture(scope="session")
def random_tree() -> MakeBody:
    """Eight parts anywhere, with any hinges, about a third of them locked, two of them boxes."""

    def make(rng: np.random.Generator) -> Morphology:
        parts = tuple(
            Part(
                parent=int(rng.integers(BASE, index)),
                mount=int(rng.integers(4)),
                hinge=int(rng.integers(6)),
                length=float(rng.uniform(0.005, 0.2)),
                radius=float(rng.choice([0.006, 0.013])),
                motor=index if rng.random() < 2 / 3 else None,
                sensor=index - 4 if index >= 4 else None,
                shape="box" if index % 3 == 2 else "capsule",
            )
            for index in range(8)
        )
        return Morphology(base=BODY, parts=parts, density=DENSITY)

    return make


@pytest.fixture(scope="session")
def random_tree_of_own_tables(random_tree: MakeBody) -> MakeBody:
    """The same with mounts anywhere, also off the main body's middle plane and rising from it,
    and hinges aslant."""

    def make(rng: np.random.Generator) -> Morphology:
        tree = random_tree(rng)
        axes = rng.normal(size=(6, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        places = zip(
            rng.uniform(-0.1, 0.1, (4, 3)) * (1, 1, 0.2), rng.uniform(-4, 4, 4), strict=True
        )
        return replace(
            tree,
            base=replace(
                tree.base,
                mounts=tuple(
                    BaseMount(
                        name="own", at=tuple(at.tolist()), yaw=float(yaw), elevation=0.2 * row
                    )
                    for row, (at, yaw) in enumerate(places)
                ),
            ),
            part_mounts=tuple(
                PartMount(name="own", fraction=float(fraction), yaw=float(yaw), elevation=0.3 * row)
                for row, (fraction, yaw) in enumerate(rng.uniform((0, -4), (1, 4), (4, 2)))
            ),
            hinges=(
                *HINGES[:3],
                *(Hinge(name="own", axis=tuple(axis)) for axis in axes[3:].tolist()),
            ),
        )

    return make


@pytest.fixture
def predictor() -> Predictor:
    """Of a problem with two unknown rows."""
    return make_predictor("[0.02, 0.40]")


@pytest.fixture
def narrow() -> Predictor:
    """The same with lengths in a narrow range, so that a coarse grid takes them all in."""
    return make_predictor("[0.12, 0.18]")


@pytest.fixture
def short() -> Predictor:
    """The same with known lengths, so that there are 1,152 bodies in all."""
    return make_predictor("0.15")


@pytest.fixture
def unknowns(predictor: Predictor) -> Unknowns:
    return predictor.unknowns


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    with dask(tmp_path_factory.mktemp("dask")) as processes:
        yield processes


@pytest.fixture
def two_workers(cluster: Dask) -> list[Process]:
    cluster.have_workers(2)
    return cluster.workers


@pytest.fixture
def connected(cluster: Dask, two_workers: list[Process]) -> Iterator[Cluster]:
    with Cluster(cluster.address, patience=1.0) as connection:
        yield connection
