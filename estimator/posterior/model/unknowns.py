"""The unit cube that a posterior is over, its bodies, and the readings that these predict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array, Morphology
from estimator.parameters.instruments import as_sensed, performed
from estimator.parameters.table import Parameter, applied
from estimator.physics.base import ArrayPhysics, Physics
from estimator.problem.genes import Gene
from estimator.problem.genome import DECIDED, Genome
from estimator.readings.observation import PredictedReadings

Columns = NDArray[np.intp]
Attachments = tuple[int, ...]
"""The choices of one body, in the order of its genes: parent, mount and hinge, part by part."""

_MANY_BITS: Final = 40.0  # bits of attachments above which many are open
_BITS_LEARNT: Final = 6.0  # bits about attachments that one interaction with few moved limbs tells
_OFF: Final = 2.0  # standard deviations off from which a length is another
_LEAST_DEVIATION: Final = 0.01  # least such standard deviation, of a length's range


class Unknowns:
    """The unit cube of one problem: its uniform measure, where bodies are allowed, is the prior.

    Beside its columns a point has one for each row of the table of parameters: its deviation from
    what the problem states, in the units of ``parameters.table.applied``.

    Args:
        genome: The code between genes and bodies.
        table: Parameters that may deviate; none by default.
        fixed: Parameters that deviate alike at all points, which have no columns for them, and
            their deviations.

    Attributes:
        table: As above.
        genes_size: Number of dimensions of the cube.
        size: Number of columns of a point.
        continuous: Columns of the lengths.
        choices: Columns of what is chosen from a few values and observable.
        counts: How many values each column chooses from, shape (genes,); 0: any in a range, or
            not observable.
        parents: Which columns choose what a part sits on, shape (genes,).
        bits: Entropy of the attachments, bits, were all equally likely.
        many: Whether that is so much that changes of single parts do not lead to the body.
        telling: Interactions from which on readings can tell attachments, each 6 bits at most.
        parts: Columns that belong to one part, by its number, of each part that has any.
        places: Columns that say where parts sit, of parts that may have each other's mounts but not
            share one: an array for each kind of such parts, with one row for each part.
        hinges: Columns of these parts' hinges, part by part.
    """

    def __init__(
        self,
        genome: Genome,
        table: Sequence[Parameter] = (),
        fixed: tuple[Sequence[Parameter], Array] = ((), np.empty(0)),
    ):
        self._genome = genome
        self._fixed = fixed
        self.table = tuple(table)
        genes = genome.genes
        self.genes_size = len(genes)
        self.size = self.genes_size + len(self.table)
        self.continuous: Columns = _where([not gene.choices for gene in genes])
        self.choices: Columns = _where([gene.is_choice for gene in genes])
        observable = [gene.observable * gene.choices for gene in genes]
        self.counts: Columns = np.array(observable, dtype=np.intp)
        self.parents: Flags = np.array([gene.trait == "parent" for gene in genes])
        self.bits = float(np.log2(self.counts[self.choices]).sum())
        self.parts: dict[int, Columns] = {
            part: _where([gene.part == part for gene in genes])
            for part in sorted({gene.part for gene in genes})
        }
        self.places: tuple[Columns, ...] = _places(genome)
        self.hinges: tuple[tuple[Columns, ...], ...] = tuple(
            tuple(
                _where([one.part == genes[row[0]].part and one.trait == "hinge" for one in genes])
                for row in places
            )
            for places in self.places
        )
        self.many = self.bits > _MANY_BITS
        self.telling = math.ceil(self.bits / _BITS_LEARNT)

    @property
    def genes(self) -> tuple[Gene, ...]:
        """What each column decides."""
        return self._genome.genes

    def forbidden(self, values: Array) -> Flags:
        """Which of n points the problem does not allow: there the prior is 0."""
        return self._genome.forbidden(self.cube(values))

    def permitted(self, values: Array) -> Array:
        """The points, with parts whose mounts are taken moved to other mounts."""
        return self._genome.permitted(values)

    def bodies(self, values: Array) -> Bodies:
        """The bodies of n points, shape (n, size)."""
        bodies = self._genome.bodies(self.cube(values), self._like)
        if self._like is None:
            table, deviations = self._fixed
            bodies = applied(table, bodies, deviations[None].repeat(len(values), axis=0))
        return applied(self.table, bodies, values[:, self.genes_size :])

    @cached_property
    def _like(self) -> Bodies | None:
        """A body with the fixed deviations; ``None`` if these change what genes decide."""
        table, deviations = self._fixed
        body = self._genome.bodies(np.zeros((1, self.genes_size)))
        changed = applied(table, body, deviations[None])
        same = (getattr(changed, name) is getattr(body, name) for name in DECIDED)
        return changed if all(same) else None

    def with_fixed_deviations(self, deviations: Array) -> Unknowns:
        """The cube alone, of bodies that all have these deviations, shape (rows,)."""
        return Unknowns(self._genome, fixed=(self.table, deviations)) if self.table else self

    def cube(self, values: Array) -> Array:
        """Genes of n points, without their deviations, shape (n, genes)."""
        return values[:, : self.genes_size]

    def as_stated(self, genes: Array) -> Array:
        """Points of n genomes that are as stated, shape (n, size)."""
        return self.with_deviations(genes, np.zeros(len(self.table)))

    def with_deviations(self, genes: Array, deviations: Array) -> Array:
        """Points of n genomes, shape (n, size), that all have these deviations, shape (rows,)."""
        return np.hstack([genes, deviations[None].repeat(len(genes), axis=0)])

    def log_narrow(self, values: Array, apart: Columns) -> Array:
        """Log-density of the narrow components of n points relative to its peak, shape (n,).

        Args:
            values: The points.
            apart: Row of the table that does not count for each point, shape (n,); −1: all count.
        """
        narrow = np.array([row.narrow for row in self.table])
        offs = np.where(narrow > 0, values[:, self.genes_size :] / np.where(narrow, narrow, 1), 0.0)
        offs[np.flatnonzero(apart >= 0), apart[apart >= 0]] = 0.0
        density: Array = -0.5 * np.sum(offs**2, axis=1)
        return density

    def as_built(self, values: Array) -> Array:
        """The n points, as stated in all that has no narrow component."""
        narrow = [row.narrow > 0 for row in self.table]
        return np.where([True] * self.genes_size + narrow, values, 0.0)

    def mean_deviations(self, values: Array, best: Array, weights: Array | None = None) -> Array:
        """Mean deviations of n points, shape (rows,); without a narrow component, the best point's.

        Means of these would suit no body: a jammed servo is at opposite angles on opposite hinges.
        """
        mean = np.average(values[:, self.genes_size :], axis=0, weights=weights)
        return np.where([row.narrow > 0 for row in self.table], mean, best[self.genes_size :])

    def points(self, genes: Array, amounts: Mapping[str, Array]) -> Array:
        """Points of n genomes, shape (n, size), of robots with amounts by the names of the table.

        Raises:
            ValueError: The table has no such row.
        """
        values, numbers = self.as_stated(genes), {row.name: i for i, row in enumerate(self.table)}
        for name, column in amounts.items():
            if name not in numbers:
                raise ValueError(f"no parameter that may deviate is called {name!r}")
            values[:, self.genes_size + numbers[name]] = column
        return values

    def amounts(self, values: Array) -> dict[str, Array]:
        """Deviations of n points by the names of the table, but for zeros; shape (n,) each."""
        deviations = values[:, self.genes_size : self.genes_size + len(self.table)]
        used = np.flatnonzero(np.any(deviations != 0, axis=0)).tolist()
        return {self.table[column].name: deviations[:, column] for column in used}

    def decode_all(self, values: Array) -> list[Morphology]:
        """The bodies of n points as objects, as if they were as stated."""
        return self._genome.decode_all(self.cube(values))

    def attachments(self, values: Array) -> NDArray[np.int64]:
        """Values that n points choose, shape (n, choices)."""
        return self.decided(values)[:, self.choices]

    def decided(self, values: Array) -> NDArray[np.int64]:
        """Chosen values of n points by column, −1 for a continuous one; shape (n, size)."""
        return self._genome.choices(self.cube(values))

    def log_prior(self, values: Array) -> Array:
        """Logarithm of the prior of n points' attachments, to a constant; shape (n,)."""
        return self._genome.log_room(self.cube(values))

    def differ(self, values: Array, known: Array) -> Flags:
        """Which of n points have other attachments or lengths than m samples of a posterior."""
        keys, lengths = set(self.keys(known)), known[:, self.continuous]
        off = np.abs(values[:, self.continuous] - np.median(lengths, axis=0))
        far: Flags = np.any(off > _OFF * np.maximum(lengths.std(axis=0), _LEAST_DEVIATION), axis=1)
        far |= [key not in keys for key in self.keys(values)]
        return far

    def keys(self, values: Array) -> list[Attachments]:
        """Attachments of n points as tuples, which can be compared and counted."""
        return list(map(tuple, self.attachments(values).tolist()))


