"""A posterior after an interaction: what is stated of it, and how a run stores it."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, computed_field, model_validator

from estimator.body.morphology import Array
from estimator.readings.observation import PredictedReadings, Program, Reading

OUTLIERS: Final = 1
"""Largest number of unexplained interactions that a body of the problem may have, as outliers."""

LARGEST_OUTLIER: Final = 6.0
"""Largest residual of an outlier, in standard deviations: beyond it something happened that the
model does not contain, however probable it makes outliers."""

SUFFICIENT_COVERAGE: Final = 0.5
"""Coverage, a share of the posterior, below which searches have found different bodies."""

MISSPECIFIED: Final = 0.9
"""Probability that the robot is otherwise in a way that is not looked for, from which on no body of
the problem explains the readings."""

SURE: Final = 0.95
"""Stated probability from which on attachments count as known."""

RIVAL: Final = 0.01
"""Smallest probability of other attachments that is reported."""

LOW_ESS: Final = 10.0
"""Effective sample size below which what is computed from samples is called uncertain."""

_PROBABLE: Final = 0.5  # a smaller share is improbable, even where few samples tell it


ROUNDING: Final = 1e-6
"""Largest distance by which a share or a gene may lie outside 0 to 1."""

Probability = Annotated[float, Field(ge=0, le=1)]
Share = Annotated[float, Field(ge=0, le=1 + ROUNDING)]
Gene = Annotated[float, Field(ge=-ROUNDING, le=1 + ROUNDING)]
Count = Annotated[int, Field(ge=0)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class NotKnown(StrEnum):
    """Why it is not known how probable attachments are."""

    POOR_FIT = "the best body explains the readings poorly"
    DIFFERENT_BODIES = "the searches have found different bodies"
    FEW_SAMPLES = "few samples stand for the best body"
    FEW_MOVEMENTS = "so few movements can hardly tell it from all others"


class Record(BaseModel):
    """A record of ``result.json``, whose schema requires fields with defaults too."""

    model_config = ConfigDict(frozen=True, json_schema_serialization_defaults_required=True)


class UnexplainedInteraction(Record):
    """An interaction that no body of the problem explains.

    Attributes:
        interaction: Index of the interaction, from 0.
        sensors: Modalities whose readings lie far from what the best body predicts.
        residual: Largest residual of the interaction's readings, in standard deviations of the
            noise as it was estimated.
    """

    interaction: Count
    sensors: tuple[str, ...]
    residual: NonNegative = 0.0


class FitVerdict(Record):
    """How a body explains the readings.

    Attributes:
        unexplained: Interactions that the body leaves unexplained.
        noisy: Modalities whose noise is surely more than twice what is expected, which is the noise
            that the robot announces together with the error of models.
        contradicting: Touch sensors, from 0, that contradict the body too often.
    """

    unexplained: tuple[UnexplainedInteraction, ...]
    noisy: tuple[str, ...]
    contradicting: tuple[Count, ...] = ()

    def has_only_outliers(self, interactions: int) -> bool:
        """Whether the unexplained interactions, of so many in all, may be outliers."""
        are_near = all(interaction.residual <= LARGEST_OUTLIER for interaction in self.unexplained)
        are_few = len(self.unexplained) <= OUTLIERS < interactions
        return not self.unexplained or (are_few and are_near)

    def is_adequate(self, interactions: int) -> bool:
        """Whether the body explains so many interactions, but for outliers."""
        sound = not (self.noisy or self.contradicting)
        return sound and self.has_only_outliers(interactions)


class PredictedInteraction(Record):
    """One interaction as the best body predicts it.

    Attributes:
        touch: Whether each touch sensor meets the ground.
        tilt: Tilt left/right and forward/back, rad.
        clearance: Clearance, m.
        residuals: Measured minus predicted in standard deviations of the noise, by each modality
            that counts and was read; for touch, the number of bits that differ, each as many as it
            is unlikely.
        outlier_probability: Probability that the readings say nothing about the body.
    """

    touch: tuple[bool, ...]
    tilt: tuple[Reading, Reading]
    clearance: Reading
    residuals: dict[str, Reading]
    outlier_probability: Probability

    @classmethod
    def each(
        cls,
        readings: PredictedReadings,
        residuals: Mapping[str, Array],
        counts: Mapping[str, NDArray[np.intp]],
        outliers: Array,
    ) -> tuple[Self, ...]:
        """Each of n interactions.

        Args:
            readings: Readings of the n interactions.
            residuals: Residuals by modality, shape (n,) each.
            counts: Number of readings by modality, shape (n,) each.
            outliers: Probability of each interaction that it is an outlier, shape (n,).
        """
        return tuple(
            cls(
                touch=tuple(readings.touch[at].astype(bool).tolist()),
                tilt=(float(readings.tilt[at, 0]), float(readings.tilt[at, 1])),
                clearance=float(readings.clearance[at]),
                residuals={
                    name: float(values[at])
                    for name, values in residuals.items()
                    if counts[name][at]
                },
                outlier_probability=outlier,
            )
            for at, outlier in enumerate(np.clip(outliers, 0, 1).tolist())
        )


class Interval(Record):
    """A quantity with its 90 % interval.

    Attributes:
        low: Value below which 5 % of the posterior lie.
        median: Value below which half of the posterior lies.
        high: Value below which 95 % of the posterior lie.
    """

    low: Reading
    median: Reading
    high: Reading

    @property
    def width(self) -> float:
        """Distance between its ends."""
        return self.high - self.low


class Cause(Record):
    """What may make the robot otherwise than its problem says.

    Attributes:
        name: Name of the row in the table of parameters.
        probability: Share of the posterior that has this cause, if the table holds what the robot
            has otherwise.
        sentence: The rest of "a robot with …", with the amount and its interval.
        check: What a person should check on the robot.
    """

    name: str
    probability: Share
    sentence: str
    check: str


class NextMovement(Record):
    """The movement that would have come next: the one with the largest expected information.

    Attributes:
        program: Target angles, rad, in motor order.
        reason: Which bodies it discriminates between, in words.
        bits: Information that it is expected to give, bits.
        bits_about_causes: Expected information about which of the competing causes it is, were
            these nearly equally probable, bits; 0: no movement was asked for that tells it.
    """

    program: Program
    reason: str
    bits: Reading
    bits_about_causes: Reading = 0.0


class PosteriorSummary(FitVerdict):
    """What is stated of the posterior after some interactions; the fit is that of the best body.

    Attributes:
        probability_within_problem: Probability of the best body's attachments, or such as no sensor
            can tell from them at the robot's lengths, if the problem describes the robot; never
            more than ``coverage``. ``None``: the best body explains the readings poorly.
        coverage: Share of the posterior that the searches have found, estimated from what they
            found in common (capture-recapture).
        low_ess: Whether the share of the attachments that cannot be told from the best body's
            rests on few effective samples; in a diagnosed run, all that is stated of the body.
        too_early: Whether there were fewer interactions than can tell all attachments apart.
        misspecification_probability: Probability that the robot is otherwise than the problem says
            in a way that is not looked for, or has changed during the run.
        causes: Ways that are looked for in which the robot may be otherwise than the problem says,
            the most probable first; statements on attachments and lengths are over all of them.
        as_stated_m: Length of each leg, m, in motor order, if the robot is just as stated; empty
            where that is not known, or where nothing else is allowed.
        overturned: Index of the interaction after which other attachments were sure, which the
            readings since rule out; ``None``: there is none.
        information_gain_bits: Information that the last interaction gave, bits; ``None`` where it
            is unknown.
        predicted: Each interaction so far, as the best body predicts it.
        next_movement: At the end of a run, where rivals are left or causes compete, the movement
            that would discriminate best between them.
        simulated: Number of samples that the reference back-end simulated; 0: it was not asked.
        ess: Effective sample size of the simulated samples.
    """

    probability_within_problem: Share | None
    coverage: Share = 1.0
    low_ess: bool = False
    too_early: bool = False
    misspecification_probability: Probability = 0.0
    causes: tuple[Cause, ...] = ()
    as_stated_m: tuple[Interval, ...] = ()
    overturned: Count | None = None
    information_gain_bits: Reading | None = None
    predicted: tuple[PredictedInteraction, ...]
    next_movement: NextMovement | None = None
    simulated: Count = 0
    ess: NonNegative | None = None

    @property
    def probability_as_stated(self) -> float:
        """Probability that the robot is as its problem says, but for narrow deviations."""
        return max(0.0, 1 - sum(cause.probability for cause in self.causes))

    def knows_cause(self, wanted: float) -> bool:
        """Whether one cause, or that there is none, is at least so probable; else they compete."""
        shares = [cause.probability for cause in self.causes]
        return max([self.probability_as_stated, *shares]) >= wanted

    # mypy knows no decorators on properties; pydantic's manual says to ignore that.
    @computed_field  # type: ignore[prop-decorator]
    @property
    def probability(self) -> float | None:
        """Stated probability of the best body's attachments; ``None``: it is not known."""
        if self.probability_within_problem is None or self.not_known is not None:
            return None
        return self.stated(self.probability_within_problem)

    def stated(self, share: float) -> float:
        """A share of the posterior times the probability that the model is not misspecified."""
        return share * (1 - self.misspecification_probability)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def not_known(self) -> NotKnown | None:
        """Why the probability is not known; ``None``: it is known.

        Where the searches have found different bodies, their coverage says nothing of those that
        only one found. Where few samples stand for the best body, or movements are so few that
        searches rarely find all bodies that explain them, the best body can only be known to be
        improbable.
        """
        within = self.probability_within_problem
        if within is None:
            return NotKnown.POOR_FIT
        if self.coverage < SUFFICIENT_COVERAGE and within >= self.coverage:
            return NotKnown.DIFFERENT_BODIES
        if self.low_ess and within >= _PROBABLE:
            return NotKnown.FEW_SAMPLES
        if self.too_early and within >= _PROBABLE:
            return NotKnown.FEW_MOVEMENTS
        return None

    @computed_field  # type: ignore[prop-decorator]
    @property
    def explained(self) -> bool:
        """Whether some body of the problem explains the readings, but for outliers."""
        return (
            self.is_adequate(len(self.predicted))
            and self.misspecification_probability < MISSPECIFIED
            and self.overturned is None
        )


