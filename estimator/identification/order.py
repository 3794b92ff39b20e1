"""What a person asks of a new run, and what a method makes of what that leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, NamedTuple, TypeAlias

from estimator.errors import EstimatorError
from estimator.exploration.rules import RULES
from estimator.identification.paper.objectives import OBJECTIVES
from estimator.identification.paper.search import SEARCHES
from estimator.physics.backends import REFERENCE, physics_class
from estimator.physics.base import ArrayPhysics
from estimator.readings.modalities import MODALITIES

MethodName: TypeAlias = Literal["posterior", "paper"]


class Defaults(NamedTuple):
    """What a method works with where nobody asks for anything else."""

    physics: str
    explore: str


METHODS: Final = MappingProxyType(
    {
        "posterior": Defaults(physics="statics", explore="information"),
        "paper": Defaults(physics=REFERENCE, explore="random"),
    }
)


@dataclass(frozen=True, kw_only=True)
class Order:
    """What a person asks of a new run; ``None`` leaves the choice to the problem or the record."""

    robot: str
    problem: str
    seed: int
    method: MethodName = "posterior"
    physics: str | None = None
    search: str | None = None
    objective: str = "largest"
    explore: str | None = None
    sure: float | None = None
    modalities: tuple[str, ...] = tuple(MODALITIES)
    interactions: int | None = None
    population: int | None = None
    generations: int | None = None
    full_steps: bool = False
    keys: Path | None = None


class Choices(NamedTuple):
    """What an order leaves open, decided by its method."""

    physics: str
    explore: str
    search: str


def choices_of(order: Order) -> Choices:
    """What to work with.

    Raises:
        EstimatorError: There is no such thing, or the method has no use for it.
    """
    if order.method not in METHODS:
        raise EstimatorError(f"there is no method {order.method!r}: choose {' or '.join(METHODS)}")
    defaults = METHODS[order.method]
    chosen = Choices(
        physics=order.physics or defaults.physics,
        explore=order.explore or defaults.explore,
        search=order.search or next(iter(SEARCHES.own)),
    )
    kind = physics_class(chosen.physics)
    RULES.check(chosen.explore)
    SEARCHES.check(chosen.search)
    OBJECTIVES.check(order.objective)
    if order.method == "paper" and order.sure is not None:
        raise EstimatorError(
            "sure belongs to the method posterior, since a population does not know how good it "
            "is: leave it out, or leave out --method paper"
        )
    of_paper = (order.search, order.population, order.generations)
    if order.method == "posterior" and (order.full_steps or of_paper != (None, None, None)):
        raise EstimatorError(
            "search, population, generations and full steps belong to the method paper: leave them "
            "out, or add --method paper"
        )
    if order.method == "posterior" and not issubclass(kind, ArrayPhysics):
        raise EstimatorError(
            f"the method posterior needs a physics that takes arrays of bodies and knows path "
            f"margins, and {chosen.physics} does not: leave --physics out (then it is "
            f"{defaults.physics}, and {REFERENCE} has the last word), or take --method paper"
        )
    return chosen
