"""What has changed on a robot since it was identified, found out by a few movements.

Movements are chosen to tell changes apart. Once one is probable, others put it to the test: they
tell it from a *competitor* to which all changes at once are open, and what they read is held
against what the change's own bodies predict. A change that fails is not named: then it is none of
these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies
from estimator.body.limbs import driven_limbs
from estimator.identification.method import information_in_words
from estimator.parameters.changeable_rows import LegLength
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.special import logsumexp
from estimator.readings.observation import Observation, Program
from estimator.use.competitor import Competitor, log_alone
from estimator.use.movements import Hypotheses, best_of
from estimator.use.surprise import surprise
from estimator.use.weighing_changes import ChangeParticles, ChangeWeigher, WeighedChanges

SURE: Final = 0.95
"""Probability from which on a change is put to the test."""

MOVEMENTS: Final = 12
"""Largest number of movements, those of the test included."""

CONFIRMING: Final = 3
"""Number of movements that put a change to the test."""

_INDISTINGUISHABLE: Final = 0.15  # bits: a movement that tells no more tells nothing
_RIVAL: Final = 0.05  # what is less probable is not named beside others
_BETTER_NATS: Final = 3.0  # nats by which the competitor must explain the readings better
_SURPRISE: Final = 0.02  # probability of readings as odd as those of the test
_BODIES: Final = 64  # bodies of what is named, which predict readings
_FEWEST_MOVEMENTS: Final = 3  # movements before "nothing has changed" may be the answer

# Probability, before any reading, that one change more has happened than those that are named:
# chosen, not tuned. The number of changes that the competitor expects is another (``competitor``).
_ONE_MORE_PRIOR: Final = 0.1

Act = Callable[[Program, str], Observation]
"""Has the robot perform a motor program, for a reason that is told to people."""


class Verdict(Enum):
    """What a diagnosis ends with."""

    UNCHANGED = "unchanged"
    CHANGED = "changed"
    NONE_OF_THESE = "none of these"
    UNDECIDED = "undecided"


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """What has changed.

    Attributes:
        verdict: Whether a change is named.
        changes: Changes that are named, the most probable first; several where no movement could
            tell them apart. If none is named, the most probable changes.
        probability: Probability of these changes together.
        weighed: All changes after the last movement.
        observations: Observations of the movements.
        reasons: Why each movement was made.
        better: By how many nats the competitor explains all readings better than the named changes;
            ``None``: they were not put to the test.
        suspects: Changes that the competitor has on, with their shares: where it explains the
            readings better, two things may have failed at once.
    """

    verdict: Verdict
    changes: tuple[ChangeParticles, ...]
    probability: float
    weighed: WeighedChanges
    observations: tuple[Observation, ...]
    reasons: tuple[str, ...]
    better: float | None = None
    suspects: tuple[tuple[str, float], ...] = ()

    def in_words(self, known: FittedPosterior) -> str:
        """What was found, in a sentence or two.

        Args:
            known: The body as it was identified.
        """
        named = [said(particles, known) for particles in self.changes]
        match self.verdict:
            case Verdict.UNCHANGED:
                return f"Nothing has changed that could be felt ({self.probability:.2f})."
            case Verdict.CHANGED if len(named) == 1:
                return f"{_capital(named[0])} ({self.probability:.2f}); nothing else has changed."
            case Verdict.CHANGED:
                return (
                    f"{_capital('; or '.join(named))} ({self.probability:.2f} together): static "
                    "readings cannot tell which."
                )
            case Verdict.NONE_OF_THESE:
                text = "None of the changes that are known explains the readings."
                if not self.suspects:
                    return text
                listed = "; ".join(f"{name} ({share:.2f})" for name, share in self.suspects)
                return (
                    f"{text} If several things failed at once, these may be among them: {listed}."
                )
        return f"Not decided: {'; '.join(named)} ({self.probability:.2f} together)."


def said(particles: ChangeParticles, known: FittedPosterior) -> str:
    """A change with its amount, in words."""
    if particles.change is None:
        return "nothing has changed"
    row = particles.change.row
    if not isinstance(row, LegLength):
        middle, low, high = particles.amount()
        return row.said(middle, (low, high))
    assert known.best_body is not None
    legs = [limb.motor for limb in driven_limbs(known.best_body)]
    lengths = 1000 * known.leg_lengths[:, legs.index(row.motor)]
    middle, low, high = particles.amount(lengths[particles.rows])
    old_length = float(known.weights @ lengths)
    return f"{row.name} from {old_length:.0f} to {middle:.0f} mm [{low:.0f}–{high:.0f}]"


def diagnose(weigher: ChangeWeigher, act: Act, *, movements: int = MOVEMENTS) -> Diagnosis:
    """Finds out what has changed.

    Args:
        weigher: Weighs changes.
        act: Moves the robot.
        movements: Largest number of movements.
    """
    observations, reasons = list[Observation](), list[str]()
    tested: Diagnosis | None = None
    while True:
        weighed = weigher.weigh(observations)
        named, probability = _named(weighed)
        if tested is not None and _names(tested.changes) == _names(named):
            return replace(tested, changes=named, probability=probability, weighed=weighed)
        movements_left = movements - len(observations)
        program, bits = best_of(weigher, Hypotheses.of(weigher, weighed.shares))
        is_settled = len(named) == 1 or bits < _INDISTINGUISHABLE or weighed.none_of_these > SURE
        felt_enough = named[0].change is not None or len(observations) >= _FEWEST_MOVEMENTS
        if is_settled and felt_enough and movements_left >= CONFIRMING:
            tested = _tested(
                weigher, weighed, named, act, observations=observations, reasons=reasons
            )
            observations, reasons = list(tested.observations), list(tested.reasons)
            if tested.verdict is Verdict.NONE_OF_THESE:
                return tested
            continue
        if movements_left <= 0:
            is_listed = weighed.none_of_these < 0.5
            return Diagnosis(
                verdict=Verdict.UNDECIDED if is_listed else Verdict.NONE_OF_THESE,
                changes=named,
                probability=probability,
                weighed=weighed,
                observations=tuple(observations),
                reasons=tuple(reasons),
            )
        reason = _reason(weighed, bits)
        observations.append(act(tuple(program.tolist()), reason))
        reasons.append(reason)


def _named(weighed: WeighedChanges) -> tuple[tuple[ChangeParticles, ...], float]:
    """The fewest changes that are sure together, but for improbable ones; and their probability."""
    count = int(np.searchsorted(np.cumsum(weighed.probabilities), SURE)) + 1
    probable = max(1, int(np.sum(weighed.probabilities[:count] >= _RIVAL)))
    return weighed.particles[:probable], float(weighed.probabilities[:probable].sum())


def _names(changes: Sequence[ChangeParticles]) -> set[str | None]:
    return {one.name for one in changes}


def _reason(weighed: WeighedChanges, bits: float) -> str:
    if weighed.probabilities[0] < 0.02 or len(weighed.particles) < 2:
        return "tells most of all changes apart"
    first, second = (one.name or "no change" for one in weighed.particles[:2])
    return f"tells apart: {first} or {second}; {information_in_words(bits)}"


# --- the test -------------------------------------------------------------------------------------


def _tested(
    weigher: ChangeWeigher,
    weighed: WeighedChanges,
    named: tuple[ChangeParticles, ...],
    act: Act,
    *,
    observations: Sequence[Observation],
    reasons: Sequence[str],
) -> Diagnosis:
    """Puts what is named to the test, by movements that tell it from the competitor."""
    names = _names(named)
    groups = weighed.shares_of(names)
    claim = Hypotheses.of(weigher, groups, _BODIES)
    on_top = weigher.on_top_of(groups)
    rival = Competitor.fitted(weigher, observations).drawn(_BODIES // 2)
    all_observations, all_reasons = list(observations), list(reasons)
    for number in range(CONFIRMING):
        second = _second(on_top, on_top.weigh(all_observations))
        hypotheses = Hypotheses(
            bodies=Bodies.joined([claim.bodies, second.bodies, rival.bodies(weigher)]),
            scales=np.concatenate([claim.scales, second.scales, rival.scales(weigher)]),
            groups=np.repeat([0, 1], [_BODIES, _BODIES // 2 + len(second)]),
        )
        program, _ = best_of(weigher, hypotheses, safe_for=claim.bodies)
        reason = f"puts to the test: {said(named[0], weigher.known)} ({number + 1} of {CONFIRMING})"
        all_observations.append(act(tuple(program.tolist()), reason))
        all_reasons.append(reason)
    reweighed = weigher.weigh(all_observations)
    groups = reweighed.shares_of(names)
    claim = Hypotheses.of(weigher, groups, _BODIES)
    surprises = [surprise(weigher, claim, one) for one in all_observations[-CONFIRMING:]]
    odd = sum(float(np.mean(drawn >= observed)) <= _SURPRISE for drawn, observed in surprises)
    replicates, odds = (sum(column) for column in zip(*surprises, strict=True))
    overall = float(np.mean(replicates >= odds))
    with_second = weigher.on_top_of(groups).weigh(all_observations)
    rival = Competitor.fitted(weigher, all_observations)
    better = max(rival.log_evidence - _evidence(weigher, named, reweighed), _log_odds(with_second))
    is_odd = overall <= _SURPRISE or odd >= 2 or reweighed.none_of_these > 0.5
    is_refuted = better > _BETTER_NATS or is_odd
    verdict = Verdict.CHANGED if named[0].change is not None else Verdict.UNCHANGED
    return Diagnosis(
        verdict=Verdict.NONE_OF_THESE if is_refuted else verdict,
        changes=named,
        probability=float(weighed.probabilities[: len(named)].sum()),
        weighed=reweighed,
        observations=tuple(all_observations),
        reasons=tuple(all_reasons),
        better=better,
        suspects=_suspects(weigher, named, with_second, rival, all_observations)
        if is_refuted
        else (),
    )


def _suspects(
    weigher: ChangeWeigher,
    named: Sequence[ChangeParticles],
    last: WeighedChanges,
    rival: Competitor,
    observations: Sequence[Observation],
) -> tuple[tuple[str, float], ...]:
    """Names of changes that may have happened at once, with their shares.

    There are none where readings would be more probable if anything could be read.
    """
    if _log_odds(last) <= _BETTER_NATS:
        anywhere = weigher.known.likelihood_of(observations).log_anywhere.sum()
        return rival.suspects(weigher) if rival.log_evidence > anywhere else ()
    if last.none_of_these > 0.5:
        return ()
    second = next((one.change.name, share) for one, share in last.shares if one.change is not None)
    return (*((one.change.name, 1.0) for one in named if one.change is not None), second)


def _second(further: ChangeWeigher, weighed: WeighedChanges) -> Hypotheses:
    """Bodies with one change more than those that are named."""
    groups = weighed.shares_of(_names(weighed.particles) - {None})
    return Hypotheses.of(further, groups, _BODIES // 2)


def _log_odds(further: WeighedChanges) -> float:
    """Log-odds of one change more, nats, its improbability before any reading included."""
    unchanged = max(further.unchanged, 1e-300)
    return math.log(max(1 - unchanged, 1e-300)) - math.log(unchanged) + math.log(_ONE_MORE_PRIOR)


def _evidence(
    weigher: ChangeWeigher, named: Sequence[ChangeParticles], weighed: WeighedChanges
) -> float:
    """Logarithm of the density of all observations under the named changes, as if no other existed.

    Each has the prior that the competitor gives to its being on alone.
    """
    names = _names(named)
    logs = [
        particles.log_evidence + log_alone(weigher, particles)
        for particles in weighed.particles
        if particles.name in names
    ]
    return float(logsumexp(np.array(logs)))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
