"""The formats by name, and a body of a problem in one of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from estimator.body.morphology import Morphology
from estimator.export.description import Description, describe
from estimator.export.mjcf import mjcf
from estimator.export.urdf import urdf
from estimator.problem.problem import Problem
from protocol.wire.capabilities import Capabilities


def as_json(body: Description) -> str:
    """The fields of ``Description``."""
    return json.dumps(asdict(body), indent=2) + "\n"


class Format(StrEnum):
    """What a body can be written as."""

    URDF = "urdf"
    MJCF = "mjcf"
    JSON = "json"


FORMATS: Final[Mapping[Format, Callable[[Description], str]]] = MappingProxyType(
    {Format.URDF: urdf, Format.MJCF: mjcf, Format.JSON: as_json}
)


def in_words_of(problem: Problem, robot: Capabilities, body: Morphology) -> Description:
    """Describes a body with the problem's names for parts and the robot's for joints."""
    return describe(
        body,
        robot=robot.robot,
        parts=[rule.name for rule in problem.parts],
        carried=[rule.joint for rule in problem.parts],
        joints=robot.joints,
    )
