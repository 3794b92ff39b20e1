"""What has changed on a robot since it was identified, found out by a few movements.

Movements are chosen to tell causes apart. Once one is probable, others put it to the test: they
tell it from a *competitor* to which all changes at once are open, and what they read is held
against what the cause's own bodies predict. A cause that fails is not named: then it is none of
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
from estimator.parameters.changes import Within
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.special import logsumexp
from estimator.readings.observation import Observation, Program
from estimator.use.causes import Particles, Weighed, Weigher
from estimator.use.competitor import Competitor, log_alone
from estimator.use.movements import Hypotheses, best_of, telling
from estimator.use.surprise import surprise

SURE: Final = 0.95
"""Probability from which on a cause is put to the test."""

MOVEMENTS: Final = 12
"""Largest number of movements, those of the test included."""

CONFIRMING: Final = 3
"""Number of movements that put a cause to the test."""

_INDISTINGUISHABLE: Final = 0.15  # bits: a movement that tells no more tells nothing
_RIVAL: Final = 0.05  # what is less probable is not named beside others
_BETTER: Final = 3.0  # nats by which the competitor must explain the readings better
_SURPRISE: Final = 0.02  # probability of readings as odd as those of the test
_BODIES: Final = 64  # bodies of what is named, which predict readings
_SECOND: Final = 0.1  # probability of a second change, before any reading
_FEWEST: Final = 3  # movements before "nothing has changed" may be the answer

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
        verdict: Whether a cause is named.
        causes: Causes that are named, the most probable first; several where no movement could tell
            them apart. If none is named, the most probable causes.
        probability: Probability of these causes together.
        weighed: All causes after the last movement.
        observations: Observations of the movements.
        reasons: Why each movement was made.
        surprise: Probability of readings as odd as those of the test, under the named cause;
            ``None``: it was not put to the test.
        better: By how many nats the competitor explains all readings better than the named causes.
        suspects: Causes that the competitor has on, with their shares: where it explains the
            readings better, two things may have failed at once.
    """

    verdict: Verdict
    causes: tuple[Particles, ...]
    probability: float
    weighed: Weighed
    observations: tuple[Observation, ...]
    reasons: tuple[str, ...]
    surprise: float | None = None
    better: float | None = None
    suspects: tuple[tuple[str, float], ...] = ()

    def in_words(self, known: FittedPosterior) -> str:
        """What was found, in a sentence or two.

        Args:
            known: The body as it was identified.
        """
        named = [said(one, known) for one in self.causes]
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
                what = "None of the changes that are known explains the readings."
                if not self.suspects:
                    return what
                several = "; ".join(f"{name} ({share:.2f})" for name, share in self.suspects)
                return (
                    f"{what} If several things failed at once, these may be among them: {several}."
                )
        return f"Not decided: {'; '.join(named)} ({self.probability:.2f} together)."


def said(particles: Particles, known: FittedPosterior) -> str:
    """A cause with its amount, in words."""
    if particles.cause is None:
        return "nothing has changed"
    row = particles.cause.row
    if not isinstance(row, Within):
        middle, low, high = particles.amount()
        return row.said(middle, (low, high))
    assert known.best_body is not None
    legs = [limb.motor for limb in driven_limbs(known.best_body)]
    lengths = 1000 * known.leg_lengths[:, legs.index(row.motor)]
    middle, low, high = particles.amount(lengths[particles.rows])
    before = float(known.weights @ lengths)
    return f"{row.name} from {before:.0f} to {middle:.0f} mm [{low:.0f}–{high:.0f}]"


def diagnose(
    weigher: Weigher, act: Act, *, before: Sequence[Observation] = (), movements: int = MOVEMENTS
) -> Diagnosis:
    """Finds out what has changed.

    Args:
        weigher: Weighs causes.
        act: Moves the robot.
        before: Observations since the change, as of a monitor that has raised the alarm.
        movements: Largest number of movements.
    """
    observations, reasons = list(before), ["made by the monitor"] * len(before)
    tested: Diagnosis | None = None
    while True:
        weighed = weigher.weigh(observations)
        named, probability = _named(weighed)
        if tested is not None and _names(tested.causes) == _names(named):
            return replace(tested, causes=named, probability=probability, weighed=weighed)
        left = movements - (len(observations) - len(before))
        program, bits = telling(weigher, weighed)
        known = len(named) == 1 or bits < _INDISTINGUISHABLE
        enough = named[0].cause is not None or len(observations) >= _FEWEST
        if known and enough and left >= CONFIRMING:
            tested = _tested(
                weigher, weighed, named, act, observations=observations, reasons=reasons
            )
            observations, reasons = list(tested.observations), list(tested.reasons)
            if tested.verdict is Verdict.NONE_OF_THESE:
                return tested
            continue
        if left <= 0:
            return Diagnosis(
                verdict=Verdict.UNDECIDED,
                causes=named,
                probability=probability,
                weighed=weighed,
                observations=tuple(observations),
                reasons=tuple(reasons),
            )
        reason = _reason(weighed, bits)
        observations.append(act(tuple(program.tolist()), reason))
        reasons.append(reason)


def _named(weighed: Weighed) -> tuple[tuple[Particles, ...], float]:
    """The fewest causes that are sure together, but for improbable ones; and their probability."""
    count = int(np.searchsorted(np.cumsum(weighed.probabilities), SURE)) + 1
    probable = max(1, int(np.sum(weighed.probabilities[:count] >= _RIVAL)))
    return weighed.particles[:probable], float(weighed.probabilities[:probable].sum())


