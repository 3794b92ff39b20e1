"""The rule ``information``: the program with the largest expected information gain about the body.

Once attachments have converged it may be the program that narrows lengths or masses most, instead
(``--learn``). ``Chooser`` finds the program; the rule says in words what it discriminates between.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies
from estimator.body.morphology import Array
from estimator.executors import Threads
from estimator.exploration.best_programs import CANDIDATES, best_programs
from estimator.exploration.few_limbs import limbs_of, moved_motors
from estimator.exploration.information_gain import InformationGain
from estimator.exploration.rules import Choice, Situation
from estimator.parameters.table import deviating, prior_probabilities
from estimator.posterior.fitted import FittedPosterior, each_with_each
from estimator.posterior.model.likelihood import FORKS, GRAVITY_TILTS
from estimator.posterior.model.unknowns import Predictor
from estimator.posterior.posterior import Posterior
from estimator.posterior.summary import SAMPLES
from estimator.readings.observation import PredictedReadings
from estimator.storage.run_config import Learn

_WORTH_SAYING: Final = 0.25  # bits about one trait from which it is named as a reason
_MOST_NAMED: Final = 2  # traits that are named, at most
_CONVERGED: Final = 0.9  # share of the samples that have the same attachments
_MASSES: Final = frozenset({"mass", "mass_of_each", "main_mass"})  # groups of the table


def most_informative_program(situation: Situation) -> Choice:
    """Maximises the expected information gain under the models' own likelihood."""
    models = situation.posterior
    with Threads(situation.jobs) as threads:
        gain = InformationGain(models.noise, models.clearance_cap, models.modalities, threads)
        chosen = Chooser(models.predictor, gain, models.program_range).choose(
            models.posterior, len(models.observations), situation.rng, learn=situation.learn
        )
    reason = _reason(models.sample(SAMPLES, situation.rng), chosen)
    if chosen.narrowed is not None:
        reason = f"narrows the {situation.learn} by {100 * chosen.narrowed:.0f} %, and {reason}"
    return Choice(
        program=tuple(chosen.program.tolist()),
        reason=reason,
        bits=chosen.bits,
        bits_about_causes=chosen.about_causes,
    )


def _reason(models: FittedPosterior, chosen: InformativeProgram) -> str:
    """What the program discriminates between, in words."""
    about = chosen.about
    order = np.argsort(-about, kind="stable")
    named = [column for column in order.tolist() if about[column] >= _WORTH_SAYING][:_MOST_NAMED]
    parts = [_possible_values(models, column) for column in named]
    if chosen.about_causes >= _WORTH_SAYING:
        table = models.problem.table
        causes = ("nothing" if row < 0 else table[row].name for row in chosen.causes[:2])
        parts.insert(0, f"what is otherwise than stated ({' or '.join(causes)})")
    return f"tells apart: {'; '.join(parts)}" if parts else "narrows what is known already"


def _possible_values(models: FittedPosterior, column: int) -> str:
    genome, gene = models.genome, models.genome.genes[column]
    if gene.choices:
        likely = Counter(genome.words(column, models.samples)).most_common(2)
        return f"{gene.name} ({' or '.join(word for word, _ in likely)})"
    ends = np.quantile(models.samples[:, column], (0.05, 0.95))
    low, high = genome.quantities(column, ends).tolist()
    return f"{gene.name} ({low:.0f} to {high:.0f} {gene.unit})"


_DRAWS: Final = 100  # readings drawn for each program
_FEWEST_BODIES: Final = 25  # bodies by which candidates are compared
_THINNED: Final = slice(None, None, 2)  # the bodies by which all but finalists are compared
_MORE_DRAWS: Final = 800  # readings drawn for each finalist
_READINGS_AT_ONCE: Final = 4096  # computed at once: their bodies fit into a processor's cache
_COMPETES: Final = 0.005  # share of the posterior from which a cause competes
_AS_LIKELY: Final = 0.02  # share of the best evidence from which a cause of another body competes
_THICKER: Final = 1.4  # factor on radii under which a predicted pose must stay the same
_PREDICTABLE: Final = math.radians(2.0)  # least path margin of a predicted pose: else forks win
_PLUMB: Final = GRAVITY_TILTS[:1]
_BRANCHES: Final = np.vstack([_PLUMB, FORKS])  # inclinations of gravity


