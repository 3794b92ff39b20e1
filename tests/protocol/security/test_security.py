"""Keys and roles, with real sockets."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from protocol.errors import EndpointError, RobotError, RobotUnreachableError
from protocol.security.keys import KeyDirectory
from protocol.sockets.zmq_sockets import Endpoint
from protocol.transport.client import RobotClient
from protocol.transport.server import Server
from protocol.transport.telemetry import TelemetrySubscriber
from tests.waiting import until

if TYPE_CHECKING:
    from tests.protocol.conftest import FakeRobot, Keyring, Serve

TARGETS = {"a": 0.1, "b": -0.1}
SHORT = 0.4  # s after which a client in these tests takes silence for an answer


def refusal(action: Callable[[], object]) -> str:
    with pytest.raises(RobotError) as caught:
        action()
    assert caught.value.code == "unauthorised"
    return caught.value.message


# --- who comes in ---------------------------------------------------------------------------------


def test_a_client_with_a_known_key_does_everything(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    ann = keyring.client("ann", "controller")
    server = serve(robot, keys=keyring.robot)
    with RobotClient(server.endpoint, keys=ann) as client:
        client.acquire()
        assert client.perform(TARGETS).sequence == 1
        with TelemetrySubscriber(client.telemetry_endpoint, keys=ann) as telemetry:
            assert telemetry.next(5.0).controller == client.client_id


def test_without_a_key_nobody_comes_in(serve: Serve, robot: FakeRobot, keyring: Keyring) -> None:
    server = serve(robot, keys=keyring.robot)
    with pytest.raises(RobotUnreachableError, match=r"asks for a key: .* robotd keys new"):
        RobotClient(server.endpoint, timeout=SHORT)
    with (
        TelemetrySubscriber(server.telemetry_endpoint) as telemetry,
        pytest.raises(RobotUnreachableError),
    ):
        telemetry.next(SHORT)


def test_a_key_that_the_robot_does_not_know(
    serve: Serve, robot: FakeRobot, keyring: Keyring, caplog: pytest.LogCaptureFixture
) -> None:
    mallory = keyring.stranger("mallory")
    server = serve(robot, keys=keyring.robot)
    with pytest.raises(RobotUnreachableError, match=r"does not know this key: .* robotd keys add"):
        RobotClient(server.endpoint, keys=mallory, timeout=SHORT)
    assert KeyDirectory(mallory).pair().public in caplog.text  # for the owner, who may add it
    keyring.add("mallory", "viewer")  # the daemon runs on
    with RobotClient(server.endpoint, keys=mallory) as client:
        assert client.status().state == "idle"


def test_an_impatient_client_is_told_the_same(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    """A busy robot's refusal takes longer than such a client waits for an answer."""
    server = serve(robot, keys=keyring.robot)
    with pytest.raises(RobotUnreachableError, match="does not know this key"):
        RobotClient(server.endpoint, keys=keyring.stranger("mallory"), timeout=1e-4)


def test_a_robot_with_another_key_than_expected(
    serve: Serve, robot: FakeRobot, keyring: Keyring, tmp_path: Path
) -> None:
    ann = keyring.client("ann", "controller")
    other = tmp_path / "other"
    KeyDirectory(other).create("other")
    server = serve(robot, keys=other)
    with pytest.raises(RobotUnreachableError, match="another robot, or it got a new key"):
        RobotClient(server.endpoint, keys=ann, timeout=SHORT)


