"""Samples that go on from the sets of attachments that were weighed to those that nobody has met.

Where few readings leave many sets of attachments, a search meets part of them only: more of those
that hold a leg fast than of the many ways in which a leg may be attached that touches nothing. So
samples of what was met know too much. Chains that begin with them leave the posterior as it is, and
go to the others as often as these deserve.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.body.morphology import Array
from estimator.posterior.discovery.population import Population
from estimator.posterior.model.unknowns import Attachments, Unknowns
from estimator.posterior.sampling.weighing import WeighedModes


def mixed(modes: WeighedModes, chains: Population, unknowns: Unknowns, steps: int) -> WeighedModes:
    """The modes with those that chains have gone on to, and the points where they are then.

    Of those the effective number is that of their chains, and the draws are where these are.

    Args:
        modes: That were weighed.
        chains: On one level, at the modes' ``values``; they are moved.
        unknowns: The cube.
        steps: Of the chains.
    """
    for _ in range(steps):
        chains.step()
    values, fits = chains.values, chains.posterior_fits(1)
    weighed, others = set(unknowns.keys(modes.points)), dict[Attachments, list[int]]()
    for row, key in enumerate(unknowns.keys(values)):
        if key not in weighed:
            others.setdefault(key, []).append(row)
    modes = replace(modes, values=values)
    if not others:
        return modes
    behind = np.array([float(len(rows)) for rows in others.values()])
    left = behind.sum() / len(values)
    best = [max(rows, key=fits.__getitem__) for rows in others.values()]
    return replace(
        modes,
        points=np.concatenate([modes.points, values[best]]),
        shares=np.concatenate([(1 - left) * modes.shares, left * _shares(behind)]),
        ess=np.concatenate([modes.ess, behind]),
        draws=[*modes.draws, *(values[rows] for rows in others.values())],
    )


def _shares(counts: Array) -> Array:
    """Shares of sets with so many chains in them, shape (n,).

    A set has for sure what lies two standard deviations below its count; all else belongs to any.
    Else one of many that are as good would lead by chance.
    """
    sure = np.maximum(counts - 2 * np.sqrt(counts), 0.0)
    shares: Array = (sure + (counts - sure).mean()) / counts.sum()
    return shares
