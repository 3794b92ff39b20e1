"""How often load and distance disagree on whether a foot touches the ground.

    python -m tests.sim_robot.touch_rules [--programs N]

A gauge measures load, a model measures a gap. Prints a row of figures for each body that ships.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from protocol.wire.readings import touch_is_doubtful, touches
from sim_robot.world.body import Body, load_body, shipped_bodies
from sim_robot.world.simulation import open_world

LOADED = 0.1  # N: above it, a gauge says touch
REACH = 30.0  # degrees
REST = 4.0  # s

QUADRUPED_JOINTS = 8  # of which the knees stay straight


@dataclass(frozen=True)
class Foot:
    """One touch sensor in one resting pose."""

    load: float
    gap: float

    @property
    def disputed(self) -> bool:
        return (self.load > LOADED) != touches(self.gap)

    @property
    def doubtful(self) -> bool:
        return touch_is_doubtful(self.gap)


def feet(body: Body, programs: int, seed: int = 1) -> Iterator[Foot]:
    """Every foot in the resting poses of random motor programs."""
    rng = np.random.default_rng(seed)
    joints = len(body.motors)
    with open_world(body, log=logging.getLogger("touch")) as world:
        for _ in range(programs):
            world.set_targets([0.0] * joints)
            world.lay_down()
            pose = np.radians(rng.uniform(-REACH, REACH, joints))
            if joints == QUADRUPED_JOINTS:
                pose[4:] = 0.0
            world.set_targets([float(angle) for angle in pose])
            world.advance_to(world.steps / 240 + REST)
            for load, gap in zip(world.loads(), world.gaps(), strict=True):
                yield Foot(load, gap)


def main() -> None:
    parser = argparse.ArgumentParser(description="Touch by load against touch by distance.")
    parser.add_argument("--programs", type=int, default=250, help="for each body")
    options = parser.parse_args()
    print("| body | feet | touching | the rules disagree | gap of 0 to 2 mm |")
    print("| --- | --- | --- | --- | --- |")
    for name, path in shipped_bodies().items():
        all_feet = list(feet(load_body(path), options.programs))
        counts = (
            sum(foot.load > LOADED for foot in all_feet),
            sum(foot.disputed for foot in all_feet),
            sum(foot.doubtful for foot in all_feet),
        )
        shares = (f"{count} ({100 * count / len(all_feet):.1f} %)" for count in counts)
        print(f"| {name} | {len(all_feet):,} | {' | '.join(shares)} |", flush=True)


if __name__ == "__main__":
    main()