def _name(one: Particles) -> str | None:
    return None if one.cause is None else one.cause.name


def _names(causes: Sequence[Particles]) -> set[str | None]:
    return set(map(_name, causes))


def _reason(weighed: Weighed, bits: float) -> str:
    if weighed.probabilities[0] < 0.02 or len(weighed.particles) < 2:
        return "tells most of all changes apart"
    first, second = (
        "no change" if one.cause is None else one.cause.name for one in weighed.particles[:2]
    )
    return f"tells apart: {first} or {second}; {information_in_words(bits)}"


# --- the test -------------------------------------------------------------------------------------


def _tested(
    weigher: Weigher,
    weighed: Weighed,
    named: tuple[Particles, ...],
    act: Act,
    *,
    observations: Sequence[Observation],
    reasons: Sequence[str],
) -> Diagnosis:
    """Puts what is named to the test, by movements that tell it from the competitor."""
    groups = _shares_of(named, weighed)
    own = Hypotheses.of(weigher, groups, _BODIES)
    further = weigher.on_top_of(groups)
    rival = Competitor.fitted(weigher, observations).drawn(_BODIES // 2)
    seen, why = list(observations), list(reasons)
    for number in range(CONFIRMING):
        second = _second(further, further.weigh(seen))
        together = Hypotheses(
            bodies=Bodies.joined([own.bodies, second.bodies, rival.bodies(weigher)]),
            scales=np.concatenate([own.scales, second.scales, rival.scales(weigher)]),
            groups=np.repeat([0, 1], [_BODIES, _BODIES // 2 + len(second)]),
        )
        program, _ = best_of(weigher, together, safe_for=own.bodies)
        reason = f"puts to the test: {said(named[0], weigher.known)} ({number + 1} of {CONFIRMING})"
        seen.append(act(tuple(program.tolist()), reason))
        why.append(reason)
    after = weigher.weigh(seen)
    groups = _shares_of(named, after)
    own = Hypotheses.of(weigher, groups, _BODIES)
    surprises = [surprise(weigher, own, one) for one in seen[-CONFIRMING:]]
    odd = sum(float(np.mean(drawn >= observed)) <= _SURPRISE for drawn, observed in surprises)
    replicates, odds = (sum(each) for each in zip(*surprises, strict=True))
    overall = float(np.mean(replicates >= odds))
    last = weigher.on_top_of(groups).weigh(seen)
    rival = Competitor.fitted(weigher, seen)
    better = max(rival.log_evidence - _evidence(weigher, named, after), _log_odds(last))
    none = better > _BETTER or overall <= _SURPRISE or odd >= 2
    verdict = Verdict.CHANGED if named[0].cause is not None else Verdict.UNCHANGED
    return Diagnosis(
        verdict=Verdict.NONE_OF_THESE if none else verdict,
        causes=named,
        probability=float(weighed.probabilities[: len(named)].sum()),
        weighed=after,
        observations=tuple(seen),
        reasons=tuple(why),
        surprise=overall,
        better=better,
        suspects=_suspects(weigher, named, last, rival) if none else (),
    )


def _shares_of(named: Sequence[Particles], weighed: Weighed) -> list[tuple[Particles, float]]:
    """The named causes as they are weighed by now, with shares that add up to 1."""
    names = _names(named)
    groups = [
        (one, share)
        for one, share in zip(weighed.particles, weighed.probabilities.tolist(), strict=True)
        if _name(one) in names
    ]
    total = max(sum(share for _, share in groups), 1e-300)
    return [(one, share / total) for one, share in groups]


def _suspects(
    weigher: Weigher, named: Sequence[Particles], last: Weighed, rival: Competitor
) -> tuple[tuple[str, float], ...]:
    """Names of changes that may have happened at once, with their shares."""
    if _log_odds(last) <= _BETTER:
        return rival.suspects(weigher)
    second = next(
        (one.cause.name, float(share))
        for one, share in zip(last.particles, last.probabilities, strict=True)
        if one.cause is not None
    )
    return (*((one.cause.name, 1.0) for one in named if one.cause is not None), second)


def _second(further: Weigher, weighed: Weighed) -> Hypotheses:
    """Bodies with one change more than those that are named."""
    groups = [
        (one, share)
        for one, share in zip(weighed.particles, weighed.probabilities.tolist(), strict=True)
        if one.cause is not None
    ]
    total = sum(share for _, share in groups)
    return Hypotheses.of(further, [(one, share / total) for one, share in groups], _BODIES // 2)


def _log_odds(further: Weighed) -> float:
    """Log-odds of one change more, nats, its improbability before any reading included."""
    same = max(further.unchanged, 1e-300)
    return math.log(max(1 - same, 1e-300)) - math.log(same) + math.log(_SECOND)


def _evidence(weigher: Weigher, named: Sequence[Particles], weighed: Weighed) -> float:
    """Logarithm of the density of all observations under the named causes, as if no other existed.

    Each has the prior that the competitor gives to its being on alone.
    """
    names = _names(named)
    logs = [
        one.log_evidence + log_alone(weigher, one)
        for one in weighed.particles
        if _name(one) in names
    ]
    return float(logsumexp(np.array(logs)))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
