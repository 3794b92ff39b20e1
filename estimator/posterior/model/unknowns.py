"""The unit cube that a posterior is over, its bodies, and the readings that these predict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.body.arrays import Bodies, Flags
from estimator.body.morphology import Array, Morphology
from estimator.parameters.instruments import as_sensed, performed
from estimator.physics.base import ArrayPhysics
from estimator.posterior.model.deviations import Deviation, Deviations
from estimator.problem.genes import Gene
from estimator.problem.genome import Genome
from estimator.readings.observation import PredictedReadings

Columns = NDArray[np.intp]
Attachments = tuple[int, ...]
"""The choices of one body, in the order of its genes: parent, mount and hinge, part by part."""

SIZES: Final = (0.85, 1.5)
"""How far deviations go: the amounts that are looked at are fitted from the least to the most."""

_MANY: Final = 24.0  # bits


class Unknowns:
    """The unit cube of one problem: its uniform measure, where bodies are allowed, is the prior.

    Args:
        genome: The code between genes and bodies.

    Attributes:
        size: Dimensions.
        continuous: Columns of the lengths and of nuisance parameters.
        choices: Columns of what is chosen from a few values.
        counts: How many values each column chooses from, shape (size,); 0: any in a range.
        parents: Which columns choose what a part sits on, shape (size,).
        bits: Information that says which of all attachments a body has, were they equally likely.
        many: Whether these are so many that changes of single parts do not lead to the body.
        parts: Columns that belong to one part, for each part that has any; nuisance parameters
            belong to the main body.
        places: Columns that say where parts sit, of parts that may have each other's mounts and not
            share them: in each array one row a part, and the same columns for each.
        hinges: Columns of these parts' hinges, part by part.
    """

    def __init__(self, genome: Genome):
        self._genome = genome
        genes = genome.genes
        self.size = len(genes)
        self.continuous: Columns = _where([not gene.choices for gene in genes])
        self.choices: Columns = _where([gene.choices > 1 for gene in genes])
        self.counts: Columns = np.array([gene.choices for gene in genes], dtype=np.intp)
        self.parents: Flags = np.array([gene.trait == "parent" for gene in genes])
        self.bits = float(np.log2(self.counts[self.choices]).sum())
        self.parts: tuple[Columns, ...] = tuple(
            _where([gene.part == part for gene in genes])
            for part in sorted({gene.part for gene in genes})
        )
        self.places: tuple[Columns, ...] = _places(genome)
        self.hinges: tuple[tuple[Columns, ...], ...] = tuple(
            tuple(
                _where([one.part == genes[row[0]].part and one.trait == "hinge" for one in genes])
                for row in places
            )
            for places in self.places
        )
        self.many = self.bits > _MANY

    @property
    def genes(self) -> tuple[Gene, ...]:
        """What each column decides."""
        return self._genome.genes

    def forbidden(self, values: Array) -> Flags:
        """Which of n points the problem does not allow: there the prior is 0."""
        return self._genome.forbidden(values)

    def permitted(self, values: Array) -> Array:
        """The points, with parts on mounts that are taken moved to others."""
        return self._genome.permitted(values)

    def bodies(self, values: Array) -> Bodies:
        """The bodies of n points, shape (n, size)."""
        return self._genome.bodies(values)

    def deviating(self, deviations: Sequence[Deviation]) -> DeviatingUnknowns:
        """The cube with two columns more, for bodies that deviate from the problem."""
        return DeviatingUnknowns(self._genome, deviations)

    def decode_all(self, values: Array) -> list[Morphology]:
        """The bodies of n points as objects."""
        return self._genome.decode_all(values)

    def attachments(self, values: Array) -> NDArray[np.int64]:
        """What n points choose, shape (n, choices)."""
        return self.decided(values)[:, self.choices]

    def decided(self, values: Array) -> NDArray[np.int64]:
        """Chosen values of n points by column, −1 for a continuous one; shape (n, size)."""
        return self._genome.choices(values)

    def log_prior(self, values: Array) -> Array:
        """Logarithm of the prior of n points' attachments, to a constant; shape (n,)."""
        return self._genome.log_room(values)

    def keys(self, values: Array) -> list[Attachments]:
        """Attachments of n points as tuples, which can be compared and counted."""
        return [tuple(row) for row in self.attachments(values).tolist()]


class DeviatingUnknowns(Unknowns):
    """The cube of one problem with two columns more: how a body deviates from it, and how far.

    Args:
        genome: The code between genes and bodies.
        deviations: Of which the last column but one of a point holds the index. The last one is
            continuous, and says where the size lies within ``SIZES``.
    """

    def __init__(self, genome: Genome, deviations: Sequence[Deviation]):
        super().__init__(genome)
        self.size += 2
        self.continuous = np.append(self.continuous, self.size - 1)
        self._deviations = Deviations(deviations)

    def bodies(self, values: Array) -> Bodies:
        """The bodies of n points, each built by its deviation."""
        which = values[:, -2].astype(np.int64)
        return self._deviations.of(super().bodies(values[:, :-2]), which, sizes_of(values))