@dataclass(frozen=True, kw_only=True)
class InformativeProgram:
    """A motor program, and its expected information gain.

    Attributes:
        program: Target of each motor, rad, shape (motors,).
        bits: Expected information gain about the body.
        about: Expected information gain about each column of a point, bits, shape (size,): about a
            choice, or about whether a length is above the samples' median.
        causes: Rows of the table of parameters whose wide components compete, the most probable
            first; −1: the robot is as stated. Empty where none compete.
        about_causes: Expected information gain about which of the causes it is, bits, under the
            probabilities with which they count for the choice.
        narrowed: Share by which the program is expected to narrow lengths or masses; ``None``:
            they were not asked for.
    """

    program: Array
    bits: float
    about: Array
    causes: tuple[int, ...] = ()
    about_causes: float = 0.0
    narrowed: float | None = None


@dataclass(frozen=True, kw_only=True)
class _Hypotheses:
    """Equally likely bodies, of which the posterior consists.

    Attributes:
        bodies: The n bodies.
        scales: Logarithms of their noise factors, shape (n, 2).
        groups: Number of each body's group, shape (n,): equal bodies are one group.
        causes: Which of the competing causes each body has, shape (n,); ``None``: none compete.
        asked: Lengths or masses that are to be learnt, shape (n, k); ``None``: the whole body is.
    """

    bodies: Bodies
    scales: Array
    groups: NDArray[np.int64]
    causes: NDArray[np.int64] | None = None
    asked: Array | None = None

    def __len__(self) -> int:
        return len(self.groups)

    def some(self, rows: slice) -> _Hypotheses:
        """Some of the bodies."""
        chosen = {name: array[rows] for name, array in vars(self).items() if array is not None}
        return replace(self, **chosen)


