"""Where parts go that would sit on a mount which another part has already."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from estimator.body.morphology import BASE
from estimator.problem.problem import Problem

Place: TypeAlias = tuple[int, int]
"""Parent and mount."""


def spread(problem: Problem, wanted: Sequence[Place]) -> list[Place]:
    """Places for all parts with no two on one mount, as far as there are free ones.

    Parts that are known to sit somewhere keep their places; earlier ones go before later ones. Each
    that finds its mount taken goes to the next free one of its parent, or else of another.

    Args:
        problem: Says where each part may sit.
        wanted: Where each part would sit.
    """
    rules = problem.parts
    fixed = [rule.parent is not None and rule.mount is not None for rule in rules]
    taken = {place for place, stays in zip(wanted, fixed, strict=True) if stays}
    places = list(wanted)
    for part, (parent, mount) in enumerate(wanted):
        if fixed[part]:
            continue
        free = [place for place in _possible(problem, part) if place not in taken]
        after = [place for place in free if place[0] == parent and place[1] >= mount]
        places[part] = min(
            after or [place for place in free if place[0] == parent] or free,
            default=(parent, mount),
        )
        taken.add(places[part])
    return places


def _possible(problem: Problem, part: int) -> list[Place]:
    known, tables = problem.parts[part].parent, problem.tables
    places = []
    for parent in range(BASE, part) if known is None else [known]:
        mount = tables.attached[part].mount(parent)
        count = len(tables.mount_names(parent))
        places += [(parent, one) for one in (range(count) if mount is None else [mount])]
    return places
