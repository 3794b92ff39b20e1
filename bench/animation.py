"""``make animation``: the README's moving picture, of a body being found.

On the left is the simulated robot in the pose of each interaction, on the right, in the same pose,
bodies of the posterior after it, as often as they are probable.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from bench.daemons import simulator
from estimator.evaluation.truth.urdf import read_urdf
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.posterior import systematic
from estimator.report.camera import HEIGHT, WIDTH, reach, take_picture
from estimator.report.scene import Solid, at_rest, model_links, robot_links, solids_of
from estimator.report.shown_bodies import observation_of
from estimator.reproduction.robot_process import print_body
from estimator.storage.store import RunStore

FILE: Final = Path(__file__).parents[1] / "docs" / "images" / "identified.gif"
_BODIES: Final = 5  # after each interaction
_SHOWN: Final = 450  # ms that a frame is shown
_LAST_SHOWN: Final = 2500  # ms that the last frame is shown
_COLOURS: Final = 64
_INK: Final = (40, 45, 55)
_MOST_BYTES: Final = 2_000_000  # bytes of the file


def main() -> None:
    """Identifies a simulated robot and writes the picture."""
    with TemporaryDirectory() as name, simulator("--seed", "1") as robot:
        run, truth = Path(name) / "run", Path(name) / "truth.urdf"
        truth.write_text(print_body(), encoding="utf-8")
        options = ("--problem", "topological", "--interactions", "6", "--seed", "1", "--out", run)
        subprocess.run(["estimator", "identify", "--robot", robot.uri, *options], check=True)
        with RunStore.open(run, to_write=False) as store:
            pictures = list(frames(store, truth))
    first, *others = (picture.quantize(_COLOURS) for picture in pictures)
    times = [_SHOWN] * len(others) + [_LAST_SHOWN]
    first.save(FILE, save_all=True, append_images=others, duration=times, loop=0, optimize=True)
    size = FILE.stat().st_size
    print(f"{FILE}: {len(pictures)} frames, {size / 1e6:.2f} MB")
    assert size < _MOST_BYTES


def frames(store: RunStore, truth: Path) -> Iterator[Image.Image]:
    """All frames, interaction after interaction."""
    joints = [joint.name for joint in store.capabilities.joints]
    links = robot_links(read_urdf(truth), joints, store.problem.motors.driven)
    radius = 0.0
    for number, fitted in enumerate(FittedPosterior.history(store), 1):
        observed = fitted.observations[-1]
        robot = at_rest(solids_of(links, observed.angles), observed)
        radius = radius or 1.25 * reach(robot)
        sure = "" if fitted.probability is None else f", {100 * fitted.probability:.0f} % sure"
        belief = f"what it believes after movement {number}{sure}"
        for body in _believed(fitted):
            yield _side_by_side(("the robot", robot), (belief, body), radius=radius)


def _believed(fitted: FittedPosterior) -> Iterator[list[Solid]]:
    """Solids of some bodies of the posterior, in the pose of the last interaction."""
    observed = fitted.observations[-1]
    readings = fitted.predict(np.array(observed.angles))
    rows = systematic(fitted.weights, _BODIES, 0.5)
    for row, body in zip(rows, fitted.genome.decode_all(fitted.samples[rows]), strict=True):
        predicted = observation_of(readings, int(row), observed.angles)
        yield at_rest(solids_of(model_links(body), observed.angles), predicted)


def _side_by_side(*scenes: tuple[str, list[Solid]], radius: float) -> Image.Image:
    picture = Image.new("RGB", (len(scenes) * WIDTH, HEIGHT))
    for place, (title, solids) in enumerate(scenes):
        picture.paste(Image.fromarray(take_picture(solids, radius)), (place * WIDTH, 0))
        ImageDraw.Draw(picture).text((place * WIDTH + 12, 10), title, fill=_INK, font_size=16)
    return picture


if __name__ == "__main__":
    main()
