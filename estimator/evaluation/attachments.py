"""How a model's parts are attached, compared with the true body: parent, mount and hinge of each.

Rows are never permuted: a row of the genome is compared with what its joint carries on the robot,
and one that is rigid on a part with what a fixed joint holds there. Other rows whose joint nobody
named have nothing to be compared with. The hinge of a locked part cannot be felt and is not
compared.

Some wrong configurations cannot be told from the true ones. They are right *up to equivalence*:
there is a body that no sensor of the run can tell from the true one and that has them, at whatever
lengths.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeAlias

from pydantic import BaseModel, ConfigDict

from estimator.body.limbs import Limb, driven_limbs, limbs
from estimator.body.morphology import BASE, Morphology
from estimator.evaluation.truth.body import TrueLimb, check_robot, rigid_parts, true_limbs
from estimator.physics.equivalence import images
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities

TRAITS: Final = ("parent", "mount", "hinge")
MAIN_BODY: Final = "main body"
UNSAYABLE: Final = "not representable"
_SLIGHT: Final = 1e-3  # m, by which a length may lie outside the problem's range unmentioned

Cell: TypeAlias = tuple[int, str]
"""One configuration: row of the genome, and trait."""

Indistinguishable: TypeAlias = Callable[[Sequence[Morphology]], bool]
"""Whether a body cannot be told from the true one at some lengths; it is given at several."""


class Configuration(BaseModel):
    """One configuration of the best model, beside the truth.

    Attributes:
        part: Name of the part in the problem.
        trait: ``parent`` (the paper's P), ``mount`` (O) or ``hinge`` (J).
        modelled: Value on the model.
        true: Value on the robot, where the problem can express it.
        searched: Whether there was anything to be found: the problem left it open, and more than
            one choice was possible.
        chance: Probability that a random model has it right.
        right: Whether the model has it right.
        right_up_to_equivalence: Whether it is right, or no sensor of the run could tell that it is
            wrong. A model may be closer to a turned image of the robot; then what would be right of
            the robot as it stands can be wrong.
    """

    model_config = ConfigDict(frozen=True)

    part: str
    trait: str
    modelled: str
    true: str
    searched: bool
    chance: float
    right: bool
    right_up_to_equivalence: bool


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The true body of a robot as far as a problem asks for it.

    Attributes:
        rows: For each row of the genome whose joint is known, or that a fixed joint can be told to
            hold, the limb that this joint carries; limbs are numbered by rows.
        legs: What each driven joint moves as one piece, by motor; limbs are numbered by motors.
    """

    rows: Mapping[int, TrueLimb]
    legs: Mapping[int, TrueLimb]

    @classmethod
    def read(cls, path: Path, problem: Problem, capabilities: Capabilities) -> Truth:
        """Reads a robot's URDF.

        Raises:
            TruthError: The URDF is wrong or another robot's.
        """
        joints = [joint.name for joint in capabilities.joints]
        driven = sorted(problem.motors.driven)
        carried: dict[str, int] = {}
        rigid = defaultdict[int, list[int]](list)
        for row, rule in enumerate(problem.parts):
            if rule.joint is not None:
                carried[joints[rule.joint]] = row
            elif rule.parent is not None:
                rigid[rule.parent].append(row)
        carried |= rigid_parts(path, carried, rigid)
        legs = true_limbs(path, {joints[motor]: motor for motor in driven}, problem.tables)
        rows = true_limbs(path, carried, problem.tables)
        check_robot(path, capabilities)
        return cls(
            rows=dict(zip(sorted(carried.values()), rows, strict=True)),
            legs=dict(zip(driven, legs, strict=True)),
        )


class Comparison:
    """A model beside the true body.

    Args:
        problem: The run's problem.
        genome: Genome of the problem on the run's robot.
        model: The model.
        truth: The true body.

    Attributes:
        true_body: The true body as the problem can best express it: capsules, with the true
            lengths.
        true_lengths: Length of each leg on the robot, m, in motor order; where parts that are rigid
            on it are compared, too, as they reach on ``true_body``.
    """

    def __init__(self, problem: Problem, genome: Genome, model: Morphology, truth: Truth):
        self._problem = problem
        self._genome = genome
        self._model = model
        self._rows = truth.rows
        self._impossible = {row: self._misfits(row, limb) for row, limb in truth.rows.items()}
        self.true_body = self._true_body(truth.legs)
        parts, groups = self.true_body.parts, self.true_body.rigid_groups
        rigid = {parts[groups[row]].motor for row in truth.rows if problem.parts[row].joint is None}
        self.true_lengths = tuple(
            limb.length if limb.motor in rigid else leg.limb.length
            for limb, leg in zip(driven_limbs(self.true_body), truth.legs.values(), strict=True)
        )

    @property
    def not_representable(self) -> tuple[str, ...]:
        """What no genome of the problem can have right, in sentences."""
        attached = (text for misfits in self._impossible.values() for text in misfits.values())
        return (*attached, *self._lengths_out_of_range())

    def configurations(
        self, indistinguishable: Indistinguishable | None = None
    ) -> tuple[Configuration, ...]:
        """All configurations, in the order of the genome.

        Args:
            indistinguishable: The test of equivalence; without it nothing wrong is right up to
                equivalence.
        """
        wrong = self._wrong(self.true_body)
        inexcusable = self._inexcusable(wrong, indistinguishable) if indistinguishable else wrong
        return tuple(
            self._configuration(cell, right=cell not in wrong, excused=cell not in inexcusable)
            for cell in self._cells()
        )

    def _cells(self) -> Iterator[Cell]:
        for row in sorted(self._rows):
            for trait in self._traits(row):
                yield row, trait

    def _traits(self, row: int) -> tuple[str, ...]:
        return TRAITS if self._problem.parts[row].motor is not None else TRAITS[:2]

    def _configuration(self, cell: Cell, *, right: bool, excused: bool) -> Configuration:
        row, trait = cell
        impossible = trait in self._impossible[row]
        true = self._value(self.true_body, cell)
        genes = [gene for gene in self._genome.genes if (gene.part, gene.trait) == cell]
        chance = self._chance(cell, true) if genes else float(right)
        return Configuration(
            part=self._problem.parts[row].name,
            trait=trait,
            modelled=self._value(self._model, cell),
            true=UNSAYABLE if impossible else true,
            searched=chance < 1 and bool(genes),
            chance=0.0 if impossible else chance,
            right=right,
            right_up_to_equivalence=excused,
        )

    def _value(self, body: Morphology, cell: Cell) -> str:
        """A configuration of a body; parents in terms of the rows that can be compared."""
        row, trait = cell
        if trait == "mount":
            return body.mount(row).name
        if trait == "hinge":
            return body.hinge(row).name
        parent = body.parts[row].parent
        while parent != BASE and parent not in self._rows:
            parent = body.parts[parent].parent
        return MAIN_BODY if parent == BASE else self._problem.parts[parent].name

    def _chance(self, cell: Cell, true: str) -> float:
        """Probability that a random model has the true value in a cell that is to be found."""
        row, trait = cell
        tables, rule = self._problem.tables, self._problem.parts[row]
        if trait == "parent":
            return 1 / (row + 1)
        if trait == "hinge":
            return 1 / tables.hinge_choices
        on_base = 1 / (row + 1) if rule.parent is None else float(rule.parent == BASE)
        shares = [names.count(true) / len(names) for names in map(tables.mount_names, (BASE, 0))]
        return on_base * shares[0] + (1 - on_base) * shares[1]

    def _misfits(self, row: int, true_limb: TrueLimb) -> dict[str, str]:
        """What no genome of the problem has right about a row, by trait."""
        misfits = {
            trait: sentence
            for trait, sentence in true_limb.not_representable.items()
            if trait in self._traits(row)
        }
        if true_limb.limb.parent > row:
            misfits["parent"] = f"{true_limb.name} sits on a part that comes later in the problem"
        return misfits

    def _wrong(self, reference: Morphology) -> set[Cell]:
        return {
            (row, trait)
            for row, trait in self._cells()
            if trait in self._impossible[row]
            or self._value(self._model, (row, trait)) != self._value(reference, (row, trait))
        }

    def _lengths_out_of_range(self) -> Iterator[str]:
        if len(self._rows) < len(self._problem.parts):
            return  # nobody knows how the true lengths are divided among the parts
        for row, true_limb in sorted(self._rows.items()):
            length, (shortest, longest) = true_limb.limb.length, self._problem.parts[row].length
            if not shortest - _SLIGHT <= length <= longest + _SLIGHT:
                yield (
                    f"{true_limb.name} carries a part of {1000 * length:.0f} mm, and the problem "
                    f"allows {1000 * shortest:.0f} to {1000 * longest:.0f} mm"
                )

    # --- up to equivalence ------------------------------------------------------------------------

    def _inexcusable(self, wrong: set[Cell], indistinguishable: Indistinguishable) -> set[Cell]:
        """Cells that are wrong even up to equivalence.

        Without tilt a square body feels the same however it is turned, and mirrored too. So the
        true body's images that cannot be told from it are as good as the truth, and the one that
        the model comes closest to counts.
        """
        impossible = {cell for cell in wrong if cell[1] in self._impossible[cell[0]]}
        fewest = wrong
        for image in images(self.true_body):
            if fewest == impossible:
                break
            if image == self.true_body or indistinguishable([image]):
                cells = self._wrong(image)
                fewest = min(
                    fewest, cells - self._excused(image, cells, indistinguishable), key=len
                )
        return fewest

    def _excused(
        self, reference: Morphology, wrong: Collection[Cell], indistinguishable: Indistinguishable
    ) -> set[Cell]:
        """Cells whose wrong values, all together, make a body that is like the truth."""
        cells = [cell for cell in wrong if cell[1] not in self._impossible[cell[0]]]
        lengths = [part.length for part in self._model.parts]
        trials = [
            set(cells),
            *({cell for cell in cells if cell[1] == trait} for trait in TRAITS),
            *({cell for cell in cells if cell[0] == row} for row in sorted(self._rows)),
            *({cell} for cell in sorted(cells)),
        ]
        excused: set[Cell] = set()
        refused: list[set[Cell]] = []
        for trial in trials:
            candidate = excused | trial
            if candidate == excused or candidate in refused:
                continue
            body = self._variant(reference, candidate)
            if indistinguishable([body, body.with_lengths(lengths)]):
                excused = candidate
            else:
                refused.append(candidate)
        return excused

    def _variant(self, reference: Morphology, kept: Collection[Cell]) -> Morphology:
        """The reference with the model's values in some cells."""
        parts = list(reference.parts)
        for row in {row for row, _ in kept}:
            model_part = self._model.parts[row]
            if (row, "hinge") in kept:
                parts[row] = replace(parts[row], hinge=model_part.hinge)
            parent = (self._model if (row, "parent") in kept else reference).parts[row].parent
            bodies = [reference, self._model]
            mount = self._mount(row, parent, bodies[:: -1 if (row, "mount") in kept else 1])
            parts[row] = replace(parts[row], parent=parent, mount=mount)
        return self._genome.assemble(parts)

    def _mount(self, row: int, parent: int, bodies: Sequence[Morphology]) -> int:
        """Number of a part's mount: the first body's, by name; the second's if that is lacking.

        On the main body there may be other mounts than on parts.
        """
        body, fallback = bodies
        mounts = body.base.mounts if parent == BASE else body.part_mounts
        names = [mount.name for mount in mounts]
        name = body.mount(row).name
        return names.index(name) if name in names else fallback.parts[row].mount

    # --- the truth in the problem's words ---------------------------------------------------------

    def _true_body(self, legs: Mapping[int, TrueLimb]) -> Morphology:
        parts = list(self._model.parts)
        for row, true_limb in self._rows.items():
            parts[row] = replace(parts[row], hinge=true_limb.hinge)
            if "parent" not in self._impossible[row]:
                parts[row] = replace(
                    parts[row], parent=true_limb.limb.parent, mount=true_limb.mount
                )
            elif (parts[row].parent == BASE) == (true_limb.limb.parent == BASE):
                parts[row] = replace(parts[row], mount=true_limb.mount)
        body = self._genome.assemble(parts)
        return body.with_lengths(_true_lengths(body, self._rows, legs))


def _true_lengths(
    body: Morphology, rows: Mapping[int, TrueLimb], legs: Mapping[int, TrueLimb]
) -> list[float]:
    """True lengths of parts, or, in a leg of which not all parts are known, scaled ones, m.

    A leg that is scaled reaches as far as the true one.
    """
    by_motor: dict[int | None, Limb] = {limb.motor: limb for limb in limbs(body)}
    lengths = [part.length for part in body.parts]
    divided = {root for row, root in enumerate(body.rigid_groups) if row not in rows}
    for row, root in enumerate(body.rigid_groups):
        motor = body.parts[root].motor
        if root not in divided:
            lengths[row] = rows[row].limb.length
        elif motor is not None and motor in legs:
            lengths[row] *= legs[motor].limb.length / by_motor[motor].length
    return lengths