class ChangedUnknowns(Unknowns):
    """The cube of a problem, with one more column for each change since identification.

    Args:
        genome: The code between genes and bodies.
        table: Parameters that might deviate when the robot was identified.
        changes: Parameters that have changed since.
    """

    def __init__(self, genome: Genome, table: Sequence[Parameter], changes: Sequence[Parameter]):
        super().__init__(genome, table)
        self._identified = self.size
        self._changes = tuple(changes)

    def bodies(self, values: Array) -> Bodies:
        """The bodies of n points, each changed by its own amounts."""
        bodies = super().bodies(values[:, : self._identified])
        for row, theta in zip(self._changes, values[:, self._identified :].T, strict=True):
            bodies = row.applied(bodies, row.amounts(row.wide or 1.0, theta))
        return bodies


class Cost(NamedTuple):
    """Counts of what was computed.

    Attributes:
        simulations: Interactions that were simulated.
        steps: Time steps of these.
    """

    simulations: int
    steps: int

    def since(self, before: Cost) -> Cost:
        """The difference from an earlier cost."""
        return Cost(*(count - earlier for count, earlier in zip(self, before, strict=True)))


class Predictor:
    """Predicts the readings of points of the cube in motor programs.

    Args:
        unknowns: The cube.
        physics: Computes readings; each population has its own, so that they work side by side.

    Attributes:
        unknowns: As above.
    """

    def __init__(self, unknowns: Unknowns, physics: ArrayPhysics) -> None:
        self.unknowns = unknowns
        self._physics = physics
        self._cost_of_copies = Cost(0, 0)

    @property
    def cost(self) -> Cost:
        """Counts of what was computed so far."""
        simulations, steps = self._cost_of_copies
        return Cost(self._physics.simulations + simulations, self._physics.steps + steps)

    def add_cost(self, cost: Cost) -> None:
        """Counts what a copy has computed in a worker process."""
        simulations, steps = self._cost_of_copies
        self._cost_of_copies = Cost(simulations + cost.simulations, steps + cost.steps)

    def read(
        self,
        bodies: Bodies,
        rows: Columns,
        programs: Array,
        gravity_tilts: Array | None = None,
        *,
        coarse_step: bool = False,
        stances: Columns | None = None,
    ) -> PredictedReadings:
        """Predicted readings of some of the bodies, each in its own program.

        Args:
            bodies: Bodies from ``Unknowns.bodies``.
            rows: Which of them, shape (m,).
            programs: Motor programs, rad, shape (m, motors).
            gravity_tilts: How gravity is inclined on the way; see ``ArrayPhysics``.
            coarse_step: Whether joints turn in coarse steps; see ``ArrayPhysics``.
            stances: Stances of bodies that are nearly the same, shape (m,); see ``ArrayPhysics``.
        """
        chosen = bodies[rows]
        readings = self._physics.read_bodies(
            chosen, programs, gravity_tilts, coarse_step=coarse_step, stances=stances
        )
        return as_sensed(readings, chosen)

    def margins(
        self, bodies: Bodies, rows: Columns, programs: Array, most: float = math.inf
    ) -> Array:
        """Path margins of bodies ``rows`` in their programs, rad, shape (m,), at most ``most``."""
        return self._physics.path_margins_of_bodies(bodies[rows], programs, most)

    def read_all(
        self, values: Array, programs: Array, gravity_tilts: Array | None = None
    ) -> PredictedReadings:
        """Predicted readings of n points in each of k programs: n · k rows, programs fastest.

        Args:
            values: Points, shape (n, size).
            programs: Motor programs, rad, shape (k, motors).
            gravity_tilts: As in ``read``.
        """
        rows, columns = np.indices((len(values), len(programs))).reshape(2, -1)
        return self.read(self.unknowns.bodies(values), rows, programs[columns], gravity_tilts)