class StoredMode(Record):
    """One set of attachments.

    Attributes:
        probability: Share of the posterior that has these attachments.
        ess: Effective sample size behind the share.
        genes: Genes of a body with these attachments that fits well.
        amounts: What the robot with that body has otherwise than stated, by name in the table of
            parameters.
        indistinguishable: Whether no sensor can tell most of the mode's samples from bodies of the
            same lengths that have the first mode's attachments.
        found: Whether each population has found the mode.
    """

    probability: Share
    ess: NonNegative
    genes: tuple[Gene, ...]
    amounts: dict[str, Reading] = {}
    indistinguishable: bool
    found: tuple[bool, ...]


class StoredChange(Record):
    """What has changed on the robot since it was identified.

    Attributes:
        name: Name of its row in the table of changes.
        sentence: The change with its amount, in words.
        probability: Probability of this change.
        amounts: Amount of the change in each sample, standard normal before any reading.
    """

    name: str
    sentence: str
    probability: Share
    amounts: tuple[Reading, ...]


class AttachmentsStated(NamedTuple):
    """What a ``StoredPosterior`` states of attachments."""

    best: tuple[float, ...]
    modes: tuple[StoredMode, ...]
    probability_within_problem: float | None
    coverage: float
    low_ess: bool


class StoredPosterior(PosteriorSummary):
    """The posterior after some interactions, with its samples.

    Attributes:
        genes: Genes of the samples, shape (n, genes).
        amounts: What each sample's robot has otherwise than stated, by name in the table of
            parameters: SI; logarithms of factors; 1 for what is so or not; what is not named is as
            stated.
        scales: Logarithms of the samples' factors on tilt's and clearance's noise, shape (n, 2).
        weights: Weights of the samples, adding up to 1.
        best: Genes with the first mode's attachments; the length of each leg is the median of the
            mode's samples.
        modes: Sets of attachments, the most probable first.
        changes: What has changed since the identification, the first change first.
        diagnosed: Whether a diagnosis made it; then it is complete without a reference check.
    """

    genes: tuple[tuple[Gene, ...], ...]
    amounts: dict[str, tuple[Reading, ...]] = {}
    scales: tuple[tuple[Reading, Reading], ...]
    weights: tuple[Share, ...]
    best: tuple[Gene, ...]
    modes: tuple[StoredMode, ...]
    changes: tuple[StoredChange, ...] = ()
    diagnosed: bool = False

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not len(self.genes) == len(self.scales) == len(self.weights):
            raise ValueError("samples, their noise and their weights are not equally many")
        if any(len(change.amounts) != len(self.genes) for change in self.changes):
            raise ValueError("samples and the amounts of a change are not equally many")
        if {len(column) for column in self.amounts.values()} - {len(self.genes)}:
            raise ValueError("samples and their amounts are not equally many")
        if abs(sum(self.weights) - 1) > ROUNDING * len(self.weights):
            raise ValueError(f"weights add up to {sum(self.weights):g}, not to 1")
        bodies = (*self.genes, self.best, *(mode.genes for mode in self.modes))
        if len(set(map(len, bodies))) > 1:
            raise ValueError("not all genomes are equally long")
        if any(item.interaction >= len(self.predicted) for item in self.unexplained):
            raise ValueError("an interaction is unexplained that was never predicted")
        return self
