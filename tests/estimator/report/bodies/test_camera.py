from __future__ import annotations

import numpy as np
import pytest

from estimator.body.morphology import BASE, Base, Morphology, Part
from estimator.report.bodies.camera import (
    HEIGHT,
    WIDTH,
    Picture,
    reach,
    take_picture,
)
from estimator.report.bodies.jointed_body import model_links
from estimator.report.bodies.scene import Solid, at_rest, solids_of


def scene(length: float) -> list[Solid]:
    """A body whose only leg points ahead, towards the camera's right."""
    part = Part(parent=BASE, mount=1, hinge=2, length=length, radius=0.01, motor=0)
    body = Morphology(base=Base(size=(0.14, 0.14, 0.085), mass=1.0), parts=(part,), density=1e3)
    return at_rest(solids_of(model_links(body), [0.3]), None)


def blue(picture: Picture) -> np.ndarray:
    """Pixels in the colour of motor 1."""
    red, green, light = (picture[..., channel].astype(int) for channel in range(3))
    pixels: np.ndarray = (light > red + 60) & (light > green + 20)
    return pixels


def test_the_same_camera_shows_a_longer_leg_longer() -> None:
    long = scene(0.3)
    radius = reach(long)
    assert radius == pytest.approx(0.07 + 0.3, abs=0.03)
    pictures = [take_picture(item, radius) for item in (scene(0.15), long)]
    assert all(picture.shape == (HEIGHT, WIDTH, 3) for picture in pictures)
    short_pixels, long_pixels = (int(np.sum(blue(picture))) for picture in pictures)
    assert long_pixels > 1.5 * short_pixels > 50
    edges = np.concatenate(
        [blue(pictures[1])[[0, -1]].ravel(), blue(pictures[1])[:, [0, -1]].ravel()]
    )
    assert not edges.any()  # all of it is in the picture


def test_pictures_repeat() -> None:
    assert np.array_equal(take_picture(scene(0.2), 0.4), take_picture(scene(0.2), 0.4))
