"""Pictures of scenes without a screen, by PyBullet's software renderer."""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import Array
from estimator.errors import EstimatorError
from estimator.report.bodies.jointed_body import MAIN_BODY
from estimator.report.bodies.scene import Solid
from estimator.report.plots.leg_styles import leg_colour
from protocol.system.native_output import native_output_discarded

WIDTH: Final = 480
HEIGHT: Final = 360
_FINER: Final = 2  # pixels rendered for each pixel shown, along either side
_VIEW: Final = 26.0  # degrees, from top to bottom
_FROM: Final = (0.80, -0.50, 0.45)  # towards the camera; ahead of the robot and to its right
_LIGHT: Final = (0.5, -0.7, 1.5)
_LIGHT_DISTANCE: Final = 4.0
_DEPTHS: Final = (0.05, 5.0)  # m, nearest and farthest
_RADIUS: Final = 0.4
"""Scenes are scaled to this size, m: shadows come out right for few combinations of lens and light,
and these belong together."""
_GROUND_COLOUR: Final = (0.93, 0.93, 0.90, 1.0)
_LINE_SHADE: Final = 0.86
_LINE_WIDTH: Final = 0.004  # m
_BODY: Final = (0.36, 0.41, 0.50, 1.0)
_NOTHING: Final = -1  # what a pixel sees that looks past everything
_CLEAR: Final = 2.5
"""Beyond so many radii the ground is plain: the shadow map does not reach farther."""
_SAMPLED: Final = 37  # every so many pixels of the ground tell its colour
_MESH: Final = 0.1
"""Lines on the ground, m apart, so that lengths can be read off."""

_GROUND: Final = Solid(
    kind="box",
    size=(3.0, 3.0, 0.02),
    turn=np.eye(3),
    place=np.array([0.0, 0.0, -0.01]),
    limb=MAIN_BODY,
)

Picture = NDArray[np.uint8]


def reach(solids: Sequence[Solid]) -> float:
    """How far a scene extends from the middle of its main body, m."""
    middle = next(item.place for item in solids if item.limb == MAIN_BODY)
    return max(float(np.linalg.norm(item.place - middle)) + max(item.size) / 2 for item in solids)


def take_picture(solids: Sequence[Solid], radius: float) -> Picture:
    """Renders a scene, seen from where a sphere around the main body fills the picture.

    Args:
        solids: In the world, m.
        radius: Of that sphere, m: the same for scenes that are to be compared.

    Returns:
        Red, green and blue, shape (``HEIGHT``, ``WIDTH``, 3).
    """
    scale = _RADIUS / radius
    scaled = [
        replace(item, size=tuple(scale * edge for edge in item.size), place=scale * item.place)
        for item in sorted(solids, key=lambda item: item.limb != MAIN_BODY)
    ]
    with native_output_discarded():
        try:
            engine: Any = importlib.import_module("pybullet")
        except ImportError as error:
            raise EstimatorError(
                f"pictures are taken with PyBullet, which cannot be imported ({error}): take them "
                "with Python 3.11"
            ) from error
        client = engine.connect(engine.DIRECT)
        try:
            ground = _add(engine, client, _GROUND, _GROUND_COLOUR)
            for item in scaled:
                _add(engine, client, item, _colour(item.limb))
            fine = _render(engine, client, ground, scaled[0].place, scale)
        finally:
            engine.disconnect(physicsClientId=client)
    blocks = fine.reshape(HEIGHT, _FINER, WIDTH, _FINER, 3)
    picture: Picture = blocks.mean(axis=(1, 3)).astype(np.uint8)
    return picture


