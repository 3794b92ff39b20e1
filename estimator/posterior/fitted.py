"""What a run knows of the robot's body, for whoever builds on it: ``FittedPosterior``.

Exploration rules are given it, and everything that reports or checks a run reads it here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict

from estimator.body.arrays import Bodies
from estimator.body.limbs import leg_lengths
from estimator.body.morphology import Array, Morphology
from estimator.errors import EstimatorError
from estimator.parameters.changeable_rows import changeable_rows_of
from estimator.parameters.table import Parameter
from estimator.physics.backends import open_predicting
from estimator.physics.base import ArrayPhysics
from estimator.posterior.model.likelihood import Likelihood
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import ChangedUnknowns, Columns, Predictor, Unknowns
from estimator.posterior.posterior import Posterior, systematic
from estimator.posterior.summary import load_posterior
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, PredictedReadings
from estimator.storage.database import reading
from estimator.storage.posteriors import StoredPosterior
from estimator.storage.store import RunStore
from protocol.wire.capabilities import Capabilities

_READINGS_AT_ONCE: Final = 4096  # whose bodies fit into a processor's cache


class Attachment(BaseModel):
    """One thing that a problem leaves open about how a part is attached.

    Attributes:
        what: Name of what is open, such as ``mount of leg 1``.
        value: Value that the best body has.
        probability: Share of the posterior that has this value.
    """

    model_config = ConfigDict(frozen=True)

    what: str
    value: str
    probability: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedPosterior:
    """Weighted bodies that stand for all that may be the robot's, after some interactions.

    A body is a genome: a point of the unit cube, which ``genome`` decodes. A run of the method
    ``paper`` has its population in the place of samples: its members count alike, and nothing is
    known of how probable they are.

    Attributes:
        problem: What was known about the robot beforehand.
        capabilities: What the robot says of itself.
        modalities: Sensors that count.
        observations: Observations of the interactions that were learnt from.
        posterior: The samples, and the sets of attachments that they choose among.
        open_physics: Opens the back-end that computes readings, when it is first needed.
        best: The best body's genome, shape (genes,); ``None`` before the first interaction. Of a
            posterior it has the most probable attachments and the medians of their lengths.
        summary: What a run stores and states of the posterior; ``None`` of a population, and before
            the first interaction.
        errors: Subjective errors of a population, shape (n,): by the reference back-end where it
            was asked.
        searched: Subjective errors of a population as the search computed them, shape (n,).
        ranking: Indices of a population's members, best first, shape (n,). Models that the
            reference back-end simulated come before the others, in the order of its errors.
        changes: What has changed since the body was identified, in the order of the posterior's
            ``changed``.
    """

    problem: Problem
    capabilities: Capabilities
    modalities: tuple[str, ...]
    observations: tuple[Observation, ...]
    posterior: Posterior
    open_physics: Callable[[], ArrayPhysics]
    best: Array | None = None
    summary: StoredPosterior | None = None
    errors: Array | None = None
    searched: Array | None = None
    ranking: NDArray[np.intp] | None = None
    changes: tuple[Parameter, ...] = ()

    # --- as a run has it --------------------------------------------------------------------------

    @classmethod
    def of(cls, store: RunStore) -> FittedPosterior | None:
        """Reads the posterior from a run; ``None`` before anything was learnt."""
        if not store.settings.keeps_samples:
            return cls._of_population(store)
        stored = store.posteriors()
        learnt_from = store.observations()[: len(stored)]
        return cls.of_stored(store, stored[-1][0], learnt_from) if stored else None

    @classmethod
    def history(cls, store: RunStore) -> list[FittedPosterior]:
        """The posterior after each interaction; empty of a population."""
        observations = store.observations()
        return [
            cls.of_stored(store, posterior, observations[:count])
            for count, (posterior, _) in enumerate(store.posteriors(), 1)
        ]

    @classmethod
    def of_stored(
        cls, store: RunStore, stored: StoredPosterior, observations: Sequence[Observation]
    ) -> FittedPosterior:
        """The posterior as a run has stored it."""
        with reading(store.directory):
            best = np.array(stored.best, dtype=float)
            posterior = load_posterior(stored, Unknowns(store.genome, store.problem.table))
            fitted = cls.in_run(store, posterior, observations)
            fitted = replace(fitted, best=best, summary=stored)
            rows = {row.name: row for row in fitted.possible_changes} if stored.changes else {}
            unknown = [change.name for change in stored.changes if change.name not in rows]
            if unknown:
                raise ValueError(f"there is no change {', '.join(unknown)}")
            return replace(fitted, changes=tuple(rows[change.name] for change in stored.changes))

    @classmethod
    def _of_population(cls, store: RunStore) -> FittedPosterior | None:
        checkpoint, latest = store.checkpoint(), store.latest_generation()
        if checkpoint is None or latest is None:
            return None
        finish = store.search_end.finish()
        with reading(store.directory):
            genes = np.array(checkpoint.state["population"], dtype=float)
            searched = np.array(latest.errors, dtype=float)
            if genes.shape[:1] != searched.shape:
                raise ValueError(f"{len(genes)} models have {len(searched)} errors")
            store.check_genes(genes)
            errors, later = searched.copy(), np.ones(len(searched), dtype=bool)
            if finish is not None:
                errors[list(finish.models)] = finish.simulated
                later[list(finish.models)] = False
        ranking = np.lexsort((errors, later))
        observations = store.observations()[: latest.iteration + 1]
        return replace(
            cls.in_run(store, Posterior.equally_likely(genes), observations),
            best=genes[ranking[0]],
            errors=errors,
            searched=searched,
            ranking=ranking,
        )

    @classmethod
    def in_run(
        cls, store: RunStore, posterior: Posterior, observations: Sequence[Observation]
    ) -> FittedPosterior:
        """Samples of a run; readings are computed by its physics or, if that is slow, by statics.

        Args:
            store: The run.
            posterior: The samples.
            observations: Observations that the samples were learnt from.
        """
        settings = store.settings
        return cls(
            problem=store.problem,
            capabilities=store.capabilities,
            modalities=settings.modalities,
            observations=tuple(observations),
            posterior=posterior,
            open_physics=partial(open_predicting, settings.physics, store.world),
        )

    def computed_by(self, physics: ArrayPhysics) -> FittedPosterior:
        """This posterior, with readings computed by a back-end that is open already."""
        return replace(self, open_physics=lambda: physics)

    # --- the bodies -------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def samples(self) -> Array:
        """Genomes of the samples, shape (n, genes), each number in [0, 1]."""
        return self.unknowns.cube(self.points)

    @property
    def points(self) -> Array:
        """Genomes with what is otherwise and has changed, for ``unknowns``, shape (n, size)."""
        values, changed = self.posterior.values, self.posterior.changed
        return values if changed is None else np.hstack([values, changed])

    @property
    def best_point(self) -> Array | None:
        """The best body's genome, as ``points`` has those of the samples, shape (size,)."""
        if self.best is None or self.summary is None:
            return self.best
        posterior, identified = self.posterior, Unknowns(self.genome, self.unknowns.table)
        mode = posterior.modes[0].point
        deviations = identified.mean_deviations(posterior.values, mode, posterior.weights)
        best: Array = identified.with_deviations(self.best[None], deviations)[0]
        if posterior.changed is None:
            return best
        order = np.argsort(posterior.changed[:, 0], kind="stable")
        return np.append(best, posterior.changed[order[len(order) // 2]])

    @property
    def weights(self) -> Array:
        """Weights of the samples, adding up to 1, shape (n,)."""
        return self.posterior.weights

    @property
    def scales(self) -> Array:
        """Logarithms of the samples' factors on the noise of tilt and clearance, shape (n, 2)."""
        return self.posterior.scales

    @cached_property
    def genome(self) -> Genome:
        """The code between genomes and bodies."""
        return Genome(self.problem, self.problem.base(self.capabilities))

    @cached_property
    def best_body(self) -> Morphology | None:
        """The best body, as it is by now; ``None`` before the first interaction."""
        return None if self.best_point is None else self.bodies_at(self.best_point[None])[0]

    def bodies(self, count: int) -> list[Morphology]:
        """``count`` representative bodies, each as often as its weight says to within one."""
        return self.bodies_at(self.points[systematic(self.weights, count, 0.5)])

    def bodies_at(self, points: Array) -> list[Morphology]:
        """The bodies of n points, shape (n, size): as stated, but for lengths that have changed."""
        bodies = self.genome.decode_all(self.unknowns.cube(points))
        if not self.changes:
            return bodies
        changed = []
        for body, lengths in zip(bodies, self.unknowns.bodies(points).length.tolist(), strict=True):
            pairs = zip(body.parts, lengths, strict=True)
            parts = tuple(replace(part, length=length) for part, length in pairs)
            changed.append(replace(body, parts=parts))
        return changed

    def sample(self, count: int, rng: np.random.Generator) -> FittedPosterior:
        """This posterior with at most ``count`` equally likely samples, drawn by their weights."""
        return replace(self, posterior=self.posterior.sample(count, rng))

    @cached_property
    def model_points(self) -> Array:
        """Points of all models, (m, size): a population's, or the best body's and the samples'."""
        if self.summary is None or self.best_point is None:
            return self.points
        return np.vstack([self.best_point, self.points])

    @cached_property
    def ranked(self) -> NDArray[np.intp]:
        """Indices of the models: the best, then the others by error or weight; shape (m,)."""
        if self.ranking is not None:
            return self.ranking
        first = [np.inf] if len(self.model_points) > len(self) else []
        return np.argsort(-np.concatenate([first, self.weights]), kind="stable")

    @cached_property
    def leg_lengths(self) -> Array:
        """Length of each leg of each sample by now, m, shape (n, legs), in motor order."""
        return leg_lengths(self.bodies_at(self.points))

    # --- what is stated ---------------------------------------------------------------------------

    @property
    def probability(self) -> float | None:
        """Probability that the best body's attachments are right; ``None``: not known."""
        return None if self.summary is None else self.summary.probability

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Each open choice of the best body, with its probability.

        Empty of a population, and before the first interaction.
        """
        if self.summary is None or self.best is None:
            return ()
        attachments, genome = [], self.genome
        for column, gene in enumerate(genome.genes):
            if gene.is_choice:
                (value,) = genome.words(column, self.best[None])
                same = [word == value for word in genome.words(column, self.samples)]
                share = min(float(self.weights @ np.array(same)), 1.0)
                attachments.append(Attachment(what=gene.name, value=value, probability=share))
        return tuple(attachments)

    # --- the model --------------------------------------------------------------------------------

    @cached_property
    def unknowns(self) -> Unknowns:
        """The cube that the posterior is over."""
        genes = self.posterior.values.shape[1] - len(self.genome.genes)
        table = self.problem.table if genes else ()
        if self.changes:
            return ChangedUnknowns(self.genome, table, self.changes)
        return Unknowns(self.genome, table)

    @cached_property
    def predictor(self) -> Predictor:
        """Computes readings."""
        return Predictor(self.unknowns, self.open_physics())

    @cached_property
    def body_arrays(self) -> Bodies:
        """The bodies of all samples as they are by now."""
        return self.unknowns.bodies(self.points)

    @cached_property
    def possible_changes(self) -> tuple[Parameter, ...]:
        """What may change on the robot while it is in use."""
        body = self.best_body
        if body is None:
            return ()
        joints = [joint.name for joint in self.capabilities.joints]
        return changeable_rows_of(body, joints, [part.name for part in self.problem.parts])

    @cached_property
    def noise(self) -> Noise:
        """Sensor noise as the robot announces it."""
        return Noise.announced(self.capabilities)

    @cached_property
    def clearance_cap(self) -> float:
        """Range of the distance sensor, m."""
        return self.problem.settings(self.capabilities).clearance_cap

    @cached_property
    def program_range(self) -> Array:
        """Lowest and highest target of each joint, rad, shape (joints, 2); 0 where not driven."""
        return self.problem.program_range(self.capabilities)

    @cached_property
    def likelihood(self) -> Likelihood:
        """Likelihood of the observations."""
        return self.likelihood_of(self.observations)

    def likelihood_of(self, observations: Sequence[Observation]) -> Likelihood:
        """Likelihood of some observations; sensors that do not count are left out."""
        return Likelihood(
            SensorData.of(observations, self.modalities, self.clearance_cap), self.noise
        )

    def predict(self, programs: ArrayLike) -> PredictedReadings:
        """Readings that the samples predict, without noise, each on its undisturbed branch.

        Args:
            programs: Angle of each joint, rad: shape (joints,), or (p, joints).

        Returns:
            Readings of all samples, whose arrays begin with (n,), or with (p, n): ``predict(p)[k]``
            is ``predict(p[k])``. Those that are not ``valid``, or ``undecided``, predict nothing.

        Raises:
            EstimatorError: The programs have a wrong shape, or are not finite.
        """
        angles = self._checked(programs)
        stacked = np.atleast_2d(angles)
        bodies, count = self.body_arrays, len(self)
        at_once, pieces = max(1, _READINGS_AT_ONCE // max(1, count)), []
        for start in range(0, len(stacked), at_once):
            batch = stacked[start : start + at_once]
            pieces.append(self.predictor.read(bodies, *each_with_each(count, batch)))
        readings = PredictedReadings.concatenate(pieces)
        return readings if angles.ndim == 1 else readings.reshaped(len(stacked), count)

    def margins(self, programs: ArrayLike) -> Array:
        """Path margins, rad: how far gravity may be inclined until a sample falls elsewhere.

        Args:
            programs: As for ``predict``, which raises the same errors.

        Returns:
            Margins of all samples, shape (n,), or (p, n).
        """
        angles = self._checked(programs)
        stacked, count = np.atleast_2d(angles), len(self)
        margins = self.predictor.margins(self.body_arrays, *each_with_each(count, stacked))
        return margins.reshape(*angles.shape[:-1], count)

    def log_likelihood(self, program: ArrayLike, observation: Observation) -> Array:
        """Logarithm of the density of what was observed, under each sample and its noise factors.

        The likelihood by which bodies are judged, shape (n,): with outliers, and falls to either
        side of a fork. Sensors that do not count are left out.

        Args:
            program: Angles that the joints took, rad, shape (joints,): an observation has its own.
            observation: What was observed.

        Raises:
            EstimatorError: The program has a wrong shape or is not finite, or another robot
                observed this.
        """
        angles = self._checked(program)
        if angles.ndim != 1:
            raise EstimatorError(f"one observation has one program, not {len(angles)}")
        sensor = self.capabilities.sensor("touch")
        touch = sensor.count if sensor else 0
        if "touch" in self.modalities and len(observation.touch) != touch:
            raise EstimatorError(
                f"robot {self.capabilities.robot!r} has {touch} touch sensors, and the observation "
                f"has {len(observation.touch)} values: give None for one that was not read"
            )
        taken = {"angles": tuple(angles.tolist()), "measured": ()}
        likelihood = self.likelihood_of([observation.model_copy(update=taken)])
        return likelihood.normalised(self.predictor, self.points, self.scales)[:, 0]

    def _checked(self, programs: ArrayLike) -> Array:
        """Programs as an array of one or two dimensions."""
        try:
            angles = np.asarray(programs, dtype=float)
        except (TypeError, ValueError) as error:
            raise EstimatorError(f"motor programs are angles, rad: {error}") from error
        joints = len(self.capabilities.joints)
        if angles.ndim not in {1, 2} or angles.shape[-1] != joints:
            raise EstimatorError(
                f"motor programs have the shape {angles.shape}: give one angle, rad, for each of "
                f"the robot's {joints} joints, ({joints},) or (programs, {joints})"
            )
        if not np.isfinite(angles).all():
            raise EstimatorError("a motor program holds an angle that is not finite: give rad")
        return angles


def each_with_each(count: int, programs: Array) -> tuple[Columns, Array]:
    """Indices of all bodies for the first program, then for the next; and the program of each."""
    return np.tile(np.arange(count), len(programs)), np.repeat(programs, count, axis=0)
