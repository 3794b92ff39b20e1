"""The list of all trials, by group: each group is a table."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

from bench.power.built import BUILT, built_trials
from bench.power.faults import fault_trials, odd_trials
from bench.power.robots import BODIES, Robot
from bench.power.trial import Trial, as_stated
from bench.prior_bodies import drawn_body

REPORTED: Final = "reported"
SEEDS: Final[Mapping[str, tuple[int, ...]]] = {
    REPORTED: tuple(range(1000, 1030)),
    "development": tuple(range(30)),
}

KNOWN_ATTACHMENTS: Final = "lengths"
"""The group whose runs have no attachments to be unsure of."""

FAULTY: Final = ("faults", "odd robots")
"""Groups whose robots are not as their problem says."""

SUBJECTS: Final[Mapping[str, str]] = {
    "whole body": "The problem `topological` on the default robot: nothing is known but the number "
    "of legs and their\nthickness. *As stated*: all else is taken to be just as the problem says "
    "(`exact = true`).",
    KNOWN_ATTACHMENTS: "The problem `parametric`: how the parts hang together is known. *As "
    "stated* as above.",
    "eight parts": "The problems `topological-20` and `-24` on the default robot.",
    "other bodies": "`topological` on robots that differ from the default one, and from any model.",
    "another engine": "`topological` on the default robot in MuJoCo's world, which shares "
    "nothing with the models: its\ncontacts are soft, and another solver finds the forces.",
    "prior bodies": "`topological` on robots that were drawn from its prior.",
    "faults": "Robots that are not as their problem says. *Certain and wrong*: the run finds that "
    "a body explains the\nreadings, states at least 0.95, and an attachment is wrong, or a length "
    "by more than 10 mm and outside\nits own 90 % interval. Where no sensor can tell a fault from "
    "another body, as with sides unknown (a\nreversed tilt, or exchanged tilts, from a mirrored "
    "body, swapped servos from swapped legs), that body counts as\nright.",
    BUILT: "Robots that are built otherwise than their problem says, by what the estimator has a "
    "table of parameters\nfor. *Owned*: the run stands by its body. *Half-width*: mean, of 90 % "
    "intervals of lengths: as robots are\nbuilt; if just as stated. *Named*: the cause is said "
    "first, or is one of two that are. *Amount*: its 90 %\ninterval holds the true one.",
    "odd robots": "Robots with something wrong that no check was made for, thought of to find runs "
    "that are\ntaken in; some of it begins on the way. *Certain and wrong* as above.",
}
"""What each group is about."""

PICTURES: Final[Mapping[str, str]] = {
    "whole body": "success.png",
    "eight parts": "success-eight-parts.png",
}
"""Files under ``docs/images`` that show how often the body is found, by group."""

Groups = Mapping[str, tuple[Trial, ...]]


def study(seeds: tuple[int, ...]) -> Groups:
    """All trials, by group.

    Args:
        seeds: Thirty seeds. Some trials take the first few of them.
    """
    ten, four = seeds[:10], seeds[:4]
    in_mujoco = Robot(options=("--engine", "mujoco"))
    return {
        "whole body": (
            Trial(name="posterior, information", seeds=seeds),
            Trial(name="posterior, as stated", seeds=seeds, problem=as_stated("topological")),
            Trial(name="posterior, disagreement", seeds=four, explore="disagreement"),
            Trial(name="posterior, random", seeds=four, explore="random"),
            Trial(name="paper", seeds=seeds, method="paper", interactions=9),
        ),
        KNOWN_ATTACHMENTS: (
            Trial(name="posterior, information", seeds=seeds, problem="parametric", interactions=4),
            Trial(
                name="posterior, as stated",
                seeds=seeds,
                problem=as_stated("parametric"),
                interactions=4,
            ),
            Trial(
                name="posterior, random",
                seeds=four,
                problem="parametric",
                interactions=4,
                explore="random",
            ),
            Trial(name="paper", seeds=seeds, problem="parametric", method="paper", interactions=4),
        ),
        "faults": fault_trials(seeds[:2]),
        "odd robots": odd_trials(seeds[:1]),
        BUILT: built_trials(seeds),
        "other bodies": tuple(
            Trial(name=name, seeds=seeds[:1], robot=Robot(body=body), interactions=9)
            for name, body in BODIES.items()
        ),
        "another engine": (
            Trial(name="posterior, MuJoCo", seeds=ten, robot=in_mujoco, interactions=9),
            Trial(name="paper, MuJoCo", seeds=ten, method="paper", robot=in_mujoco, interactions=9),
        ),
        "prior bodies": (
            Trial(
                name="topological",
                seeds=seeds,
                robot=Robot(body=partial(drawn_body, "topological")),
            ),
        ),
        "eight parts": (
            Trial(name="topological-20", seeds=ten, problem="topological-20", interactions=16),
            Trial(name="topological-24", seeds=ten, problem="topological-24", interactions=16),
        ),
    }