def _render(engine: Any, client: int, ground: int, middle: Array, scale: float) -> Array:
    """Pixels, shape (height, width, 3)."""
    distance = _RADIUS / math.sin(math.radians(_VIEW / 2))
    target = np.array([middle[0], middle[1], 0.05])
    eye = target + distance * np.array(_FROM) / np.linalg.norm(_FROM)
    view = engine.computeViewMatrix(eye.tolist(), target.tolist(), (0, 0, 1))
    projection = engine.computeProjectionMatrixFOV(_VIEW, WIDTH / HEIGHT, *_DEPTHS)
    _, _, pixels, _, seen = engine.getCameraImage(
        WIDTH * _FINER,
        HEIGHT * _FINER,
        view,
        projection,
        lightDirection=_LIGHT,
        lightDistance=_LIGHT_DISTANCE,
        shadow=1,
        renderer=engine.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    shape = (HEIGHT * _FINER, WIDTH * _FINER)
    image: Array = np.reshape(np.array(pixels, dtype=float), (*shape, 4))[..., :3]
    place = _places(np.reshape(view, (4, 4)).T, np.reshape(projection, (4, 4)).T)
    bare = np.isin(np.reshape(seen, shape), (ground, _NOTHING))
    near = np.linalg.norm(place - middle[:2], axis=-1) < _CLEAR * _RADIUS
    image[bare & ~near] = np.median(image[bare & near][::_SAMPLED], axis=0)
    off = np.abs(place / (_MESH * scale) - np.round(place / (_MESH * scale))) * _MESH * scale
    image[bare & near & np.any(off < _LINE_WIDTH / 2, axis=-1)] *= _LINE_SHADE
    return image


def _places(view: Array, projection: Array) -> Array:
    """Where on the ground each pixel looks, m, shape (height, width, 2).

    What looks up is told a place behind the camera.
    """
    right = (np.arange(WIDTH * _FINER) + 0.5) / (WIDTH * _FINER) * 2 - 1
    above = 1 - (np.arange(HEIGHT * _FINER) + 0.5) / (HEIGHT * _FINER) * 2
    ground = np.linalg.inv((projection @ view)[np.ix_((0, 1, 3), (0, 1, 3))])  # of the plane z = 0
    x, y, scale = ((row[0] * right + row[2]) + row[1] * above[:, None] for row in ground)
    places: Array = np.stack([x, y], axis=-1) / scale[..., None]
    return places


def _add(engine: Any, client: int, item: Solid, colour: tuple[float, ...]) -> int:
    size: dict[str, Any]
    if item.kind == "box":
        kind, size = engine.GEOM_BOX, {"halfExtents": [extent / 2 for extent in item.size]}
    elif item.kind == "cylinder":
        kind, size = engine.GEOM_CYLINDER, {"radius": item.size[0], "length": item.size[1]}
    else:
        kind, size = engine.GEOM_SPHERE, {"radius": item.size[0]}
    shape = engine.createVisualShape(kind, rgbaColor=colour, physicsClientId=client, **size)
    number: int = engine.createMultiBody(
        0, -1, shape, item.place.tolist(), _quaternion(item.turn), physicsClientId=client
    )
    return number


def _colour(limb: int) -> tuple[float, ...]:
    if limb == MAIN_BODY:
        return _BODY
    text = leg_colour(limb)
    return (*(int(text[start : start + 2], 16) / 255 for start in (1, 3, 5)), 1.0)


def _quaternion(turn: Array) -> tuple[float, float, float, float]:
    """A rotation as x, y, z, w; the largest component is computed first, so none is lost."""
    squares = np.array(
        [
            1 + turn[0, 0] - turn[1, 1] - turn[2, 2],
            1 - turn[0, 0] + turn[1, 1] - turn[2, 2],
            1 - turn[0, 0] - turn[1, 1] + turn[2, 2],
            1 + turn[0, 0] + turn[1, 1] + turn[2, 2],
        ]
    )
    sums = np.array(
        [
            [0, turn[0, 1] + turn[1, 0], turn[0, 2] + turn[2, 0], turn[2, 1] - turn[1, 2]],
            [0, 0, turn[1, 2] + turn[2, 1], turn[0, 2] - turn[2, 0]],
            [0, 0, 0, turn[1, 0] - turn[0, 1]],
            [0, 0, 0, 0],
        ]
    )
    largest = int(np.argmax(squares))
    row = (sums + sums.T)[largest]
    row[largest] = squares[largest]
    x, y, z, w = (row / np.linalg.norm(row)).tolist()
    return x, y, z, w
