"""Touch sensors on the parts that carry no other part, in the parts' order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.body.arrays import Integers
from estimator.body.morphology import Part


def with_outermost_sensors(parts: Sequence[Part], sensors: int) -> list[Part]:
    """Parts with so many touch sensors on those of them that carry no other; see ``Problem``."""
    carriers = {part.parent for part in parts}
    chosen = sorted(range(len(parts)), key=lambda index: (index in carriers, index))[:sensors]
    numbers = {index: number for number, index in enumerate(sorted(chosen))}
    return [replace(part, sensor=numbers.get(index)) for index, part in enumerate(parts)]


def outermost_sensors(parent: Integers, sensors: int) -> Integers:
    """The same for n bodies: sensor of each part, or −1, shape (n, parts)."""
    rows, parts = parent.shape
    carriers = np.zeros((rows, parts + 1), dtype=bool)  # the main body's, −1, in the last column
    carriers[np.arange(rows)[:, None], parent] = True
    carriers = carriers[:, :parts]
    outermost = np.cumsum(~carriers, axis=1)
    place = np.where(carriers, outermost[:, -1:] + np.cumsum(carriers, axis=1), outermost)
    chosen = place <= sensors
    return np.where(chosen, np.cumsum(chosen, axis=1) - 1, -1)