def deviating_points(
    values: Array, which: NDArray[np.intp] | int, sizes: Array | float = 1.0
) -> Array:
    """Points of ``DeviatingUnknowns``.

    Args:
        values: Points of the problem's cube, shape (n, size).
        which: Index of the deviation of each, shape (n,), or of all.
        sizes: How far each deviates, shape (n,), or all of them.
    """
    least, most = SIZES
    columns = np.broadcast_arrays(which, (sizes - least) / (most - least), values[:, 0])[:2]
    return np.column_stack([values, *columns])


def sizes_of(points: Array) -> Array:
    """How far n points of ``DeviatingUnknowns`` deviate; see ``Deviation.of``."""
    least, most = SIZES
    sizes: Array = least + (most - least) * points[:, -1]
    return sizes


class Cost(NamedTuple):
    """Counts of what was computed.

    Attributes:
        simulations: Interactions that were simulated.
        steps: Time steps of these.
    """

    simulations: int
    steps: int

    def since(self, before: Cost) -> Cost:
        """The difference to an earlier one."""
        return Cost(*(now - then for now, then in zip(self, before, strict=True)))


class Predictor:
    """Predicts the readings of points of the cube in motor programs.

    Args:
        unknowns: The cube.
        physics: Computes it; its own, so that populations can work side by side.

    Attributes:
        unknowns: As above.
    """

    def __init__(self, unknowns: Unknowns, physics: ArrayPhysics) -> None:
        self.unknowns = unknowns
        self._simulations_elsewhere = 0
        self._steps_elsewhere = 0
        self._physics = physics

    def deviating(self, deviations: Sequence[Deviation]) -> Predictor:
        """A predictor of bodies that deviate from the problem; physics is shared."""
        return Predictor(self.unknowns.deviating(deviations), self._physics)

    def over(self, unknowns: Unknowns) -> Predictor:
        """A predictor of other unknowns; physics is shared."""
        return Predictor(unknowns, self._physics)

    @property
    def simulations(self) -> int:
        """How many interactions were simulated so far."""
        return self._physics.simulations + self._simulations_elsewhere

    @property
    def steps(self) -> int:
        """How many time steps were computed so far."""
        return self._physics.steps + self._steps_elsewhere

    @property
    def cost(self) -> Cost:
        """Counts of what was computed so far."""
        return Cost(self.simulations, self.steps)

    def add_cost(self, cost: Cost) -> None:
        """Counts what a copy has computed in a worker process."""
        self._simulations_elsewhere += cost.simulations
        self._steps_elsewhere += cost.steps

    def read(
        self,
        bodies: Bodies,
        rows: Columns,
        programs: Array,
        gravity_tilts: Array | None = None,
        *,
        coarse_step: bool = False,
    ) -> PredictedReadings:
        """Predicted readings of some of the bodies, each in its own program.

        Args:
            bodies: From ``Unknowns.bodies``.
            rows: Which of them, shape (m,).
            programs: rad, shape (m, motors).
            gravity_tilts: How gravity is inclined on the way; see ``ArrayPhysics``.
            coarse_step: Coarse steps; see ``ArrayPhysics``.
        """
        chosen = bodies[rows]
        if not chosen.deviates:
            return self._physics.read_bodies(
                chosen, programs, gravity_tilts, coarse_step=coarse_step
            )
        angles = performed(programs, chosen)
        return as_sensed(
            self._physics.read_bodies(chosen, angles, gravity_tilts, coarse_step=coarse_step),
            chosen,
        )

    def margins(
        self, bodies: Bodies, rows: Columns, programs: Array, most: float = math.inf
    ) -> Array:
        """Path margins of bodies ``rows`` in their programs, rad, shape (m,), at most ``most``."""
        chosen = bodies[rows]
        return self._physics.path_margins_of_bodies(chosen, performed(programs, chosen), most)

    def read_all(
        self,
        values: Array,
        programs: Array,
        gravity_tilts: Array | None = None,
        *,
        coarse_step: bool = False,
    ) -> PredictedReadings:
        """Predicted readings of n points in each of k programs: n · k rows, programs fastest.

        Args:
            values: Points, shape (n, size).
            programs: rad, shape (k, motors).
            gravity_tilts: As in ``read``.
            coarse_step: As in ``read``.
        """
        count = len(programs)
        rows, each = np.repeat(np.arange(len(values)), count), np.tile(programs, (len(values), 1))
        return self.read(
            self.unknowns.bodies(values), rows, each, gravity_tilts, coarse_step=coarse_step
        )


def _places(genome: Genome) -> tuple[Columns, ...]:
    if not genome.forbids:
        return ()
    rows: dict[tuple[int | None, ...], list[list[int]]] = {}
    for part in sorted({gene.part for gene in genome.genes}):
        own = [
            (gene.parent, column)
            for column, gene in enumerate(genome.genes)
            if gene.part == part and gene.trait in ("parent", "mount")
        ]
        rows.setdefault(tuple(parent for parent, _ in own), []).append([at for _, at in own])
    return tuple(np.array(some) for kind, some in rows.items() if kind and len(some) > 1)


def _where(chosen: list[bool]) -> Columns:
    return np.flatnonzero(np.array(chosen, dtype=bool))
