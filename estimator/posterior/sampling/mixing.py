"""Samples that go on from the sets of attachments that were weighed to those that nobody has met.

Where few readings leave many sets of attachments, a search meets part of them only: more of those
that hold a leg fast than of the many ways in which a leg may be attached that touches nothing. So
samples of what was met know too much. Chains that begin with them leave the posterior as it is, and
go to the others as often as these deserve.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.posterior.discovery.population import Population
from estimator.posterior.model.unknowns import Attachments, Unknowns
from estimator.posterior.sampling.weighing import WeighedModes


def mixed(modes: WeighedModes, chains: Population, unknowns: Unknowns, steps: int) -> WeighedModes:
    """The modes with those that chains went on to, and the points where they are then.

    What the chains have spent on others after half of the steps is the others' share.

    Args:
        modes: That were weighed.
        chains: On one level, at the modes' ``values``; they are moved.
        unknowns: The cube.
        steps: Of the chains.
    """
    values, _, fits = (array[len(array) // 2 :] for array in chains.sample(steps))
    weighed, last = set(unknowns.keys(modes.points)), set(unknowns.keys(chains.values))
    gone, others = 0, dict[Attachments, list[int]]()
    for row, key in enumerate(unknowns.keys(values)):
        gone += key not in weighed
        if key in last - weighed:
            others.setdefault(key, []).append(row)
    modes = replace(modes, values=chains.values)
    if not others:
        return modes
    left, behind = gone / len(values), np.array([float(len(rows)) for rows in others.values()])
    best = [max(rows, key=fits.__getitem__) for rows in others.values()]
    return replace(
        modes,
        points=np.concatenate([modes.points, values[best]]),
        shares=np.concatenate([(1 - left) * modes.shares, left * behind / behind.sum()]),
        ess=np.concatenate([modes.ess, behind]),
        draws=[*modes.draws, *(values[rows] for rows in others.values())],
    )
