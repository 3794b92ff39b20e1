"""What has changed on a robot since it was identified, found out by a few movements.

Movements are chosen to tell causes apart. Once one is probable, others put it to the test: they
tell it from a *competitor* to which all changes at once are open, and what they read is held
against what the cause's own bodies predict. A cause that fails is not named: then it is none of
these.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies, Flags
from estimator.body.limbs import driven_limbs
from estimator.body.morphology import Array
from estimator.identification.method import information_in_words
from estimator.parameters.changes import Within
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.likelihood import GRAVITY_TILTS, LIKELY, Likelihood, Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.special import logsumexp, softmax
from estimator.posterior.posterior import systematic
from estimator.readings.observation import Observation, PredictedReadings, Program
from estimator.use.causes import Particles, Rows, Weighed, Weigher
from estimator.use.movements import Hypotheses, best_of, telling

SURE: Final = 0.95
"""Probability from which on a cause is put to the test."""

MOVEMENTS: Final = 12
"""At most, those of the test included."""

CONFIRMING: Final = 3
"""Movements that put a cause to the test."""

_INDISTINGUISHABLE: Final = 0.15  # bits: a movement that tells no more tells nothing
_RIVAL: Final = 0.05  # what is less probable is not named beside others
_BETTER: Final = 3.0  # nats by which the competitor must explain the readings better
_SURPRISE: Final = 0.02  # probability of readings as odd as those of the test
_REPLICATES: Final = 600
_OUTLIERS: Final = 0.005  # of replicates; in recorded runs 2 of 615 were
_BODIES: Final = 64  # of a cause, that predict
_SECOND: Final = 0.1  # probability of a second change
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
        causes: Those that are named, the most probable first; several where no movement could tell
            them apart. Otherwise the most probable.
        probability: Of these together.
        weighed: All causes after the last movement.
        observations: Of the movements.
        reasons: Why each movement was made.
        surprise: Probability of readings as odd as those of the test, under the named cause;
            ``None``: it was not put to the test.
        better: By how many nats the competitor explains all readings better.
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
        """What is the matter, as a sentence or two.

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
        movements: How many there may be at most.
    """
    observations, reasons = list(before), ["made by the monitor"] * len(before)
    tested: Diagnosis | None = None
    while True:
        weighed = weigher.weigh(observations)
        named, probability = _named(weighed)
        left = movements - (len(observations) - len(before))
        program, bits = telling(weigher, weighed)
        known = len(named) == 1 or bits < _INDISTINGUISHABLE
        if known and (named[0].cause is not None or len(observations) >= _FEWEST):
            if tested is not None and _names(tested.causes) == _names(named):
                return replace(
                    tested,
                    causes=named,
                    probability=probability,
                    weighed=weighed,
                )
            if left >= CONFIRMING:
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
    """The fewest causes that are sure together, without what is improbable; and how sure."""
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
    """The causes of these names as they are weighed by now, with their shares of all of them."""
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
    """What may have failed at once, with shares."""
    if _log_odds(last) <= _BETTER:
        return rival.suspects(weigher)
    second = next(
        (one.cause.name, float(share))
        for one, share in zip(last.particles, last.probabilities, strict=True)
        if one.cause is not None
    )
    return (*((one.cause.name, 1.0) for one in named if one.cause is not None), second)


def _second(further: Weigher, weighed: Weighed) -> Hypotheses:
    """Bodies with one change more than is named."""
    groups = [
        (one, share)
        for one, share in zip(weighed.particles, weighed.probabilities.tolist(), strict=True)
        if one.cause is not None
    ]
    total = sum(share for _, share in groups)
    return Hypotheses.of(further, [(one, share / total) for one, share in groups], _BODIES // 2)


def _log_odds(further: Weighed) -> float:
    """By how many nats one change more explains the readings better, as improbable as it is."""
    same = max(further.unchanged, 1e-300)
    return math.log(max(1 - same, 1e-300)) - math.log(same) + math.log(_SECOND)


def _evidence(weigher: Weigher, named: Sequence[Particles], weighed: Weighed) -> float:
    """Logarithm of the density of all observations under the named causes, as if none other were.

    With the prior that the competitor gives to each being on alone.
    """
    names = _names(named)
    logs = [
        one.log_evidence + _log_alone(weigher, one)
        for one in weighed.particles
        if _name(one) in names
    ]
    return float(logsumexp(np.array(logs)))


def _log_alone(weigher: Weigher, one: Particles) -> float:
    chances = _chances(weigher)
    alone = float(np.sum(np.log1p(-chances)))
    if one.cause is None:
        return alone
    chance = chances[weigher.causes.index(one.cause)]
    return alone + math.log(chance) - math.log1p(-chance)


def surprise(weigher: Weigher, own: Hypotheses, observation: Observation) -> tuple[Array, float]:
    """How odd an observation is to some bodies, and how odd what they would have read is.

    Args:
        weigher: Predicts.
        own: The bodies.
        observation: What was observed.

    Returns:
        Minus the logarithm of the density under all bodies together, each of which may fall to any
        of its sides: of replicates that are drawn from these, shape (replicates,), and of the
        observation.
    """
    known, noise = weigher.known, weigher.known.noise
    each = np.repeat(np.arange(len(own)), len(LIKELY))
    shares = np.tile(LIKELY / LIKELY.sum(), len(own)) / len(own)
    predicted = known.predictor.read(
        own.bodies,
        each,
        np.tile(np.array(observation.taken), (len(each), 1)),
        np.tile(GRAVITY_TILTS, (len(own), 1)),
    )
    scales = own.scales[each]
    chosen = weigher.rng.choice(len(each), size=_REPLICATES, p=shares)
    drawn = _replicates(predicted[chosen], scales[chosen], noise, observation, weigher.rng)
    data = SensorData.of([*drawn, observation], known.modalities, known.clearance_cap)
    rows = np.repeat(np.arange(len(each)), len(data))
    misfits = data.misfits(predicted[rows], np.tile(np.arange(len(data)), len(each)))
    logs = Likelihood(data, noise).of(misfits.reshape(len(each), len(data), -1), scales=scales)
    odd: Array = -logsumexp(logs + np.log(shares)[:, None], axis=0)
    return odd[:-1], float(odd[-1])


def _replicates(
    predicted: PredictedReadings,
    scales: Array,
    noise: Noise,
    like: Observation,
    rng: np.random.Generator,
) -> list[Observation]:
    """What bodies would read, with noise and outliers, where something was read."""
    count = len(predicted)
    tilt = predicted.tilt + np.exp(scales[:, :1]) * noise.tilt * rng.normal(size=(count, 2))
    height = predicted.clearance + np.exp(scales[:, 1]) * noise.clearance * rng.normal(size=count)
    wrong = np.where(predicted.touch_doubtful, 0.5, noise.touch)
    touch = predicted.touch != (rng.random(predicted.touch.shape) < wrong)
    outlier = rng.random(count) < _OUTLIERS
    tilt[outlier] = rng.uniform(-0.5, 0.5, (int(outlier.sum()), 2))
    beyond = predicted.saturated
    return [
        like.model_copy(
            update={
                "tilt": tuple(
                    None if was is None else float(value)
                    for was, value in zip(like.tilt, tilt[row], strict=True)
                ),
                "clearance": None if like.clearance is None else float(height[row]),
                "clearance_saturated": bool(beyond[row]),
                "touch": tuple(
                    None if was is None else bool(bit)
                    for was, bit in zip(like.touch, touch[row], strict=True)
                ),
            }
        )
        for row in range(count)
    ]


# --- the competitor -------------------------------------------------------------------------------

_CHAINS: Final = 64
_TEMPERATURES: Final = np.concatenate([[0.0], np.geomspace(2e-3, 1.0, 32)])
_MOVES: Final = 2  # at each
_SEVERAL: Final = 1.5  # changes, expected before any reading


def _chances(weigher: Weigher) -> Array:
    """How probably each change is on, before any reading."""
    return np.minimum(_SEVERAL * np.exp([one.log_prior for one in weigher.causes]), 0.5)


@dataclass(frozen=True, kw_only=True, eq=False)
class Competitor:
    """Bodies with any number of changes at once: spike and slab, annealed.

    Attributes:
        rows: Bodies of the posterior as it was identified, shape (n,).
        on: Which changes each has, shape (n, causes).
        theta: Amounts of all changes, shape (n, causes).
        weights: Adding up to 1, shape (n,).
        log_evidence: Logarithm of the density of all observations.
    """

    rows: Rows
    on: Flags
    theta: Array
    weights: Array
    log_evidence: float = 0.0

    @classmethod
    def fitted(cls, weigher: Weigher, observations: Sequence[Observation]) -> Competitor:
        """By annealed importance sampling from the prior (Neal 2001)."""
        rng, causes = weigher.rng, weigher.causes
        chances, count = _chances(weigher), _CHAINS
        theta = np.column_stack([one.drawn(rng.random(count)) for one in causes])
        now = cls(
            rows=systematic(weigher.known.weights, count, 0.5)[rng.permutation(count)],
            on=rng.random((count, len(causes))) < chances,
            theta=theta,
            weights=np.full(count, 1 / count),
        )
        logs, fits = np.zeros(count), now._fits(weigher, observations)
        for before, after in itertools.pairwise(_TEMPERATURES):
            logs += (after - before) * fits
            for _ in range(_MOVES):
                new, odds = now._moved(weigher, chances)
                new_fits = new._fits(weigher, observations)
                take = np.log(rng.random(count)) < after * (new_fits - fits) + odds
                now = replace(
                    now,
                    rows=np.where(take, new.rows, now.rows),
                    on=np.where(take[:, None], new.on, now.on),
                    theta=np.where(take[:, None], new.theta, now.theta),
                )
                fits = np.where(take, new_fits, fits)
        return replace(
            now,
            weights=softmax(logs),
            log_evidence=float(logsumexp(logs)) - math.log(count),
        )

    def _fits(self, weigher: Weigher, observations: Sequence[Observation]) -> Array:
        if not observations:
            return np.zeros(len(self.rows))
        bodies, scales = self.bodies(weigher), self.scales(weigher)
        fits: Array = weigher.fits_of(bodies, scales, observations, surely=True).sum(axis=1)
        return fits

    def _moved(self, weigher: Weigher, chances: Array) -> tuple[Competitor, Array]:
        """Each chain somewhere else, and the logarithm of how probable that is beside where it was.

        A change is switched, or takes the place of another; an amount or the body is another.
        """
        rng, causes = weigher.rng, weigher.causes
        rows, on, theta = self.rows.copy(), self.on.copy(), self.theta.copy()
        odds = np.zeros(len(rows))
        kinds = rng.integers(4, size=len(rows))
        shares = np.exp([one.log_prior for one in causes])
        chosen = rng.choice(len(causes), size=(len(rows), 2), p=shares / shares.sum())
        for chain in range(len(rows)):
            one, other = chosen[chain].tolist()
            there = np.flatnonzero(on[chain])
            if kinds[chain] == 0:
                on[chain, one] = not on[chain, one]
                sign = 1 if on[chain, one] else -1
                odds[chain] = sign * math.log(chances[one] / (1 - chances[one]))
                if on[chain, one]:
                    theta[chain, one] = causes[one].drawn(rng.random(1))[0]
            elif kinds[chain] == 1 and on[chain, one] != on[chain, other]:
                on[chain, [one, other]] = on[chain, [other, one]]
                new, old = (one, other) if on[chain, one] else (other, one)
                theta[chain, new] = causes[new].drawn(rng.random(1))[0]
                odds[chain] = math.log(chances[new] / (1 - chances[new])) - math.log(
                    chances[old] / (1 - chances[old])
                )
            elif kinds[chain] == 2 and there.size:
                at = int(rng.choice(there))
                was = theta[chain, at]
                theta[chain, at] = was + rng.normal(0, rng.choice([0.3, 0.1, 0.03]))
                densities = causes[at].log_density(np.array([theta[chain, at], was]))
                odds[chain] = densities[0] - densities[1]
            else:
                rows[chain] = systematic(weigher.known.weights, 1, float(rng.random()))[0]
        theta = np.clip(theta, -6, 6)
        return replace(self, rows=rows, on=on, theta=theta), odds

    def bodies(self, weigher: Weigher) -> Bodies:
        """The bodies."""
        bodies = weigher.bodies_of(self.rows)
        order, pieces = [], []
        for mask in np.unique(self.on, axis=0):
            own = np.flatnonzero((self.on == mask).all(axis=1))
            built = bodies[own]
            for number in np.flatnonzero(mask).tolist():
                built = weigher.causes[number].changed(built, self.theta[own, number])
            order.append(own)
            pieces.append(built)
        return Bodies.joined(pieces)[np.argsort(np.concatenate(order))]

    def scales(self, weigher: Weigher) -> Array:
        """Logarithms of their noise factors, shape (n, 2)."""
        scales: Array = weigher.known.scales[self.rows]
        return scales

    def drawn(self, count: int) -> Competitor:
        """So many, equally likely."""
        rows = systematic(self.weights, count, 0.5)
        return replace(
            self,
            rows=self.rows[rows],
            on=self.on[rows],
            theta=self.theta[rows],
            weights=np.full(count, 1 / count),
        )

    def suspects(self, weigher: Weigher) -> tuple[tuple[str, float], ...]:
        """Changes that most bodies have, with their shares."""
        shares = self.weights @ self.on
        order = np.argsort(-shares)[:3]
        return tuple(
            (weigher.causes[index].name, float(shares[index]))
            for index in order.tolist()
            if shares[index] >= 0.3
        )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
