"""The objective error: how far the best model is from the true body.

Only a scorer may look at the truth. Rows of driven parts are never permuted: leg k of the model is
compared with what motor k of the robot turns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.body.limbs import driven_limbs
from estimator.body.morphology import Array, Morphology
from estimator.errors import TruthError
from estimator.evaluation.attachments import Comparison, Configuration, Truth
from estimator.evaluation.length_search import LengthSearch
from estimator.identification.paper.fit import fit_bodies
from estimator.identification.paper.objectives import LargestError
from estimator.physics.base import ArrayPhysics, Physics
from estimator.physics.equivalence import PROGRAMS, Reference
from estimator.posterior.fitted import FittedPosterior
from estimator.randomness import Stream, generator
from estimator.readings.observation import Observation, touched
from estimator.storage.store import RunStore


class Score(BaseModel):
    """A run against the truth; lists are in motor order.

    Attributes:
        complete: Whether the run is complete; else its best model so far is scored.
        joints: Names of the joints that turn the legs.
        true_lengths_m: Length of each leg on the robot, m.
        lengths_m: Length of each leg on the best model, m.
        leg_errors_m: Absolute error of each leg's length, m.
        leg_errors_signed_m: Estimated minus true length of each leg, m; their mean is the bias.
        mean_leg_error_m: Mean of the absolute errors, m.
        mean_signed_leg_error_m: Mean of the signed errors, m.
        touched: Whether each leg touched the ground in some interaction; ``None``: not sensed.
        mean_leg_error_touched_m: Mean absolute error over the legs that touched the ground, m;
            ``None`` when there are none.
        mean_leg_error_never_touched_m: Mean absolute error over the legs that never touched the
            ground, m; ``None`` when there are none.
        configurations: Parent, mount and hinge of each part beside the truth.
        configurations_right: Number of configurations that are right.
        configurations_right_up_to_equivalence: Number of configurations that are right, or such as
            no sensor of the run could tell from the truth.
        configurations_total: Number of configurations: three per driven part, and two per locked
            part whose joint the problem names or a fixed joint of the truth can be told to be.
        configurations_informative: Number of configurations that were to be found and might have
            been wrong; the first part, for one, has nothing to sit on but the main body.
        configurations_informative_right: Number of informative configurations that are right.
        configurations_informative_right_up_to_equivalence: Number of informative configurations
            that are right up to equivalence.
        configurations_chance: Number of configurations that a random model has right on average.
        not_representable: Sentences on what the genome cannot express; a configuration that it
            cannot express counts as wrong.
        true_body_errors: Subjective error in each interaction that the true body would have as a
            model, as far as the genome can express it; ``None`` where its simulation is
            invalid. Where one of them exceeds the best model's error, no search could have found
            the truth: simulated, it comes to rest otherwise than the robot did.
        true_body_margins_deg: Path margin of the true body in each interaction, by statics: where
            it is small, the robot may come to rest elsewhere when it repeats the movement.
    """

    model_config = ConfigDict(frozen=True)

    complete: bool = True
    joints: tuple[str, ...]
    true_lengths_m: tuple[float, ...]
    lengths_m: tuple[float, ...]
    leg_errors_m: tuple[float, ...]
    leg_errors_signed_m: tuple[float, ...]
    mean_leg_error_m: float
    mean_signed_leg_error_m: float
    touched: tuple[bool | None, ...]
    mean_leg_error_touched_m: float | None
    mean_leg_error_never_touched_m: float | None
    configurations: tuple[Configuration, ...]
    configurations_right: int
    configurations_right_up_to_equivalence: int
    configurations_total: int
    configurations_informative: int
    configurations_informative_right: int
    configurations_informative_right_up_to_equivalence: int
    configurations_chance: float
    not_representable: tuple[str, ...]
    true_body_errors: tuple[float | None, ...]
    true_body_margins_deg: tuple[float, ...]

    def is_of(self, complete: bool, lengths: Sequence[float]) -> bool:
        """Whether this is the score of a run in the given state, which has not gone on since.

        Args:
            complete: Whether the run is complete.
            lengths: Length of each leg of the run's best model, m.
        """
        return complete == self.complete and np.array_equal(lengths, self.lengths_m)

    @property
    def true_body_error(self) -> float | None:
        """Largest subjective error of the true body; ``None`` unless all are known."""
        errors = [error for error in self.true_body_errors if error is not None]
        return max(errors) if errors and len(errors) == len(self.true_body_errors) else None


def score(store: RunStore, truth: Path, physics: ArrayPhysics, reference: Physics) -> Score:
    """Scores the best model of a run.

    Args:
        store: The run.
        truth: The robot's URDF.
        physics: Computes the readings by which configurations are equivalent or not, and margins.
        reference: Predicts the readings of the true body as a model.

    Raises:
        TruthError: The URDF is wrong, is another robot's, or the run has no model yet.
    """
    fitted = FittedPosterior.of(store)
    if fitted is None or fitted.best is None:
        raise TruthError(f"{store.directory} has no model yet, so there is nothing to score")
    body = fitted.genome.decode(fitted.best)
    robot = Truth.read(truth, store.problem, store.capabilities)
    comparison = Comparison(store.problem, store.genome, body, robot)
    search = length_search(store, comparison.true_body, physics)
    configurations = comparison.configurations(search.is_like)
    informative = [item for item in configurations if item.searched]
    lengths = tuple(limb.length for limb in driven_limbs(body))
    signed = np.array(lengths) - np.array(comparison.true_lengths)
    observed = store.observations()
    touching = tuple(touched(limb.sensors, observed) for limb in driven_limbs(comparison.true_body))
    return Score(
        complete=store.complete,
        joints=tuple(leg.name for leg in robot.legs.values()),
        true_lengths_m=comparison.true_lengths,
        lengths_m=lengths,
        leg_errors_m=tuple(np.abs(signed).tolist()),
        leg_errors_signed_m=tuple(signed.tolist()),
        mean_leg_error_m=float(np.mean(np.abs(signed))),
        mean_signed_leg_error_m=float(np.mean(signed)),
        touched=touching,
        mean_leg_error_touched_m=_mean(signed, touching, which=True),
        mean_leg_error_never_touched_m=_mean(signed, touching, which=False),
        configurations=configurations,
        configurations_right=sum(item.right for item in configurations),
        configurations_right_up_to_equivalence=sum(
            item.right_up_to_equivalence for item in configurations
        ),
        configurations_total=len(configurations),
        configurations_informative=len(informative),
        configurations_informative_right=sum(item.right for item in informative),
        configurations_informative_right_up_to_equivalence=sum(
            item.right_up_to_equivalence for item in informative
        ),
        configurations_chance=sum(item.chance for item in configurations),
        not_representable=comparison.not_representable,
        true_body_errors=tuple(
            _error(comparison.true_body, item, store.settings.modalities, reference)
            for item in observed
        ),
        true_body_margins_deg=_margins(comparison.true_body, observed, physics),
    )


def _error(
    body: Morphology, seen: Observation, modalities: Sequence[str], physics: Physics
) -> float | None:
    (error,) = fit_bodies([body], [seen], modalities, physics, LargestError()).errors.tolist()
    return error if math.isfinite(error) else None


def _margins(
    body: Morphology, seen: Sequence[Observation], physics: ArrayPhysics
) -> tuple[float, ...]:
    margins = physics.path_margins([(body, np.array(item.taken)) for item in seen])
    return tuple(np.degrees(margins).tolist())


def length_search(store: RunStore, true_body: Morphology, physics: ArrayPhysics) -> LengthSearch:
    """Test of equivalence with the true body, for the run's motors and modalities."""
    problem, rng = store.problem, generator(store.settings.seed, Stream.EQUIVALENCE)
    programs = np.array([problem.random_program(rng, store.capabilities) for _ in range(PROGRAMS)])
    reference = Reference(true_body, programs, physics, store.settings.modalities)
    return LengthSearch(reference, np.array([rule.length for rule in problem.parts]))


def _mean(errors: Array, touching: Sequence[bool | None], *, which: bool) -> float | None:
    chosen = [
        abs(error) for error, felt in zip(errors.tolist(), touching, strict=True) if felt is which
    ]
    return float(np.mean(chosen)) if chosen else None
