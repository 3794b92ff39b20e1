"""The modalities by name, in their usual order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from estimator.errors import EstimatorError
from estimator.readings.modalities.base import Modality
from estimator.readings.modalities.clearance import Clearance
from estimator.readings.modalities.tilt import Tilt
from estimator.readings.modalities.touch import Touch

MODALITIES: Final[Mapping[str, Modality]] = MappingProxyType(
    {modality.name: modality for modality in (Touch(), Tilt(), Clearance())}
)
"""Terms are added up in this order, so it decides about last digits."""


def check_modalities(names: Sequence[str]) -> tuple[str, ...]:
    """The modalities in their usual order.

    Raises:
        EstimatorError: One is unknown, or there is none.
    """
    unknown = sorted(set(names) - set(MODALITIES))
    if unknown or not names:
        raise EstimatorError(
            f"modalities must be one or more of {', '.join(MODALITIES)}, "
            f"not {', '.join(unknown) or 'none'}"
        )
    return tuple(name for name in MODALITIES if name in names)