def test_a_robot_without_keys_is_not_taken_for_the_one_that_is_meant(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    ann = keyring.client("ann", "controller")
    server = serve(robot)
    with pytest.raises(RobotUnreachableError, match=r"does without keys.*leave --keys out"):
        RobotClient(server.endpoint, keys=ann, timeout=SHORT)


def test_an_address_open_to_others_is_allowed_with_keys(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    with pytest.raises(EndpointError, match=r"without keys .* give --keys DIR"):
        Server(robot, bind="tcp://0.0.0.0:0")
    ann = keyring.client("ann", "viewer")
    server = serve(robot, keys=keyring.robot, bind="tcp://0.0.0.0:0")
    port = Endpoint.parse(server.endpoint).port
    with RobotClient(f"tcp://127.0.0.1:{port}", keys=ann) as client:
        assert client.status().state == "idle"


# --- what they may do -----------------------------------------------------------------------------


def test_a_viewer_looks_and_stops_and_nothing_else(
    serve: Serve, slow_robot: FakeRobot, keyring: Keyring
) -> None:
    ann, bob = keyring.client("ann", "controller"), keyring.client("bob", "viewer")
    server = serve(slow_robot, keys=keyring.robot)
    with (
        RobotClient(server.endpoint, keys=ann) as controller,
        RobotClient(server.endpoint, keys=bob) as viewer,
    ):
        for action, kind in (
            (viewer.acquire, "acquire"),
            (lambda: viewer.perform(TARGETS), "perform"),
            (viewer.hold, "hold"),
            (viewer.relax, "relax"),
            (viewer.clear, "clear"),
            (viewer.release, "release"),
        ):
            assert refusal(action) == f"bob is a viewer here and may not {kind}."
        assert viewer.read().sequence == 1
        assert viewer.status().controller is None
        controller.acquire()
        ended: list[str] = []

        def perform() -> None:
            with pytest.raises(RobotError) as caught:
                controller.perform(TARGETS)
            ended.append(caught.value.code)

        motion = threading.Thread(target=perform)
        motion.start()
        assert slow_robot.begun.acquire(timeout=120)
        assert viewer.stop().state == "stopped"
        motion.join()
        assert ended == ["aborted_stop"]
        refusal(viewer.clear)
        controller.clear()
    assert len(slow_robot.motions) == 1


def test_the_log_says_whose_key_it_was_whatever_client_is_named(
    serve: Serve, robot: FakeRobot, keyring: Keyring, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    ann, bob = keyring.client("ann", "controller"), keyring.client("bob", "viewer")
    server = serve(robot, keys=keyring.robot)
    with RobotClient(server.endpoint, keys=ann, client_id="legs-lab") as controller:
        controller.acquire()
        with pytest.raises(RobotError, match="belongs to another user"):
            RobotClient(server.endpoint, keys=bob, client_id="legs-lab", timeout=SHORT)
        with RobotClient(server.endpoint, keys=bob) as viewer:
            viewer.stop()
    assert "refused: hello of bob as client legs-lab: unauthorised" in caplog.text
    assert f"stop of bob as client {viewer.client_id}" in caplog.text


def test_a_client_id_belongs_to_the_key_that_used_it_first(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    ann, bob = keyring.client("ann", "controller"), keyring.client("bob", "controller")
    server = serve(robot, keys=keyring.robot)
    with RobotClient(server.endpoint, keys=ann) as client:
        client.acquire()
        message = refusal(
            lambda: RobotClient(server.endpoint, keys=bob, client_id=client.client_id)
        )
        assert message == f"Client {client.client_id} belongs to another user."


# --- who has to leave -----------------------------------------------------------------------------


def test_a_removed_key_loses_everything_at_once(
    serve: Serve, slow_robot: FakeRobot, keyring: Keyring
) -> None:
    ann, bob = keyring.client("ann", "controller"), keyring.client("bob", "viewer")
    server = serve(slow_robot, keys=keyring.robot, telemetry_rate=20.0)
    with (
        RobotClient(server.endpoint, keys=ann, timeout=SHORT) as client,
        RobotClient(server.endpoint, keys=bob) as viewer,
        TelemetrySubscriber(server.telemetry_endpoint, keys=ann) as removed,
        TelemetrySubscriber(server.telemetry_endpoint, keys=bob) as kept,
    ):
        client.acquire()
        heard: list[Exception] = []

        def perform() -> None:
            with pytest.raises((RobotError, RobotUnreachableError)) as caught:
                client.perform(TARGETS)
            heard.append(caught.value)

        motion = threading.Thread(target=perform)
        motion.start()
        assert slow_robot.begun.acquire(timeout=120)
        removed.next(5.0)
        kept.next(5.0)
        keyring.remove("ann")

        assert until(lambda: slow_robot.controllers == [client.client_id, None])
        assert slow_robot.silences == 1  # the motion ended: nobody steers
        assert viewer.status().controller is None
        for action in (client.read, client.status, client.stop, client.hello):
            assert refusal(action) == "The robot does not know this key (any more)."
        motion.join()
        assert isinstance(heard[0], RobotError)
        assert heard[0].code == "unauthorised"  # of its retry: the outcome was not for it
        assert until(lambda: kept.next(5.0).controller is None)  # once what was on its way is read
        while removed_hears(removed):
            continue  # what was on its way already
        assert kept.next(5.0).state
    with pytest.raises(RobotUnreachableError, match="does not know this key"):
        RobotClient(server.endpoint, keys=ann, timeout=SHORT)


def removed_hears(subscriber: TelemetrySubscriber) -> bool:
    try:
        subscriber.next(0.3)
    except RobotUnreachableError:
        return False
    return True


def test_a_controller_may_become_a_viewer(serve: Serve, robot: FakeRobot, keyring: Keyring) -> None:
    ann = keyring.client("ann", "controller")
    server = serve(robot, keys=keyring.robot)
    with RobotClient(server.endpoint, keys=ann) as client:
        client.acquire()
        keyring.remove("ann")
        keyring.add("ann", "viewer")
        assert refusal(lambda: client.perform(TARGETS)) == (
            "ann is a viewer here and may not perform."
        )
        assert until(lambda: robot.controllers == [client.client_id, None])
        assert client.stop().state == "stopped"
    assert robot.motions == []


def put(place: Path, text: str) -> None:
    """Writes a file in one step, so that nobody reads half of it."""
    new = place.with_suffix(".new")
    new.write_text(text)
    new.chmod(0o600)
    new.replace(place)


def test_a_list_that_cannot_be_read_lets_nobody_do_more_than_stop(
    serve: Serve, robot: FakeRobot, keyring: Keyring, caplog: pytest.LogCaptureFixture
) -> None:
    ann = keyring.client("ann", "controller")
    server = serve(robot, keys=keyring.robot)
    place = keyring.robot / "known.toml"
    good = place.read_text()
    with RobotClient(server.endpoint, keys=ann) as client:
        client.acquire()
        put(place, good + "[ann")
        assert refusal(client.read) == "The robot cannot read its list of clients."
        assert until(lambda: robot.controllers[-1] is None)
        assert refusal(client.acquire) == "The robot cannot read its list of clients."
        assert client.stop().state == "stopped"
        assert caplog.text.count("known.toml is no TOML") == 1
        put(place, good)
        client.acquire()
        assert client.clear().state == "holding"


@pytest.mark.parametrize("spoilt", ["[ann", "a = " + "[\n" * 5000, None], ids=str)
def test_who_is_known_can_stop_while_the_list_is_broken(
    serve: Serve, robot: FakeRobot, keyring: Keyring, spoilt: str | None
) -> None:
    """With a client of the library, which says hello first."""
    bob = keyring.client("bob", "viewer")
    server = serve(robot, keys=keyring.robot)
    place = keyring.robot / "known.toml"
    if spoilt is None:
        place.unlink()
        os.mkfifo(place, 0o600)
    else:
        put(place, spoilt)
    with RobotClient(server.endpoint, keys=bob) as viewer:
        assert viewer.status().state == "idle"
        assert refusal(viewer.read) == "The robot cannot read its list of clients."
        assert viewer.stop().state == "stopped"


def test_a_list_that_is_gone_for_a_moment_ends_no_session(
    serve: Serve, robot: FakeRobot, keyring: Keyring
) -> None:
    """Some editors move a file away before they write it anew."""
    ann = keyring.client("ann", "controller")
    server = serve(robot, keys=keyring.robot)
    place = keyring.robot / "known.toml"
    aside = place.with_suffix(".aside")
    with RobotClient(server.endpoint, keys=ann) as client:
        client.acquire()
        place.rename(aside)
        assert refusal(client.read) == "The robot cannot read its list of clients."
        aside.rename(place)
        client.acquire()
