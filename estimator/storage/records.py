"""What a run keeps about itself: its settings, interactions, generations and predictions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, computed_field

from estimator.readings.observation import Observation, Program
from estimator.storage.posteriors import Count, FitVerdict

_IDS_PER_CONNECTION: Final = 2**20


class Counters(BaseModel):
    """What a run has cost so far.

    Attributes:
        simulations_requested: Models x motor programs that the search asked for; the size by which
            searches are compared.
        simulations_run: Number of requested simulations that had to be run.
        simulations_invalid: Number of simulations run that were invalid, which counts as the worst
            error; see ``readings.observation.PredictedReadings``.
        simulations_undecided: Number of simulations run that had no weight, since the body lay in
            balance.
        steps: Number of physics steps simulated.
        wall_seconds: Time spent, over all processes that worked on the run, s.
    """

    model_config = ConfigDict(frozen=True)

    simulations_requested: Count = 0
    simulations_run: Count = 0
    simulations_invalid: Count = 0
    simulations_undecided: Count = 0
    steps: Count = 0
    wall_seconds: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0

    def including(self, finish: Finish, interactions: int) -> Counters:
        """These counters plus the cost of the reference back-end's simulations at the end."""
        return self.model_copy(
            update={
                "simulations_requested": self.simulations_requested
                + len(finish.models) * interactions,
                "simulations_run": self.simulations_run + finish.simulations,
                "simulations_invalid": self.simulations_invalid + finish.invalid,
                "steps": self.steps + finish.steps,
            }
        )


class Finish(BaseModel):
    """The leading models of a finished search, simulated in the reference back-end.

    Attributes:
        models: Indices in the final population, best first by the search's own physics.
        searched: Subjective errors of these models by the search's own physics.
        simulated: Subjective errors of these models in the reference back-end; infinite where a
            simulation is invalid.
        simulations: Number of simulations that this took.
        invalid: Number of these simulations that were invalid.
        steps: Number of physics steps that this took.
    """

    model_config = ConfigDict(frozen=True, ser_json_inf_nan="constants")

    models: tuple[Count, ...]
    searched: tuple[float, ...]
    simulated: tuple[float, ...]
    simulations: Count
    invalid: Count = 0
    steps: Count


class BestFit(FitVerdict):
    """How the best model of a finished search explains the readings.

    Attributes:
        interactions: Number of interactions.
    """

    interactions: Count

    # mypy knows no decorators on properties; pydantic's manual says to ignore that.
    @computed_field  # type: ignore[prop-decorator]
    @property
    def explained(self) -> bool:
        """Whether the model explains the readings, but for outliers."""
        return self.is_adequate(self.interactions)


@dataclass(frozen=True, kw_only=True)
class Ticket:
    """The name of a request that was or is about to be sent: its id and the robot's session."""

    request_id: int
    session: str


def first_id(connection: int) -> int:
    """First request id of a connection, by the connection's number; no two share any id."""
    return connection * _IDS_PER_CONNECTION + 1


@dataclass(frozen=True, kw_only=True)
class InteractionRecord:
    """A motor program, the ticket under which it was last asked for, and what it returned.

    Attributes:
        program: Target angle of each joint, rad.
        ticket: Ticket under which it was last asked for.
        observation: Observation that it returned.
        reason: Why it was chosen, for people.
        bits: Information that it was expected to give, bits, where the rule said.
    """

    program: Program
    ticket: Ticket | None = None
    observation: Observation | None = None
    reason: str = ""
    bits: float | None = None


def performed(
    joints: int,
    program: str,
    request_id: int | None,
    session: str | None,
    observation: str | None,
) -> dict[str, Any]:
    """Fields ``program``, ``ticket`` and ``observation`` of a record, from a database's columns.

    Args:
        joints: Number of the robot's joints.
        program: Motor program, JSON.
        request_id: Request id of the ticket.
        session: The robot's session, of the ticket.
        observation: Observation, JSON.

    Raises:
        ValueError: The columns are no record of such a robot.
    """
    ticket = None
    if request_id is not None and session is not None:
        ticket = Ticket(request_id=request_id, session=session)
    targets = tuple(map(float, json.loads(program)))
    observed = None if observation is None else Observation.model_validate_json(observation)
    if len(targets) != joints or (observed is not None and len(observed.angles) != joints):
        raise ValueError(f"a motor program is not one of {joints} joints")
    return {"program": targets, "ticket": ticket, "observation": observed}


@dataclass(frozen=True, kw_only=True)
class Prediction(InteractionRecord):
    """A motor program whose readings were predicted before it was performed.

    Attributes:
        readings: Predicted readings by group of models, in the form that ``validate`` stores.
    """

    readings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Generation:
    """The population after one generation.

    Attributes:
        number: Number of the generation in the whole run, from 0. The first generation of an
            iteration is the carried-over (at first random) population, evaluated on all
            observations so far.
        iteration: Number of the interaction that was last performed, from 0.
        errors: Subjective error of every model.
        best: Genes of the model with the smallest error.
        counters: Cost of the run by then.
    """

    number: int
    iteration: int
    errors: tuple[float, ...]
    best: tuple[float, ...]
    counters: Counters


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """State of a run's search or sampler.

    Attributes:
        number: Number of the last generation, or of the last interaction, whichever the method
            counts.
        state: State as the method wrote it.
    """

    number: int
    state: Mapping[str, Any]
