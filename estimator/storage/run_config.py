"""What a person asks of a run, and what the run then works with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from estimator.problem.values import Population
from estimator.readings.modalities import MODALITIES

MethodName: TypeAlias = Literal["posterior", "paper"]
Learn: TypeAlias = Literal["lengths", "mass", "all"]


class RunConfig(BaseModel):
    """What is asked of a new run.

    The command line has an option for each field, with the field's description; what ``None``
    leaves open is decided by the method, the problem or the recorded run.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    robot: str = Field(description="tcp://HOST:PORT, file:READINGS.csv or replay:DIR.")
    problem: str = Field(description="A problem's name, or a .toml file.")
    interactions: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="Default: the problem's, or all that were recorded."
    )
    method: MethodName = Field(
        default="posterior",
        description="posterior: samples of every body that explains the readings, and how sure it "
        "is; paper: one population, optimised as in the paper.",
    )
    physics: str | None = Field(
        default=None,
        description="What predicts a model's readings: statics, pybullet, mujoco, or a plug-in. "
        "Default: the method's.",
    )
    explore: str | None = Field(
        default=None,
        description="What chooses motor programs: information, disagreement, random, or a "
        "plug-in. Default: the method's.",
    )
    learn: Learn = Field(
        default="all",
        description="What the rule information moves the robot for once attachments are known: "
        "lengths, mass (of parts and of the main body), or all that is not known.",
    )
    search: str | None = Field(
        default=None,
        description="What optimises the paper's population: deterministic-crowding, or a plug-in. "
        "Default: the first.",
    )
    objective: str | None = Field(
        default=None,
        description="What that minimises: largest, robust-mean, or a plug-in. Default: the first.",
    )
    sure: Annotated[float, Field(ge=0.5, le=0.98)] | None = Field(
        default=None,
        description="Of the method posterior: end as soon as the attachments are so probable, "
        "lengths known to 5 mm, and one more movement has left them so. No more than 0.98: some "
        "of what a robot may have otherwise feels like another robot. One that seems to have "
        "something otherwise by an amount never is so sure: measure that, and say so in the "
        "problem.",
    )
    modalities: tuple[str, ...] | None = Field(
        default=None,
        description=f"Sensors that count, of {','.join(MODALITIES)}. Default: all of the robot's.",
    )
    seed: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Source of all randomness. Default: a new one."
    )
    population: Population | None = Field(
        default=None, description="The paper's, an even number. Default: the problem's."
    )
    generations: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="After each interaction. Default: the problem's."
    )
    full_steps: bool = Field(
        default=False, description="Simulate on after a body has come to rest."
    )


class RunSettings(RunConfig):
    """Everything that decides a run's outcome, apart from the robot; nothing is left open.

    Attributes:
        problem_text: TOML of the problem as it was: later edits of the file do not reach the run.
        reference: Name of the physics back-end that checks the result in the end.
        plugins: Version by name of each package from outside that decides the outcome too.
    """

    physics: str
    explore: str
    search: str
    objective: str
    modalities: tuple[str, ...]
    seed: Annotated[int, Field(ge=0)]
    interactions: Annotated[int, Field(ge=1)]
    population: Population
    generations: Annotated[int, Field(ge=1)]
    problem_text: str
    reference: str
    plugins: Mapping[str, str] = Field(default_factory=dict)

    @property
    def keeps_samples(self) -> bool:
        """Whether the method keeps samples of a posterior, not a population."""
        return self.method == "posterior"
