"""What is believed of the body: samples, and the sets of attachments that they choose among."""

from __future__ import annotations

from dataclasses import dataclass

from estimator.body.morphology import Array
from estimator.posterior.model.unknowns import Attachments


@dataclass(frozen=True)
class Mode:
    """One set of attachments.

    Attributes:
        attachments: What it chooses.
        probability: Share of the posterior.
        point: Its best point of the cube, shape (size,).
        effective: Effective number of draws behind the probability.
    """

    attachments: Attachments
    probability: float
    point: Array
    effective: float


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """Weighted samples, and the modes in order.

    Attributes:
        values: Points of the cube, shape (n, size).
        scales: Logarithms of the noise factors on tilt and clearance, shape (n, 2).
        weights: Of the samples, adding up to 1, shape (n,).
        modes: The most probable first.
        seen: Estimated share of the posterior that the search has seen: no probability is stated
            that is larger.
    """

    values: Array
    scales: Array
    weights: Array
    modes: tuple[Mode, ...]
    seen: float
