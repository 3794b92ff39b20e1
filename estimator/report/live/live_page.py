"""The live page: the bodies of a run's posterior in a browser; viser serves it and draws."""

from __future__ import annotations

import io
import socket
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, redirect_stdout
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any, Final, NoReturn, TypeAlias

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.body.arrays import Integers
from estimator.body.morphology import Array, Base, Morphology
from estimator.errors import EstimatorError, RunDirectoryError
from estimator.readings.observation import Observation
from estimator.report.canvas import leg_colour
from estimator.report.live.front import Front, private_loopback
from estimator.report.live.panel import panel, sentence_alone
from estimator.report.live.run_view import RunFollower, RunState, RunView
from estimator.report.scene import MAIN_BODY, Kind, Solid, at_rest, model_links, solids_of

_MESHES: Final = {
    "box": trimesh.creation.box(),
    "cylinder": trimesh.creation.cylinder(radius=1.0, height=1.0, sections=16),
    "sphere": trimesh.creation.icosphere(subdivisions=2),
}
_GHOST_OPACITY: Final = 0.12  # opacity of the bodies that stand for the posterior
_HIDDEN_HEIGHT: Final = -10.0  # m above the ground: where meshes are out of sight


class LivePage:
    """A page that shows how a run stands.

    Args:
        directory: The run directory, as the page names it.
        host: Interface to serve on.
        port: Port; 0: any.

    Attributes:
        uri: Address of the page.

    Raises:
        EstimatorError: The address cannot be used.
    """

    def __init__(self, directory: Path, host: str, port: int) -> None:
        listening = _listening_socket(host, port)
        self._directory = directory
        private_host = private_loopback()
        with redirect_stdout(io.StringIO()):  # viser announces itself
            self._server = viser.ViserServer(private_host, 0, label="estimator", verbose=False)
        self.uri = f"http://{host}:{listening.getsockname()[1]}"
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._server.gui.main_panel.dock_right()
        self._text = self._server.gui.add_html("")
        self._all = self._server.gui.add_checkbox("all bodies", initial_value=True)
        self._flicker_box = self._server.gui.add_checkbox("one after the other", initial_value=True)
        self._server.scene.add_grid(
            "/ground", width=2.0, height=2.0, cell_size=0.1, section_size=1.0
        )
        self._ghosts = _Bodies(self._server, "/bodies", opacity=_GHOST_OPACITY)
        self._body = _Bodies(self._server, "/body", opacity=None)
        self._front_label = self._server.scene.add_label("/front", "front")
        self._bodies_in_turn = cycle([list[Solid]()])
        self._best: Sequence[Solid] = []
        self._shown: Sequence[Solid] = []
        self._steady = False
        hostname = socket.gethostname()
        self._front = Front(
            listening,
            (private_host, self._server.get_port()),
            version=viser.__version__,
            names={"localhost", host, hostname, f"{hostname}.local"},
        )

    def close(self) -> None:
        """Ends the server; an open page then shows that the connection is lost."""
        self._front.close()
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def show(self, view: RunView) -> None:
        """Shows how the run stands now."""
        is_first = not self._best
        bodies = [posed(view.base, body, view.pose) for body in view.bodies]
        self._best = posed(view.base, view.best, view.pose)
        self._bodies_in_turn = cycle(bodies or [self._best])
        self._steady = view.state is not RunState.GOES_ON
        if is_first:
            self._point_camera(view)
        with self._server.atomic():
            self._text.content = panel(view, self._directory)
            self._ghosts.show(bodies)
        self.flicker()

    def say(self, sentence: str) -> None:
        """Shows a sentence in the place of numbers that can no longer be read."""
        self._text.content = sentence_alone(sentence)

    def flicker(self) -> None:
        """Shows the posterior's next body; the best one if the run rests or flickering is off."""
        is_steady = self._steady or not self._flicker_box.value
        body = self._best if is_steady else next(self._bodies_in_turn)
        self._ghosts.visible = self._all.value
        if body is self._shown:
            return
        self._shown = body
        main_solid = body[0]
        x, _, z = _extents(main_solid)
        x = x if main_solid.kind == "cylinder" else x / 2  # a cylinder's is its radius
        to_front = main_solid.turn @ np.array([x, 0.0, z / 2])
        with self._server.atomic():
            self._body.show([body])
            self._front_label.position = main_solid.place + 1.2 * to_front

    def _point_camera(self, view: RunView) -> None:
        reach = 1.5 * max(view.base.size) if view.best is None else view.best.reach
        self._server.initial_camera.position = np.array([1.2, -1.5, 1.0]) * reach
        self._server.initial_camera.look_at = np.zeros(3)


