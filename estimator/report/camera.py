"""Pictures of scenes without a screen, drawn by Matplotlib: shaded faces, the farthest first."""

from __future__ import annotations

import importlib
import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from estimator.body.morphology import Array
from estimator.report.canvas import DPI, leg_colour, leg_patches, new_figure
from estimator.report.scene import MAIN_BODY, Solid
from estimator.report.shown_bodies import ShownBody
from protocol.text import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH: Final = 480
HEIGHT: Final = 360
_ELEVATION, _AZIMUTH = 30.0, -32.0  # degrees, towards the camera: ahead of the robot, to its right
_FOCAL_LENGTH: Final = 4.0  # in half-widths of what is seen: hardly any perspective
_ZOOM: Final = 1.3  # the sphere around the main body fills the height
_LIGHT: Final = np.array([0.28, -0.39, 0.88])
_AMBIENT: Final = 0.55  # share of the light that comes from everywhere
_GROUND_COLOUR: Final = (0.93, 0.93, 0.90)
_SHADE: Final = 0.86  # brightness of shadows and lines on the ground, relative to the ground's
_LINE_DISTANCE: Final = 0.1
"""Distance between the lines on the ground, m; lengths can be read off them."""
_GROUND_RADII: Final = 3.0  # ground that is drawn on either side, in radii
_BODY_COLOUR: Final = (0.36, 0.41, 0.50)
_AROUND: Final = 20  # faces around a cylinder or a sphere
_ALONG: Final = 6  # faces along a box's edge or cylinder: small ones are sorted by distance rightly

Picture = NDArray[np.uint8]


def reach(solids: Sequence[Solid]) -> float:
    """How far a scene extends from the middle of its main body, m."""
    middle = next(item.place for item in solids if item.limb == MAIN_BODY)
    return max(float(np.linalg.norm(item.place - middle)) + max(item.size) / 2 for item in solids)


def take_picture(solids: Sequence[Solid], radius: float) -> Picture:
    """Renders a scene, seen from where a sphere around the main body fills the picture.

    Args:
        solids: Solids of the scene, in the world's frame, m.
        radius: Radius of that sphere, m: the same for scenes that are to be compared.

    Returns:
        Red, green and blue of each pixel, shape (``HEIGHT``, ``WIDTH``, 3).
    """
    figure = new_figure(WIDTH / DPI, HEIGHT / DPI)
    figure.set_layout_engine("none")  # its one panel fills the figure
    figure.set_facecolor(_GROUND_COLOUR)
    canvas = importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    square = (0, (1 - WIDTH / HEIGHT) / 2, 1, WIDTH / HEIGHT)  # as wide as the picture
    axes: Any = figure.add_axes(square, projection="3d", computed_zorder=False)
    middle = next(solid.place for solid in solids if solid.limb == MAIN_BODY).copy()
    top = max(solid.place[2] + max(solid.size) / 2 for solid in solids)
    middle[2] = top / 2  # so that a tall body is in the picture from head to feet
    _aim(axes, middle, radius)
    faces, colours = _shaded(solids)
    art3d = importlib.import_module("mpl_toolkits.mplot3d.art3d")
    dark = tuple(_SHADE * channel for channel in _GROUND_COLOUR)
    # Along the light onto the ground; the same colour everywhere, so shadows do not add up.
    shadows = faces - faces[..., 2:] * (_LIGHT / _LIGHT[2])
    axes.add_collection3d(art3d.Line3DCollection(_mesh(radius), colors=[dark], linewidths=0.8))
    axes.add_collection3d(art3d.Poly3DCollection(shadows, facecolors=[dark], edgecolors=[dark]))
    axes.add_collection3d(
        art3d.Poly3DCollection(faces, facecolors=colours, edgecolors=colours, linewidths=0.4)
    )
    for order, collection in enumerate(axes.collections):
        collection.set_zorder(order)
    canvas.draw()
    picture: Picture = np.array(canvas.buffer_rgba())[..., :3].copy()
    return picture


def _aim(axes: Any, middle: Array, radius: float) -> None:
    for name, centre in zip("xyz", middle.tolist(), strict=True):
        getattr(axes, f"set_{name}lim")(centre - radius, centre + radius)
    axes.set_proj_type("persp", focal_length=_FOCAL_LENGTH)
    axes.view_init(_ELEVATION, _AZIMUTH)
    axes.set_box_aspect((1, 1, 1), zoom=_ZOOM)
    axes.set_axis_off()
    axes.patch.set_visible(False)


