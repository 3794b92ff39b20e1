"""Whether a robot is still the one that was identified: a watch that moves it now and then.

Against "nothing has changed" stands the table of changes. As it is not known when something
changed, the odds of each particle of a change follow Shiryaev's recursion (1963)::

    R <- (R + hazard · prior) · p(observation | changed) / p(observation | unchanged)

and their sum is the odds that something has changed. Were the models exact, an alarm beyond
``hazard / rate`` would be false once in ``1 / rate`` movements or less often (Pollak 1985).

Each movement also tells which of the posterior's bodies the robot has. A change is weighed against
a robot of which that has been learnt: else particles whose bodies are right would gain on a mean
over all bodies in each movement, until there is an alarm. Few bodies stand for a posterior, and
none is the robot's exactly, so that what was learnt is forgotten by and by.

One more change is in no row of the table: under it any reading is as probable as another. Without
it readings that nothing explains would tell nothing, since they are outliers whatever has changed.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array
from estimator.posterior.model.special import logsumexp, softmax
from estimator.readings.observation import Observation
from estimator.use.movements import Hypotheses, best_of, near_forks, readings_in
from estimator.use.pose import attainable
from estimator.use.weighing_changes import UNLISTED_CHANGES, ChangeParticles, ChangeWeigher

HAZARD: Final = 1e-3
"""Probability that something changes between two movements."""

FALSE_ALARMS: Final = 1e-5
"""False alarms per movement, were the models exact."""

_PARTICLES: Final = 64  # of a change
_KEPT_ESS: Final = 0.05  # effective number of bodies that may be left, as a share of that at first
_FORGETTING: Final = 0.9  # factor on what was learnt of bodies, until so many are left
_RECENT: Final = 30  # last movements, in one of which a change that is noticed must have happened
_CANDIDATES: Final = 400  # programs, among which a patrol chooses
_WATCHED: Final = 8  # particles of a change, by which a patrol chooses
_SIGMAS: Final = 4.0  # standard deviations, beyond which a difference shows
_RISKY: Final = 0.1  # share of bodies, old and damaged, that may be near falling elsewhere


class Watch:
    """Takes in observations, and says how probably something has changed.

    Args:
        weigher: Knows the body as it was identified, and the changes.
        rate: False alarms per movement.

    Attributes:
        odds: Odds that something has changed.
        threshold: Odds beyond which there is an alarm.
        movements: Number of movements so far.
    """

    def __init__(self, weigher: ChangeWeigher, *, rate: float = FALSE_ALARMS) -> None:
        self.weigher = weigher
        self.odds = 0.0
        self.threshold = HAZARD / rate
        self.movements = 0
        self._particles = [weigher.prior(change, _PARTICLES) for change in weigher.changes]
        self._bodies = Bodies.joined([weigher.bodies(particles) for particles in self._particles])
        self._rows = np.concatenate([particles.rows for particles in self._particles])
        self._scales = np.concatenate([weigher.scales(particles) for particles in self._particles])
        share = math.log(1 - UNLISTED_CHANGES) - math.log(_PARTICLES)
        listed = np.repeat([change.log_prior + share for change in weigher.changes], _PARTICLES)
        # The last entry of these is that of what is in no row of the table.
        self._log_prior = np.append(listed, math.log(UNLISTED_CHANGES))
        self._logs = np.full(len(self._log_prior), -np.inf)  # logarithms of R
        self._learning = weigher  # knows what unchanged bodies have told so far
        self._log_fits = np.zeros(len(weigher.known))  # the same, in nats
        # Each movement with its log-likelihood ratios, and what was learnt before it.
        self._recent = deque[tuple[Observation, Array, ChangeWeigher]](maxlen=_RECENT)

    @property
    def alarm(self) -> bool:
        """Whether the odds are beyond the threshold."""
        return self.odds > self.threshold

    def take(self, observation: Observation) -> None:
        """Takes in what was observed in one more movement."""
        weigher, old = self.weigher, self._learning.as_before()
        listed = weigher.fits_of(self._bodies, self._scales, [observation])[:, 0]
        changed = np.append(listed, weigher.known.likelihood_of([observation]).log_anywhere)
        fits = weigher.fits(old, [observation])[:, 0]
        ratios = changed - logsumexp(np.log(old.weights) + fits)
        learnt = np.log(old.weights / weigher.as_before().weights)
        log_prior = self._log_prior + np.append(learnt[self._rows], 0.0)
        self._logs = np.logaddexp(self._logs, math.log(HAZARD) + log_prior) + ratios
        self._recent.append((observation, ratios, self._learning))
        self.odds = float(np.exp(np.minimum(logsumexp(self._logs), 300.0)))
        self.movements += 1
        self._learn(fits)

    def _learn(self, fits: Array) -> None:
        """Takes in how well the posterior's bodies explain one more movement, shape (bodies,)."""
        fewest = _KEPT_ESS * self.weigher.as_before().effective_bodies
        self._log_fits += fits
        self._learning = self.weigher.learning(self._log_fits)
        while self._learning.as_before().effective_bodies < fewest:
            self._log_fits *= _FORGETTING
            self._learning = self.weigher.learning(self._log_fits)

    @property
    def none_of_these(self) -> float:
        """How probable it is, if anything has changed, that it is in no row of the table."""
        return float(softmax(self._logs)[-1]) if self.movements else UNLISTED_CHANGES

    def suspects(self, count: int = 3) -> tuple[tuple[ChangeParticles, float], ...]:
        """The most probable changes, with how probable each is if anything has changed.

        Weighed as in a diagnosis, by the movements since the one from which on a change explains
        most. There are none where it is more probably none of these.
        """
        if self.none_of_these > 0.5:
            return ()
        observed, ratios, learning = zip(*self._recent, strict=True)
        log_odds = np.cumsum(ratios[::-1], axis=0) + self._log_prior
        first = len(observed) - 1 - int(np.argmax(logsumexp(log_odds, axis=1)))
        weighed = learning[first].weigh(observed[first:])
        changed = max(1.0 - weighed.unchanged, 1e-300) / (1.0 - self.none_of_these)
        suspects = [
            (one, share / changed) for one, share in weighed.shares if one.change is not None
        ]
        return tuple(suspects[:count])

    def _likely(self) -> list[tuple[ChangeParticles, float]]:
        """The table's changes weighed by the recursion, each with its share of these."""
        logs = (self._logs if self.movements else self._log_prior)[:-1]
        by_change = logs.reshape(len(self._particles), -1)
        shares = softmax(logsumexp(by_change, axis=1)).tolist()
        return [
            (replace(particles, weights=softmax(change_logs)), share)
            for particles, change_logs, share in zip(
                self._particles, by_change, shares, strict=True
            )
        ]

    def next_movement(self) -> Array:
        """The movement that tells best whether something has changed, rad."""
        weigher = self.weigher
        old = self._learning.prior(None, len(weigher.known))
        groups = [(old, 0.5), *((particles, share / 2) for particles, share in self._likely())]
        hypotheses = Hypotheses.of(weigher, groups)
        two_groups = replace(hypotheses, groups=np.minimum(hypotheses.groups, 1))
        safe_for = hypotheses.bodies[hypotheses.groups == 0]
        return best_of(weigher, two_groups, safe_for=safe_for)[0]

    def patrol(self, count: int) -> list[Array]:
        """Movements that together show most changes, rad, chosen one after the other."""
        weigher, known = self.weigher, self.weigher.known
        low, high = known.program_range.T
        programs = weigher.rng.uniform(low, high, (_CANDIDATES, len(low)))
        programs = attainable(known, programs)
        old = Hypotheses.of(weigher, [(weigher.prior(None, len(known)), 1.0)], _WATCHED).bodies
        drawn = [particles.drawn(_WATCHED, 0.5) for particles in self._particles]
        bodies = Bodies.joined([old, *map(weigher.bodies, drawn)])
        risky = near_forks(known, bodies, programs)
        safe = (risky[:, :_WATCHED].mean(axis=1) <= _RISKY) & (risky.mean(axis=1) <= 3 * _RISKY)
        programs = programs[safe] if safe.any() else programs
        shows = self._shown(bodies, programs)
        priors = np.exp([change.log_prior for change in weigher.changes])
        missed, chosen = np.ones(shows.shape[1]), list[Array]()
        for _ in range(count):
            gains = (missed * shows * np.repeat(priors, _WATCHED)).sum(axis=1)
            best = int(np.argmax(gains))
            missed = missed * (1 - 0.9 * shows[best])
            chosen.append(programs[best])
        return chosen

    def _shown(self, bodies: Bodies, programs: Array) -> Array:
        """Whether particles read otherwise than the old bodies, shape (programs, particles)."""
        known = self.weigher.known
        readings = readings_in(known, bodies, programs).reshaped(len(programs), len(bodies))
        tilt, clearance = readings.tilt, readings.clearance
        old = slice(None, _WATCHED)
        tilted = np.max(
            np.abs(tilt[:, _WATCHED:] - np.median(tilt[:, old], axis=1, keepdims=True)), axis=2
        )
        lifted = np.abs(
            clearance[:, _WATCHED:] - np.median(clearance[:, old], axis=1, keepdims=True)
        )
        touch = readings.touch[:, old].mean(axis=1, keepdims=True)
        touch_differs = np.any(np.abs(readings.touch[:, _WATCHED:] - touch) > 0.9, axis=2)
        noise = known.noise
        shown = (
            (tilted > _SIGMAS * noise.tilt) | (lifted > _SIGMAS * noise.clearance) | touch_differs
        )
        return np.asarray(shown, dtype=float)
