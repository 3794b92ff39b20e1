"""The objective error: how far the best model is from the true body.

Only a scorer may look at the truth. Rows of driven parts are never permuted: leg k of the model is
compared with what motor k of the robot turns.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.equivalence import PROGRAMS, equivalent
from estimator.errors import TruthError
from estimator.genome import Genome
from estimator.morphology import BASE, Array, Morphology
from estimator.physics.base import Physics
from estimator.problem import Problem
from estimator.randomness import Stream, generator
from estimator.report.result import driven_limbs, final_population, observed_so_far, touched
from estimator.store import RunStore
from estimator.truth.body import TrueLimb, true_limbs

TRAITS: Final = ("parent", "side", "hinge")

Cell: TypeAlias = tuple[int, str]
"""One configuration: number of the leg, and trait."""


class Score(BaseModel):
    """A run against the truth; lists are in motor order.

    Attributes:
        joints: Names of the joints that turn the legs.
        true_lengths_m: Length of each leg on the robot, m.
        lengths_m: On the best model, m.
        leg_errors_m: Absolute errors, m.
        leg_errors_signed_m: Estimated minus true, m; their mean is the bias.
        mean_leg_error_m: Mean of the absolute errors, m.
        mean_signed_leg_error_m: Mean of the signed errors, m.
        touched: Whether each leg touched the ground in some interaction; ``None``: not sensed.
        mean_leg_error_touched_m: Over the legs that did, m; ``None`` when there are none.
        mean_leg_error_never_touched_m: Over the legs that never did, m.
        configurations_right: Parents, sides and hinges of driven parts that are the true ones.
        configurations_right_up_to_equivalence: The same, counting as right what no sensor of the
            run could tell from the truth.
        configurations_total: Three per driven part.
        configurations_searched: How many of them the problem left to be found.
        not_representable: What the genome cannot express, which counts as wrong.
    """

    model_config = ConfigDict(frozen=True)

    joints: tuple[str, ...]
    true_lengths_m: tuple[float, ...]
    lengths_m: tuple[float, ...]
    leg_errors_m: tuple[float, ...]
    leg_errors_signed_m: tuple[float, ...]
    mean_leg_error_m: float
    mean_signed_leg_error_m: float
    touched: tuple[bool | None, ...]
    mean_leg_error_touched_m: float | None
    mean_leg_error_never_touched_m: float | None
    configurations_right: int
    configurations_right_up_to_equivalence: int
    configurations_total: int
    configurations_searched: int
    not_representable: tuple[str, ...]


def score(store: RunStore, problem: Problem, truth: Path, physics: Physics) -> Score:
    """Scores the best model of a run.

    Args:
        store: The run.
        problem: Its problem.
        truth: The robot's URDF.
        physics: Computes noise-free readings, for the equivalence of configurations.

    Raises:
        TruthError: The URDF is wrong, is another robot's, or the run has no model yet.
    """
    population, errors = final_population(store)
    if not len(population):
        raise TruthError(f"{store.directory} has no model yet, so there is nothing to score")
    genome = Genome(problem, problem.base(store.capabilities))
    body = genome.decode(population[int(np.argmin(errors))])
    joints = store.capabilities.joints
    names = {joints[motor].name: motor for motor in problem.motors.driven}
    limbs, true = driven_limbs(body), true_limbs(truth, names)
    signed = np.array([one.length - two.limb.length for one, two in zip(limbs, true, strict=True)])
    felt = tuple(touched(limb, observed_so_far(store)) for limb in limbs)
    misfits = [_misfits(limb, body) for limb in true]
    wrong = [
        (leg, trait)
        for leg, (one, two) in enumerate(zip(limbs, true, strict=True))
        for trait in TRAITS
        if getattr(one, trait) != getattr(two.limb, trait) or trait in misfits[leg]
    ]
    rng = generator(store.settings.seed, Stream.EQUIVALENCE)
    programs = [problem.random_program(rng, store.capabilities) for _ in range(PROGRAMS)]
    modalities = store.settings.modalities
    forgiven = _indistinguishable(
        [(leg, trait) for leg, trait in wrong if trait not in misfits[leg]],
        lambda kept: _variant(body, true, kept),
        lambda bodies, reference: equivalent(
            bodies, reference, np.array(programs), physics, modalities
        ),
    )
    total = len(TRAITS) * len(limbs)
    return Score(
        joints=tuple(limb.name for limb in true),
        true_lengths_m=tuple(limb.limb.length for limb in true),
        lengths_m=tuple(limb.length for limb in limbs),
        leg_errors_m=tuple(np.abs(signed).tolist()),
        leg_errors_signed_m=tuple(signed.tolist()),
        mean_leg_error_m=float(np.mean(np.abs(signed))),
        mean_signed_leg_error_m=float(np.mean(signed)),
        touched=felt,
        mean_leg_error_touched_m=_mean(signed, felt, which=True),
        mean_leg_error_never_touched_m=_mean(signed, felt, which=False),
        configurations_right=total - len(wrong),
        configurations_right_up_to_equivalence=total - len(wrong) + forgiven,
        configurations_total=total,
        configurations_searched=sum(
            gene.trait in TRAITS and problem.parts[gene.part].motor is not None
            for gene in genome.genes
        ),
        not_representable=tuple(sentence for found in misfits for sentence in found.values()),
    )


def _roots(body: Morphology) -> dict[int, int]:
    """Index of the part that each motor turns."""
    return {part.motor: index for index, part in enumerate(body.parts) if part.motor is not None}


def _misfits(limb: TrueLimb, body: Morphology) -> dict[str, str]:
    """What no genome of the problem has right about a limb, by trait."""
    found = dict(limb.not_representable)
    roots, parent = _roots(body), limb.limb.parent
    if parent != BASE and limb.limb.motor is not None and roots[parent] > roots[limb.limb.motor]:
        found["parent"] = f"{limb.name} sits on a part that comes later in the problem"
    return found


def _indistinguishable(
    wrong: Sequence[Cell],
    variant: Callable[[Collection[Cell]], Morphology],
    alike: Callable[[Sequence[Morphology], Morphology], list[bool]],
) -> int:
    """How many wrong cells cannot be told from the truth.

    They are tried all together first, since a symmetry of the whole body exchanges several legs;
    then leg by leg; then one by one.
    """
    if not wrong:
        return 0
    by_leg = [[cell for cell in wrong if cell[0] == leg] for leg in {leg for leg, _ in wrong}]
    trials = [list(wrong), *by_leg, *([cell] for cell in wrong)]
    verdicts = alike([variant(cells) for cells in trials], variant(()))
    forgiven = {
        cell for cells, same in zip(trials, verdicts, strict=True) if same for cell in cells
    }
    return len(forgiven)


def _variant(body: Morphology, true: Sequence[TrueLimb], kept: Collection[Cell]) -> Morphology:
    """The true body in the genome's words, save for the model's own value in the cells ``kept``."""
    parts = list(body.parts)
    root_of = _roots(body)
    for leg, (found, wanted) in enumerate(zip(driven_limbs(body), true, strict=True)):
        assert found.motor is not None
        root = root_of[found.motor]
        scale = wanted.limb.length / found.length
        for index, group in enumerate(body.rigid_groups):
            if group == root:
                parts[index] = replace(parts[index], length=parts[index].length * scale)
        parent = BASE if wanted.limb.parent == BASE else root_of[wanted.limb.parent]
        true_values = {
            "parent": parent if parent < root else parts[root].parent,
            "side": wanted.limb.side,
            "hinge": wanted.limb.hinge,
        }
        changes = {name: true_values[name] for name in TRAITS if (leg, name) not in kept}
        parts[root] = replace(parts[root], **changes)
    return replace(body, parts=tuple(parts))


def _mean(errors: Array, felt: Sequence[bool | None], *, which: bool) -> float | None:
    chosen = [abs(error) for error, one in zip(errors.tolist(), felt, strict=True) if one is which]
    return float(np.mean(chosen)) if chosen else None