def _mesh(radius: float) -> Array:
    """Two ends of each line on the ground, m, shape (lines, 2, 3)."""
    count = math.ceil(_GROUND_RADII * radius / _LINE_DISTANCE)
    offsets, end = _LINE_DISTANCE * np.arange(-count, count + 1), _LINE_DISTANCE * count
    lines = np.zeros((2, len(offsets), 2, 3))
    for parallels, axis in zip(lines, (0, 1), strict=True):
        parallels[..., 1 - axis] = offsets[:, None]
        parallels[..., axis] = [-end, end]
    return lines.reshape(-1, 2, 3)


def _shaded(solids: Sequence[Solid]) -> tuple[Array, Array]:
    """All faces, m, shape (n, 4, 3), and their colours, shape (n, 3)."""
    faces, colours = [], []
    for solid in solids:
        local_faces = np.concatenate([grid.reshape(-1, 4, 3) for grid in _surfaces(solid)])
        placed = local_faces @ solid.turn.T + solid.place
        normals = np.cross(placed[:, 2] - placed[:, 0], placed[:, 3] - placed[:, 1])
        sizes = np.linalg.norm(normals, axis=1, keepdims=True)
        light = (normals / np.where(sizes, sizes, 1.0)) @ _LIGHT
        shade = _AMBIENT + (1 - _AMBIENT) * np.clip(light, 0, None)
        faces.append(placed)
        colours.append(shade[:, None] * np.array(_colour(solid.limb)))
    return np.concatenate(faces), np.concatenate(colours).clip(0, 1)


def _surfaces(item: Solid) -> Iterator[Array]:
    """A solid's surface in its own frame, as grids of faces whose normals point outwards."""
    steps = np.linspace(-1, 1, _ALONG + 1)
    turn = np.linspace(0, 2 * np.pi, _AROUND + 1)
    if item.kind == "box":
        across, up = np.meshgrid(steps, steps, indexing="ij")
        for axis in range(3):
            for side in (-1, 1):
                grid = np.empty((*across.shape, 3))
                grid[..., axis] = side
                grid[..., (axis + 1) % 3], grid[..., (axis + 2) % 3] = (
                    (across, up) if side > 0 else (up, across)
                )
                yield _quads(grid * np.array(item.size) / 2)
    elif item.kind == "cylinder":
        radius, length = item.size
        heights = steps * length / 2
        yield _quads(_ring(turn[:, None], radius + 0 * heights, heights))
        for side in (-1, 1):  # from the rim to the middle, or back
            radii = np.array([radius, 0.0])[::side]
            yield _quads(_ring(turn[:, None], radii, side * length / 2 + 0 * radii))
    else:
        (radius,) = item.size
        latitudes = np.linspace(-np.pi / 2, np.pi / 2, _AROUND // 2 + 1)
        yield _quads(_ring(turn[:, None], radius * np.cos(latitudes), radius * np.sin(latitudes)))


def _ring(turn: Array, radii: Array, heights: Array) -> Array:
    """Points on circles around z, shape (turns, heights, 3)."""
    return np.stack([radii * np.cos(turn), radii * np.sin(turn), heights + 0 * turn], axis=-1)


def _quads(grid: Array) -> Array:
    """The faces between a grid's points, shape (n, m, 4, 3)."""
    return np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)


def _colour(limb: int) -> tuple[float, ...]:
    if limb == MAIN_BODY:
        return _BODY_COLOUR
    return tuple(channel / 255 for channel in bytes.fromhex(leg_colour(limb)[1:]))


PANELS: Final = 3
"""Largest number of bodies in a picture: the best, a rival or two, the true body."""

_NOTE_WIDTH: Final = 38  # characters in a line of a note


def body_picture(bodies: Sequence[ShownBody], legs: Sequence[str]) -> Figure:
    """Draws bodies side by side, from the same camera.

    Args:
        bodies: Bodies that the page shows; at least one.
        legs: Names of the legs' joints.
    """
    truth = [body for body in bodies if body.true]
    chosen = [body for body in bodies if not body.true][: PANELS - len(truth)] + truth
    radius = max(reach(body.standing) for body in chosen)
    figure = new_figure(4.0 * len(chosen), 4.4)
    for axes, body in zip(figure.subplots(1, len(chosen), squeeze=False)[0], chosen, strict=True):
        axes.imshow(take_picture(body.standing, radius))
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
        axes.set_title(body.title, loc="left")
        note = textwrap.fill(printable(body.note), _NOTE_WIDTH)
        axes.set_xlabel(note, loc="left", fontsize="small", parse_math=False)
    legend = figure.legend(
        handles=leg_patches(legs),
        loc="outside lower left",
        ncols=min(len(legs), 3 * len(chosen)),
        frameon=False,
        fontsize="small",
    )
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name may hold dollar signs
    return figure
