"""What a run believes of the body after an interaction, as it is kept."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, Final, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from estimator.readings.observation import Program, Reading

OUTLIERS: Final = 1
"""Unexplained interactions that happen to a body that the problem describes."""

FARTHEST: Final = 6.0
"""Standard deviations by which such an interaction strays at most: farther off, something happened
that the model does not contain, however probable it makes outliers."""

AGREED: Final = 0.5
"""Share of the posterior: searches that have met less in common have met different bodies."""

OTHERWISE: Final = 0.9
"""Where it is so probable that the robot is built otherwise, no body of the problem explains it."""

RIVAL: Final = 0.01
"""Probability of other attachments that are worth telling."""

_PROBABLE: Final = 0.5  # what few draws give less to is improbable, whatever it is exactly


def are_outliers(unexplained: Sequence[UnexplainedInteraction], interactions: int) -> bool:
    """Whether a body stands that leaves these of all interactions unexplained."""
    near = all(one.deviation <= FARTHEST for one in unexplained)
    return not unexplained or (len(unexplained) <= OUTLIERS < interactions and near)


ROUNDING: Final = 1e-6
"""By how much a share or a gene may lie outside 0 to 1."""

Probability = Annotated[float, Field(ge=0, le=1)]
Share = Annotated[float, Field(ge=0, le=1 + ROUNDING)]
Gene = Annotated[float, Field(ge=-ROUNDING, le=1 + ROUNDING)]
Count = Annotated[int, Field(ge=0)]
Effective = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class NotKnown(StrEnum):
    """Why it is not known how probable attachments are."""

    POOR_FIT = "the best body explains the readings poorly"
    DIFFERENT_BODIES = "the searches have met different bodies"
    FEW_DRAWS = "few samples stand for the best body"


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class BelievedMode(_Record):
    """One set of attachments.

    Attributes:
        probability: Share of the posterior.
        effective: Effective number of draws behind it.
        genes: The genome that fits best among those with these attachments.
        like_the_first: Whether no sensor can tell most of its samples from bodies of the same
            lengths that have the first mode's attachments.
        met: Which populations have met it.
    """

    probability: Share
    effective: Effective
    genes: tuple[Gene, ...]
    like_the_first: bool
    met: tuple[bool, ...]


class Foretold(_Record):
    """One interaction as the best body foretells it.

    Attributes:
        touch: One value per touch sensor.
        tilt: Left/right and forward/back, rad.
        clearance: m.
        deviations: Felt minus foretold in units of the noise, by modality; of touch the number of
            bits that differ, each as many standard deviations as it is unlikely.
        outlier: Probability that the readings say nothing about the body.
    """

    touch: tuple[bool, ...]
    tilt: tuple[Reading, Reading]
    clearance: Reading
    deviations: dict[str, Reading]
    outlier: Probability


class UnexplainedInteraction(_Record):
    """An interaction that no body of the problem explains.

    Attributes:
        interaction: Its index.
        sensors: Modalities whose readings lie far from what the best body foretells.
        deviation: How far the farthest of them lies off, in standard deviations of the noise as
            it was found; 0 in runs that were made before it was kept.
    """

    interaction: Count
    sensors: tuple[str, ...]
    deviation: Effective = 0.0


class NextMovement(_Record):
    """The movement that would tell most, had there been another.

    Attributes:
        program: rad, in motor order.
        reason: What it would tell apart, in words.
        bits: Information that it is expected to give.
    """

    program: Program
    reason: str
    bits: Reading


class Belief(_Record):
    """The posterior after some interactions.

    Attributes:
        genes: Samples, shape (n, genes).
        scales: Logarithms of their factors on tilt's and clearance's noise, shape (n, 2).
        weights: Of the samples, adding up to 1.
        best: Genome of the first mode's attachments with its samples' lengths: each leg's is their
            median.
        modes: Sets of attachments, the most probable first.
        within_problem: Probability, if the robot is built as the problem says, that the attachments
            are those of the first mode or, at the robot's lengths, such as no sensor can tell from
            them; never more than ``met_in_common``. ``None``: the best body explains the readings
            poorly.
        met_in_common: How much of the posterior the searches have met, by what they met in common;
            1 in runs that were made before it was kept, so that what they stated stands.
        few_draws: Whether the share of those that feel like the first mode, among several, rests
            on few effective draws.
        departed: Probability that the robot is built otherwise; 0 until attachments are sure.
        gained: Information that the last interaction gave, bits; ``None`` where it is unknown.
        foretold: Each interaction so far, as the best body foretells it.
        unexplained: Interactions that the best body leaves unexplained.
        noisy: Modalities whose noise is surely more than twice what is expected: what the robot
            announces, together with what models leave.
        contradicting: Touch sensors that feel otherwise than the best body foretells too often.
        overturned: The interaction, by its index, after which other attachments were sure, which
            the readings since rule out; ``None``: nothing was.
        departure: Once attachments are sure, how a body departs from the problem that explains the
            readings clearly better; ``None``: none does.
        untested: At the end of a run, how else the robot may depart from the problem: such bodies
            explain the readings as well, and other movements would tell.
        simulated: How many samples the reference back-end simulated; 0: it was not asked.
        effective: Effective sample size of those.
        decides: At the end of a run, where rivals are left that a movement might tell apart.
    """

    genes: tuple[tuple[Gene, ...], ...]
    scales: tuple[tuple[Reading, Reading], ...]
    weights: tuple[Share, ...]
    best: tuple[Gene, ...]
    modes: tuple[BelievedMode, ...]
    within_problem: Share | None
    met_in_common: Share = 1.0
    few_draws: bool = False
    departed: Probability = 0.0
    gained: Reading | None = None
    foretold: tuple[Foretold, ...]
    unexplained: tuple[UnexplainedInteraction, ...]
    noisy: tuple[str, ...]
    contradicting: tuple[Count, ...] = ()
    overturned: Count | None = None
    departure: str | None = None
    untested: tuple[str, ...] = ()
    simulated: Count = 0
    effective: Effective | None = None
    decides: NextMovement | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not len(self.genes) == len(self.scales) == len(self.weights):
            raise ValueError("samples, their noise and their weights are not equally many")
        if abs(sum(self.weights) - 1) > ROUNDING * len(self.weights):
            raise ValueError(f"weights add up to {sum(self.weights):g}, not to 1")
        bodies = (*self.genes, self.best, *(mode.genes for mode in self.modes))
        if len(set(map(len, bodies))) > 1:
            raise ValueError("not all genomes are equally long")
        if any(item.interaction >= len(self.foretold) for item in self.unexplained):
            raise ValueError("an interaction is unexplained that was never foretold")
        return self

    @property
    def probability(self) -> float | None:
        """The probability that is stated of the attachments; ``None``: it is not known."""
        if self.within_problem is None or self.not_known is not None:
            return None
        return self.within_problem * (1 - self.departed)

    @property
    def not_known(self) -> NotKnown | None:
        """Why nothing is stated of the attachments; ``None``: something is.

        Where the searches have met different bodies, what they met in common says nothing of those
        of one. Where few draws stand for the best body, only that it is improbable can be known.
        """
        within = self.within_problem
        if within is None:
            return NotKnown.POOR_FIT
        if self.met_in_common < AGREED and within >= self.met_in_common:
            return NotKnown.DIFFERENT_BODIES
        if self.few_draws and within >= _PROBABLE:
            return NotKnown.FEW_DRAWS
        return None

    @property
    def explained(self) -> bool:
        """Whether some body of the problem explains the readings, as far as can be told.

        An outlier leaves others explained.
        """
        return (
            are_outliers(self.unexplained, len(self.foretold))
            and self.departed < OTHERWISE
            and not (self.noisy or self.contradicting or self.departure)
            and self.overturned is None
        )