def simulated(
    reference: Physics, unknowns: Unknowns, values: Array, programs: Array
) -> PredictedReadings:
    """What a simulator predicts of n points in each of k programs, as ``Predictor.read_all`` does.

    Args:
        reference: The simulator.
        unknowns: Unknowns that the points are of.
        values: Points, shape (n, size).
        programs: Motor programs, rad, shape (k, motors).
    """
    count = len(programs)
    bodies = unknowns.bodies(values)
    chosen = bodies[np.repeat(np.arange(len(values)), count)]
    angles = performed(np.tile(programs, (len(values), 1)), chosen)
    objects = [body for body in bodies.objects() for _ in range(count)]
    readings = reference.read(list(zip(objects, angles, strict=True)))
    return as_sensed(readings, chosen)


def _places(genome: Genome) -> tuple[Columns, ...]:
    if not genome.forbids:
        return ()
    rows: dict[tuple[int | None, ...], list[list[int]]] = {}
    for part in sorted({gene.part for gene in genome.genes}):
        pairs = [
            (gene.parent, column)
            for column, gene in enumerate(genome.genes)
            if gene.part == part and gene.trait in ("parent", "mount")
        ]
        rows.setdefault(tuple(parent for parent, _ in pairs), []).append([at for _, at in pairs])
    return tuple(np.array(places) for kind, places in rows.items() if kind and len(places) > 1)


def _where(chosen: list[bool]) -> Columns:
    return np.flatnonzero(np.array(chosen, dtype=bool))