class Chooser:
    """Finds the motor program with the largest expected information gain.

    Args:
        predictor: Computes readings.
        gain: Computes information.
        ends: Lowest and highest target of each motor, rad, shape (motors, 2).
    """

    def __init__(self, predictor: Predictor, gain: InformationGain, ends: Array) -> None:
        self._predictor = predictor
        self._gain = gain
        self._ends = ends
        self._limbs = limbs_of(predictor.unknowns)

    def choose(
        self,
        posterior: Posterior,
        interactions: int,
        rng: np.random.Generator,
        *,
        learn: Learn = "all",
    ) -> InformativeProgram:
        """The motor program that is expected to tell most.

        Where causes compete (wide components of the table of parameters, or that there is none),
        they count by what the readings say of each, however improbable it was before, and
        information about which of them it is counts twice: leg lengths are worth little while a
        servo may turn the other way.

        Args:
            posterior: The posterior over bodies.
            interactions: Number of interactions that the posterior was learnt from.
            rng: Draws samples, programs and readings.
            learn: What is to be learnt once attachments have converged; the whole body, where that
                is not open.
        """
        low, high = self._ends.T
        causes, even = self._causes(posterior)
        samples, asked = self._asked(posterior.sample(SAMPLES, rng), learn)
        stated = known = self._models(samples, asked)
        if causes and asked is None:
            evened = even.sample(SAMPLES, rng)
            known = replace(self._models(evened, None), causes=self._deviating(evened.values))
        half = known.some(_THINNED)
        fewest = half.some(slice(None, None, max(1, len(half) // _FEWEST_BODIES)))
        shape = CANDIDATES, len(low)
        candidates = rng.uniform(low, high, shape)
        decided = self._predictor.unknowns.decided(samples.values)
        moved = moved_motors(shape, self._limbs, decided, interactions, rng)

        def rough(programs: Array) -> Array:
            (quick,) = self._read(fewest, programs, _PLUMB, coarse_step=True)
            return self._bits(fewest, quick, rng, _DRAWS)

        def good(programs: Array) -> Array:
            readings = self._sure_readings(half, programs, coarse_step=True)
            return self._bits(half, readings, rng, _DRAWS)

        def sure(programs: Array) -> Array:
            return self._bits(known, self._surest_readings(known, programs), rng, _MORE_DRAWS)

        programs, gains = best_programs(
            good,
            self._ends,
            rng,
            candidates=np.where(moved, candidates, 0.0),
            moved=moved,
            rough=rough,
            sure=sure,
        )
        chosen, bits = programs[[0]], gains[[0]]
        readings, narrowed, about_causes = self._surest_readings(known, chosen), None, 0.0
        if asked is not None:
            narrowed = float(bits[0])
            bits = self._bits(replace(known, asked=None), readings, rng, _MORE_DRAWS)
        elif known.causes is not None:
            ((about_causes,),) = self._gain.of(
                readings, known.scales, known.causes[:, None], rng, draws=_MORE_DRAWS
            ).tolist()
            readings = self._surest_readings(stated, chosen)
            bits = self._bits(stated, readings, rng, _MORE_DRAWS)
        return InformativeProgram(
            program=chosen[0],
            bits=float(bits[0]),
            about=self._about(samples, readings, rng),
            causes=causes,
            about_causes=about_causes,
            narrowed=narrowed,
        )

    def _causes(self, posterior: Posterior) -> tuple[tuple[int, ...], Posterior]:
        """The causes that compete, and the posterior in which each counts by its evidence's root.

        Causes that have a share compete, and causes that are about as likely by the readings, if
        they make another body. All but the most probable one have half of that posterior at most.
        """
        rows, cause = np.unique(self._deviating(posterior.values), return_inverse=True)
        shares = np.bincount(cause, posterior.weights)
        first = int(np.argmax(shares))
        evidences = shares / prior_probabilities(self._predictor.unknowns.table)[rows]
        likely = (evidences >= _AS_LIKELY * evidences.max()) & (shares > 0)
        differ = self._predictor.unknowns.differ(posterior.values, posterior.values[cause == first])
        another_body = np.bincount(cause, differ) > 0.5 * np.bincount(cause)
        compete = (shares >= _COMPETES) | (likely & another_body)
        if compete.sum() < 2:
            return (), posterior
        counts = np.where(compete, np.sqrt(evidences), 0.0)
        counts[first] = max(counts[first], counts.sum() - counts[first])
        weights = posterior.weights * (counts / np.where(compete, shares, 1.0))[cause]
        order = np.argsort(-np.where(compete, shares, 0.0), kind="stable")[: compete.sum()]
        return tuple(rows[order].tolist()), replace(posterior, weights=weights / weights.sum())

    def _deviating(self, values: Array) -> NDArray[np.int64]:
        unknowns = self._predictor.unknowns
        return deviating(unknowns.table, values[:, unknowns.genes_size :])

    def _asked(self, samples: Posterior, learn: Learn) -> tuple[Posterior, Array | None]:
        """Samples with the converged attachments, and their lengths or masses to be learnt."""
        unknowns = self._predictor.unknowns
        if learn == "all":
            return samples, None
        keys = unknowns.keys(samples.values)
        ((first, count),) = Counter(keys).most_common(1)
        same = np.array([key == first for key in keys])
        values = samples.values[same]
        if learn == "lengths":
            amounts = unknowns.bodies(values).length
        else:
            masses = np.array([row.group in _MASSES for row in unknowns.table], dtype=bool)
            amounts = values[:, unknowns.genes_size :][:, masses]
        if count < _CONVERGED * len(keys) or not np.ptp(amounts, axis=0).any():
            return samples, None
        return replace(samples, values=values, scales=samples.scales[same]), amounts

    def _models(self, samples: Posterior, asked: Array | None) -> _Hypotheses:
        _, group = np.unique(samples.values, axis=0, return_inverse=True)
        return _Hypotheses(
            bodies=self._predictor.unknowns.bodies(samples.values),
            scales=samples.scales,
            groups=group.ravel(),
            asked=asked,
        )

    def _bits(
        self, known: _Hypotheses, readings: PredictedReadings, rng: np.random.Generator, draws: int
    ) -> Array:
        if known.asked is not None:
            return self._gain.narrowed(readings, known.asked)
        groupings = [array for array in (known.groups, known.causes) if array is not None]
        bits = self._gain.of(readings, known.scales, np.stack(groupings, axis=1), rng, draws=draws)
        total: Array = bits.sum(axis=1)
        return total

    def _sure_readings(
        self, known: _Hypotheses, programs: Array, *, coarse_step: bool = False
    ) -> PredictedReadings:
        """Predicted readings, undecided where a body may fall to more sides than one.

        Where many attachments are open, also where the pose depends on how thick capsules are: a
        square part that is not known to be a box rests on its edges.
        """
        plumb, *others = self._read(known, programs, _BRANCHES, coarse_step=coarse_step)
        if self._predictor.unknowns.many:
            radius = np.where(known.bodies.box, 1.0, _THICKER) * known.bodies.radius
            thicker = replace(known, bodies=known.bodies.changed(radius=radius))
            others += self._read(thicker, programs, _PLUMB, coarse_step=coarse_step)
        apart = [self._gain.apart(plumb, other) for other in others]
        return replace(plumb, undecided=plumb.undecided | np.any(apart, axis=0))

    def _surest_readings(self, known: _Hypotheses, programs: Array) -> PredictedReadings:
        """Predicted readings, undecided also where path margins are small: slow to compute."""
        readings = self._sure_readings(known, programs)
        rows, repeated = each_with_each(len(known), programs)
        margins = self._predictor.margins(known.bodies, rows, repeated, most=_PREDICTABLE)
        return replace(readings, undecided=readings.undecided | (margins < _PREDICTABLE))

    def _read(
        self,
        known: _Hypotheses,
        programs: Array,
        gravity_tilts: Array,
        *,
        coarse_step: bool = False,
    ) -> list[PredictedReadings]:
        """Readings of all bodies in all programs, one record for each inclination of gravity."""
        pieces = []
        count = len(gravity_tilts)
        at_once = max(1, _READINGS_AT_ONCE // (count * len(known)))
        for start in range(0, len(programs), at_once):
            rows, repeated = each_with_each(len(known), programs[start : start + at_once])
            rows, tilts = np.repeat(rows, count), np.tile(gravity_tilts, (len(rows), 1))
            repeated = np.repeat(repeated, count, axis=0)
            pieces.append(
                self._predictor.read(known.bodies, rows, repeated, tilts, coarse_step=coarse_step)
            )
        readings = PredictedReadings.concatenate(pieces)
        return [readings[branch::count] for branch in range(count)]

    def _about(
        self, samples: Posterior, readings: PredictedReadings, rng: np.random.Generator
    ) -> Array:
        unknowns, values = self._predictor.unknowns, samples.values
        about, columns = np.zeros(unknowns.size), [*unknowns.choices, *unknowns.continuous]
        groups = unknowns.decided(values)
        upper = values > np.median(values, axis=0)
        groups[:, unknowns.continuous] = upper[:, unknowns.continuous]
        draws = 4 * len(values)
        (about[columns],) = self._gain.of(
            readings, samples.scales, groups[:, columns], rng, draws=draws
        )
        return np.maximum(about, 0.0)
