"""The live page in a real browser: its numbers, its picture, and that it keeps to itself."""

from __future__ import annotations

import io
import re
import socket
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from estimator.body.morphology import Base
from estimator.errors import EstimatorError
from estimator.readings.observation import Observation
from estimator.report.canvas import leg_colour
from estimator.report.live.live_page import KINDS, instances, posed
from estimator.report.live.run_view import RunState
from tests.browser import watched_page
from tests.estimator.conftest import BODY, MakeBody
from tests.estimator.kinematics import tips
from tests.estimator.report.live.followed_run import FollowedRun

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

    from estimator.report.live.live_page import LivePage

SMALL = {"width": 760, "height": 340}
COARSE = 0.5  # pixels of the screen for each of the page, along either side: drawn in less time


def colours(page: Page) -> dict[str, int]:
    """What is to be seen of each leg, by its hue, in pixels."""
    picture = Image.open(io.BytesIO(page.screenshot(timeout=60_000))).convert("HSV")
    edge, right, bottom = (COARSE * place for place in (20, SMALL["width"] - 330, SMALL["height"]))
    picture = picture.crop((edge, edge, right, bottom))
    hue, strength, _ = np.moveaxis(np.asarray(picture), 2, 0)
    hues = {"blue": (140, 156), "orange": (10, 26), "green": (107, 125), "pink": (212, 238)}
    return {
        name: int(np.count_nonzero((strength > 90) & (hue >= low) & (hue <= high)))
        for name, (low, high) in hues.items()
    }


def test_it_shows_body_and_numbers_and_asks_nobody_else(
    browser: Browser, live: LivePage, followed: FollowedRun
) -> None:
    _, views = followed
    view = replace(views[-1], state=RunState.INTERRUPTED)
    own = (live.uri, live.uri.replace("http", "ws"), "data:", "blob:")
    with watched_page(browser, *own, viewport=SMALL, device_scale_factor=COARSE) as page:
        live.show(views[0])
        page.goto(live.uri)
        page.get_by_text("Nothing is known of the legs yet.").wait_for()
        # Viser's notice on software rendering fades once it is closed.
        notice = page.locator(".mantine-Notification-closeButton")
        notice.click()
        notice.wait_for(state="detached")
        assert not any(colours(page).values())
        live.show(view)
        page.get_by_text("and nobody works on it").wait_for()
        rows = page.locator("table").first.locator("tr").all_inner_texts()
        posterior = view.result.posterior
        assert posterior is not None
        for row, leg, length in zip(rows[1:], view.result.legs, posterior.lengths_m, strict=True):
            told = [float(number) for number in re.findall(r"\d+", row)]
            expected = [1000 * one for one in (length.median, length.low, length.high)]
            assert leg.joint in row
            assert told == pytest.approx(expected, abs=0.5)
        seen = [colours(page) for _ in range(3)][-1]  # the picture catches up with the text
        assert min(seen["orange"], seen["green"]) > 25, seen  # the legs that face the camera
        assert min(seen["blue"], seen["pink"]) > 0, seen
        page.get_by_text("all bodies").click()
        page.get_by_role("checkbox", name="all bodies", checked=False).wait_for()
        live.say("run.sqlite is not a run.")
        page.get_by_text("run.sqlite is not a run.").wait_for()
        assert not live._all.value


def test_it_flickers_while_the_run_goes_on_and_then_comes_to_rest(
    live: LivePage, followed: FollowedRun
) -> None:
    view = followed[1][-1]
    live.show(view)
    bodies = []
    for _ in view.bodies:
        bodies.append(live._shown)
        live.flicker()
    assert len({id(body) for body in bodies}) == len(view.bodies)
    live.show(replace(view, state=RunState.FINISHED))
    for _ in range(3):
        assert live._shown is live._best
        live.flicker()