class _Bodies:
    """Some bodies, as one batch of meshes for each kind of solid."""

    def __init__(self, server: viser.ViserServer, name: str, *, opacity: float | None) -> None:
        self._batches: dict[Kind, Any] = {
            kind: server.scene.add_batched_meshes_simple(
                f"{name}/{kind}",
                np.asarray(_MESHES[kind].vertices),
                np.asarray(_MESHES[kind].faces),
                batched_wxyzs=np.array([[1.0, 0.0, 0.0, 0.0]]),
                batched_positions=np.array([[0.0, 0.0, _HIDDEN_HEIGHT]]),
                batched_scales=np.ones((1, 3)),
                batched_colors=np.zeros((1, 3), dtype=np.uint8),
                opacity=opacity,
                lod="off",
                cast_shadow=opacity is None,
                receive_shadow=opacity is None,
            )
            for kind in KINDS
        }

    @property
    def visible(self) -> bool:
        """Whether the bodies are shown."""
        return all(batch.visible for batch in self._batches.values())

    @visible.setter
    def visible(self, visible: bool) -> None:
        for batch in self._batches.values():
            if batch.visible != visible:
                batch.visible = visible

    def show(self, bodies: Sequence[Sequence[Solid]]) -> None:
        """Replaces the bodies."""
        for kind, batch in self._batches.items():
            solids = instances(bodies, kind)
            batch.batched_wxyzs = solids.wxyzs
            batch.batched_positions = solids.positions
            batch.batched_scales = solids.scales
            batch.batched_colors = solids.colours


def _listening_socket(host: str, port: int) -> socket.socket:
    try:
        return socket.create_server((host, port))
    except OSError as error:
        raise EstimatorError(
            f"the live page cannot be served on {host}:{port} ({error.strerror}): give another "
            "address"
        ) from error


_FLICKER_PERIOD: Final = 0.3  # s, for which a body is shown


def watch(directory: Path, host: str, port: int, say: Callable[[str], None]) -> NoReturn:
    """Shows a run on a page until it is interrupted.

    Args:
        directory: The run directory.
        host: Interface that the page is served on.
        port: Port of the page; 0: any.
        say: Called with sentences: where the page is, and what becomes of the run.

    Raises:
        EstimatorError: There is no run, it is damaged from the beginning, or the address cannot be
            used.
        KeyboardInterrupt: A person ended it.
    """
    follower = RunFollower(directory)
    view = follower.news()
    with closing(LivePage(directory, host, port)) as page:
        say(f"The live page is at {page.uri}")
        last_sentence = ""
        while True:
            try:
                if view is not None:
                    page.show(view)
                    last_sentence = _say_once(say, view.state.value, last_sentence)
                else:
                    page.flicker()
                time.sleep(_FLICKER_PERIOD)
                view = follower.news()
            except RunDirectoryError as error:
                page.say(str(error))
                last_sentence = _say_once(say, str(error), last_sentence)
                view = None


def _say_once(say: Callable[[str], None], sentence: str, said: str) -> str:
    if sentence != said:
        say(sentence)
    return sentence


KINDS: Final[tuple[Kind, ...]] = ("box", "cylinder", "sphere")
_MAIN_BODY_COLOUR: Final = (178, 184, 190)

Colours: TypeAlias = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Instances:
    """n solids of one kind, each as a copy of a mesh of unit size.

    Attributes:
        wxyzs: Orientations as quaternions, shape (n, 4).
        positions: Positions of the middles, m, shape (n, 3).
        scales: Scale factors along the solids' own axes, shape (n, 3).
        colours: Red, green and blue, 0 to 255, proportional to light, shape (n, 3).
    """

    wxyzs: Array
    positions: Array
    scales: Array
    colours: Colours


def posed(base: Base, body: Morphology | None, pose: Observation | None) -> list[Solid]:
    """A body placed as the robot last lay; flat on its belly before the first interaction.

    Args:
        base: The main body.
        body: The body with its legs; ``None``: nothing is known of them.
        pose: Last readings of the robot. A tilt that was not read counts as level.
    """
    morphology = body or Morphology(base=base, parts=(), density=1.0)
    angles = np.zeros(morphology.motors) if pose is None else np.array(pose.angles)
    return at_rest(solids_of(model_links(morphology), angles), pose)


def instances(bodies: Iterable[Sequence[Solid]], kind: Kind) -> Instances:
    """All solids of one kind in some bodies, as copies of a mesh."""
    solids = [solid for body in bodies for solid in body if solid.kind == kind]
    turns = np.array([solid.turn for solid in solids]).reshape(-1, 3, 3)
    return Instances(
        wxyzs=Rotation.from_matrix(turns).as_quat(scalar_first=True).reshape(-1, 4),
        positions=np.array([solid.place for solid in solids]).reshape(-1, 3),
        scales=np.array([_extents(solid) for solid in solids]).reshape(-1, 3),
        colours=_linear(np.array([list(_colour(solid)) for solid in solids]).reshape(-1, 3)),
    )


def _extents(solid: Solid) -> tuple[float, float, float]:
    """By how much a unit box, a cylinder of radius 1 and length 1, or a unit sphere is scaled."""
    if solid.kind == "box":
        x, y, z = solid.size
        return x, y, z
    if solid.kind == "cylinder":
        radius, length = solid.size
        return radius, radius, length
    (radius,) = solid.size
    return radius, radius, radius


def _colour(solid: Solid) -> Iterable[int]:
    if solid.limb == MAIN_BODY:
        return _MAIN_BODY_COLOUR
    return bytes.fromhex(leg_colour(solid.limb)[1:])


def _linear(colours: Integers) -> Colours:
    """Colours as linear light, with which a scene is computed; nearly sRGB's own curve."""
    return np.rint(255 * (colours / 255) ** 2.2).astype(np.uint8)
