"""The live page: the bodies that a run believes in, in a browser; viser serves it and draws."""

from __future__ import annotations

import io
import socket
from collections.abc import Sequence
from contextlib import redirect_stdout
from itertools import cycle
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh
import viser

from estimator.errors import EstimatorError
from estimator.live.front import Front, private_loopback
from estimator.live.panel import panel, sentence_alone
from estimator.live.pose_ensemble import KINDS, Instances, instances, posed
from estimator.live.run_view import RunState, RunView
from estimator.report.bodies.jointed_body import Kind
from estimator.report.bodies.scene import Solid

_MESHES: Final = {
    "box": trimesh.creation.box(),
    "cylinder": trimesh.creation.cylinder(radius=1.0, height=1.0, sections=16),
    "sphere": trimesh.creation.icosphere(subdivisions=2),
}
_GHOSTS: Final = 0.12  # opacity
_NOWHERE: Final = -10.0  # m above the ground: where there is nothing to be seen


class LivePage:
    """A page that shows how a run stands.

    Args:
        directory: The run, as its page names it.
        host: Interface to serve on.
        port: Port; 0: any.

    Attributes:
        uri: Where the page is.

    Raises:
        EstimatorError: The address cannot be had.
    """

    def __init__(self, directory: Path, host: str, port: int) -> None:
        listening = _listening(host, port)
        self._directory = directory
        hidden = private_loopback()
        with redirect_stdout(io.StringIO()):  # viser announces itself
            self._server = viser.ViserServer(hidden, 0, label="estimator", verbose=False)
        self.uri = f"http://{host}:{listening.getsockname()[1]}"
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._server.gui.main_panel.dock_right()
        self._text = self._server.gui.add_html("")
        self._all = self._server.gui.add_checkbox("all that is believed", initial_value=True)
        self._flickers = self._server.gui.add_checkbox("one after the other", initial_value=True)
        self._server.scene.add_grid(
            "/ground", width=2.0, height=2.0, cell_size=0.1, section_size=1.0
        )
        self._ghosts = _Bodies(self._server, "/believed", opacity=_GHOSTS)
        self._body = _Bodies(self._server, "/body", opacity=None)
        self._ahead = self._server.scene.add_label("/front", "front")
        self._turns = cycle([list[Solid]()])
        self._best: Sequence[Solid] = []
        self._shown: Sequence[Solid] = []
        self._steady = False
        name = socket.gethostname()
        self._front = Front(
            listening,
            (hidden, self._server.get_port()),
            version=viser.__version__,
            names={"localhost", host, name, f"{name}.local"},
        )

    def close(self) -> None:
        """Ends the server; whoever looks sees that the connection is gone."""
        self._front.close()
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def show(self, view: RunView) -> None:
        """Shows how the run stands now."""
        first = not self._best
        bodies = [posed(view.base, body, view.pose) for body in view.bodies]
        self._best = posed(view.base, view.best, view.pose)
        self._turns = cycle(bodies or [self._best])
        self._steady = view.state is not RunState.GOES_ON
        if first:
            self._point_camera(view)
        with self._server.atomic():
            self._text.content = panel(view, self._directory)
            self._ghosts.show(bodies)
        self.flicker()

    def say(self, sentence: str) -> None:
        """Shows a sentence in the place of numbers that can no longer be read."""
        self._text.content = sentence_alone(sentence)

    def flicker(self) -> None:
        """Shows another of the bodies that are believed in; when the run rests, the best."""
        steady = self._steady or not self._flickers.value
        body = self._best if steady else next(self._turns)
        self._ghosts.visible = self._all.value
        if body is self._shown:
            return
        self._shown = body
        main = body[0]
        ahead = main.turn @ np.array([main.size[0] / 2, 0.0, main.size[2] / 2])
        with self._server.atomic():
            self._body.show([body])
            self._ahead.position = main.place + 1.2 * ahead

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
                batched_positions=np.array([[0.0, 0.0, _NOWHERE]]),
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
        """Whether they are to be seen."""
        return all(batch.visible for batch in self._batches.values())

    @visible.setter
    def visible(self, visible: bool) -> None:
        for batch in self._batches.values():
            if batch.visible != visible:
                batch.visible = visible

    def show(self, bodies: Sequence[Sequence[Solid]]) -> None:
        """Replaces the bodies."""
        for kind, batch in self._batches.items():
            _place(batch, instances(bodies, kind))


def _place(batch: Any, solids: Instances) -> None:
    batch.batched_wxyzs = solids.wxyzs
    batch.batched_positions = solids.positions
    batch.batched_scales = solids.scales
    batch.batched_colors = solids.colours


def _listening(host: str, port: int) -> socket.socket:
    try:
        return socket.create_server((host, port))
    except OSError as error:
        raise EstimatorError(
            f"the live page cannot be served on {host}:{port} ({error.strerror}): give another "
            "address"
        ) from error
