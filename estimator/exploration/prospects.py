"""What can be expected of a problem before a robot has moved, by its prior alone.

The entropy of attachments and lengths, divided by the information that a movement gives, is about
the number of movements that it takes. A random movement gives what ``InformationGain`` computes for
the prior, and a chosen one about as much as the better random ones. On the shipped problems
attachments were certain after so many movements, or up to half as many more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from estimator.body.arrays import Flags
from estimator.body.morphology import Array, Morphology
from estimator.exploration.information_gain import InformationGain
from estimator.physics.base import ArrayPhysics
from estimator.physics.equivalence import Reference, images
from estimator.posterior.indistinguishable import indistinguishable_points
from estimator.posterior.model.noise import Noise
from estimator.posterior.model.unknowns import Predictor, Unknowns
from estimator.problem.genes import Gene
from estimator.problem.genome import Genome, Ways
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities

KNOWN: Final = 0.005
"""Error of a length, either way, within which it counts as known, m."""

NEVER: Final = 0.9
"""Share of bodies on which no reading shows an unknown, from which it is not identifiable."""

_POINTS: Final = 20_000  # points of the cube, among which allowed ones are looked for
_BODIES: Final = 1_000  # bodies: so many limit the information about one to 10 bits
_PROGRAMS: Final = 32  # random programs whose information is computed
_DRAWS: Final = 400  # readings drawn for each program
_GOOD_QUANTILE: Final = 0.9  # quantile of their information that a chosen program is taken to give
_CHANGED_BODIES: Final = 24  # bodies of which each unknown is changed
_COMPARED_PROGRAMS: Final = 60  # programs in which these are compared
_STEP: Final = 0.25  # share of a length's range by which it is changed
_FEWEST_BODIES: Final = 6  # least number of bodies on which an unknown can be changed


@dataclass(frozen=True, kw_only=True)
class Prospects:
    """What can be expected of a problem and some sensors.

    Attributes:
        ways: In how many ways the problem's parts may be attached.
        attachment_bits: Entropy of these ways, bits, without unknowns that are not identifiable.
        lengths: Number of lengths to be found.
        length_bits: Information that determines all identifiable lengths to within ``KNOWN``, bits.
        movement_bits: Information that a good movement gives at first, bits.
        unpredicted: Share of random movements after which the pose cannot be predicted.
        hidden: Share of bodies on which no reading shows another value of an unknown, by its name;
            unknowns that show on all of them are left out.
        turned: Share of bodies that read like themselves turned by quarters, or mirrored.
    """

    ways: Ways
    attachment_bits: float
    lengths: int
    length_bits: float
    movement_bits: float
    unpredicted: float
    hidden: dict[str, float]
    turned: float

    @property
    def never(self) -> tuple[str, ...]:
        """Names of the unknowns that are not identifiable."""
        return tuple(name for name, share in self.hidden.items() if share >= NEVER)

    def movements(self, bits: float) -> float:
        """Approximate number of movements that give so many bits; infinite if none gives any."""
        return bits / self.movement_bits if self.movement_bits > 0.05 else math.inf


def prospects(
    problem: Problem,
    robot: Capabilities,
    physics: ArrayPhysics,
    modalities: Sequence[str],
    rng: np.random.Generator,
) -> Prospects:
    """What can be expected of a problem on a robot.

    Args:
        problem: The problem, written out for the robot.
        robot: The robot.
        physics: Predicts readings, in the problem's world.
        modalities: Sensors that count.
        rng: Draws bodies, movements and noise.

    Raises:
        ProblemError: The robot cannot perform the problem's movements.
    """
    genome = Genome(problem, problem.base(robot))
    unknowns = Unknowns(genome)
    points = rng.random((_POINTS, unknowns.size))
    allowed_first = np.argsort(unknowns.forbidden(points), kind="stable")
    bodies = unknowns.permitted(points[allowed_first[:_BODIES]])
    ways = genome.ways(rng)
    programs = np.array([problem.random_program(rng, robot) for _ in range(_COMPARED_PROGRAMS)])
    predictor = Predictor(unknowns, physics)
    gain = InformationGain(
        Noise.announced(robot), problem.settings(robot).clearance_cap, tuple(modalities)
    )
    gains, unpredicted = [], []
    for program in programs[:_PROGRAMS]:
        predicted = predictor.read_all(bodies, program[None])
        scales, groups = np.zeros((len(bodies), 2)), np.arange(len(bodies))[:, None]
        gains.append(gain.of(predicted, scales, groups, rng, draws=_DRAWS)[0, 0])
        unpredicted.append(np.mean(predicted.undecided | ~predicted.valid))
    hidden = _hidden(predictor, bodies[:_CHANGED_BODIES], programs, modalities, rng)
    observable = [gene for gene in genome.genes if gene.observable]
    never = [gene for gene in observable if hidden.get(gene.name, 0.0) >= NEVER]
    lengths = [gene for gene in genome.genes if gene.trait == "length"]
    return Prospects(
        ways=ways,
        attachment_bits=max(0.0, math.log2(ways.number / math.prod(g.choices or 1 for g in never))),
        lengths=len(lengths),
        length_bits=sum(_length_bits(problem, gene) for gene in lengths if gene not in never),
        movement_bits=float(np.quantile(gains, _GOOD_QUANTILE)),
        unpredicted=float(np.mean(unpredicted)),
        hidden=hidden,
        turned=_turned(
            problem, genome.decode_all(bodies[:_CHANGED_BODIES]), programs, physics, modalities
        ),
    )


def _length_bits(problem: Problem, gene: Gene) -> float:
    low, high = problem.parts[gene.part].length
    return max(0.0, math.log2((high - low) / (2 * KNOWN)))


def _hidden(
    predictor: Predictor,
    bodies: Array,
    programs: Array,
    modalities: Sequence[str],
    rng: np.random.Generator,
) -> dict[str, float]:
    """Share of bodies on which no reading shows another value of an unknown, by its name."""
    unknowns = predictor.unknowns
    hidden = {}
    for column, gene in enumerate(unknowns.genes):
        changed = bodies.copy()
        least = 1 / gene.choices if gene.choices > 1 else _STEP
        steps = rng.uniform(least, 1 - least, len(bodies)) if gene.choices else _STEP
        changed[:, column] = (changed[:, column] + steps) % 1.0
        differ: Flags = ~unknowns.forbidden(changed) & ~unknowns.forbidden(bodies)
        if gene.choices:
            differ &= unknowns.decided(changed)[:, column] != unknowns.decided(bodies)[:, column]
        if differ.sum() < _FEWEST_BODIES:
            continue
        alike = indistinguishable_points(
            predictor, programs, modalities, bodies[differ], changed[differ]
        )
        if alike.any():
            hidden[gene.name] = float(alike.mean())
    return hidden


def _turned(
    problem: Problem,
    bodies: Sequence[Morphology],
    programs: Array,
    physics: ArrayPhysics,
    modalities: Sequence[str],
) -> float:
    """Share of bodies that read like a turned or mirrored image that the problem allows, too."""
    alike = 0
    for body in bodies:
        allowed = [
            image
            for image in images(body)
            if image != body
            and all(
                (rule.mount is None or part.mount == turned.mount)
                and (rule.hinge is None or part.hinge == turned.hinge)
                for rule, part, turned in zip(problem.parts, body.parts, image.parts, strict=True)
            )
        ]
        if allowed:
            reference = Reference(body, programs, physics, modalities)
            alike += any(map(reference.is_like, allowed))
    return alike / len(bodies)