def test_an_address_that_is_taken_is_a_sentence(live: LivePage) -> None:
    from estimator.report.live.live_page import LivePage

    port = int(live.uri.rpartition(":")[2])
    with pytest.raises(EstimatorError, match=f"cannot be served on 127.0.0.1:{port} .*in use"):
        LivePage(Path("runs/mine"), "127.0.0.1", port)


def test_it_is_served_on_the_given_interface_alone(live: LivePage) -> None:
    port = int(live.uri.rpartition(":")[2])
    with urllib.request.urlopen(live.uri, timeout=120) as answer:
        assert b"<html" in answer.read(1000)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", port), timeout=120)


LEVEL = Observation(angles=(0.3, -0.2, 0.1, 0.4, 0.2, -0.5, 0.0, 0.3), tilt=(0.0, 0.0))


def test_every_part_is_drawn_where_it_is(random_tree: MakeBody) -> None:
    body = random_tree(np.random.default_rng(5))
    solids = posed(BODY, body, LEVEL)
    boxes, _, spheres = (instances([solids], kind) for kind in KINDS)
    middle = boxes.positions[0]
    assert boxes.scales[0] == pytest.approx(BODY.size)
    outermost = tips(body, LEVEL.angles) + middle
    bars = np.array([part.shape == "box" for part in body.parts])
    reached = spheres.positions[1::2] - outermost[~bars]  # from the tip to the far sphere's middle
    radii = np.array([part.radius for part in body.parts])[~bars]
    assert np.linalg.norm(reached, axis=1) == pytest.approx(radii)
    assert spheres.scales[::2] == pytest.approx(np.repeat(radii, 3).reshape(-1, 3))
    sizes = np.array([part.size for part in body.parts])[bars]
    assert boxes.scales[1:] == pytest.approx(sizes)
    reached = boxes.positions[1:] - outermost[bars]
    assert np.linalg.norm(reached, axis=1) == pytest.approx(sizes[:, 0] / 2)


def test_a_body_rests_on_the_ground_turned_as_was_felt(random_quadruped: MakeBody) -> None:
    body = random_quadruped(np.random.default_rng(1))
    pose = Observation(angles=(-0.5, 0.2, -0.5, 0.1), tilt=(0.2, -0.1))
    solids = posed(BODY, body, pose)
    assert min(solid.lowest(np.array([0.0, 0.0, 1.0])) for solid in solids) == pytest.approx(0)
    up = Rotation.from_quat(instances([solids], "box").wxyzs[0], scalar_first=True).as_matrix()[2]
    assert np.arcsin(up[[1, 0]]) == pytest.approx((0.2, -0.1))


def test_each_leg_has_its_colour(random_quadruped: MakeBody) -> None:
    body = random_quadruped(np.random.default_rng(1))
    cylinders = instances([posed(BODY, body, None)] * 3, "cylinder")
    assert cylinders.colours.shape == (3 * 8, 3)
    light = np.array([list(bytes.fromhex(leg_colour(leg)[1:])) for leg in range(4)])
    expected = np.rint(255 * (light / 255) ** 2.2)
    assert cylinders.colours[:8].tolist() == np.tile(expected, (2, 1)).astype(int).tolist()


def test_a_round_main_body_is_a_cylinder() -> None:
    plate = Base(size=(0.14, 0.14, 0.03), mass=0.4, round=True)
    (solid,) = posed(plate, None, None)
    assert (solid.kind, solid.size) == ("cylinder", (0.07, 0.03))
    assert solid.place == pytest.approx((0, 0, 0.015))
    assert instances([[solid]], "cylinder").scales[0] == pytest.approx((0.07, 0.07, 0.03))


def test_before_anything_is_known_there_is_the_main_body() -> None:
    solids = posed(BODY, None, None)
    assert [solid.kind for solid in solids] == ["box"]
    assert instances([solids], "box").positions[0] == pytest.approx((0, 0, BODY.size[2] / 2))
    assert len(instances([solids], "sphere").wxyzs) == 0
