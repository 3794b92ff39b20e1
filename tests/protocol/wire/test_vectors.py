"""``vectors.json`` against this implementation, in both directions."""

from __future__ import annotations

import json
from importlib import resources
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest

from protocol.errors import ERROR_CODES
from protocol.rules.robot_interface import Finished, Progressed, Snapshot
from protocol.rules.server_core import Send, ServerCore, Submit
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import decode, encode
from protocol.wire.messages import (
    REPLIES,
    REQUESTS,
    ObservationReply,
    State,
    Telemetry,
    parse_reply,
    parse_request,
    parse_telemetry,
)
from protocol.wire.readings import belly_ray, clearance_of, tilt_of, touches, up_in_body

if TYPE_CHECKING:
    from collections.abc import Sequence

VECTORS: list[dict[str, Any]] = json.loads(
    resources.files("protocol").joinpath("vectors.json").read_text("utf-8")
)
PARSERS = {"request": parse_request, "reply": parse_reply, "publication": parse_telemetry}


def of_kind(kind: str, needed: str = "name") -> Sequence[Any]:
    return [
        pytest.param(vector, id=vector["name"])
        for vector in VECTORS
        if vector["kind"] == kind and needed in vector
    ]


def test_names_are_unique_and_kinds_are_known() -> None:
    names = [vector["name"] for vector in VECTORS]
    assert len(set(names)) == len(names)
    assert {vector["kind"] for vector in VECTORS} == {"message", "malformed", "reading"}


def test_every_message_and_every_error_has_a_vector() -> None:
    messages = [vector["json"] for vector in VECTORS if vector["kind"] == "message"]
    assert {message["type"] for message in messages} == {*REQUESTS, *REPLIES, Telemetry.TYPE}
    assert {message["code"] for message in messages if message["type"] == "error"} == set(
        ERROR_CODES
    )


@pytest.mark.parametrize("vector", of_kind("message"))
def test_hex_decodes_to_json(vector: dict[str, Any]) -> None:
    assert decode(bytes.fromhex(vector["hex"])) == vector["json"]


@pytest.mark.parametrize("vector", of_kind("message"))
def test_a_message_survives_the_round_trip(vector: dict[str, Any]) -> None:
    message = PARSERS[vector["direction"]](vector["json"])
    frame = encode(message.to_map())
    assert PARSERS[vector["direction"]](decode(frame)) == message
    assert (frame.hex() == vector["hex"]) == vector["canonical"]


@pytest.mark.parametrize("vector", of_kind("malformed"))
def test_malformed_frames_are_answered_with_their_code(
    vector: dict[str, Any], capabilities: Capabilities
) -> None:
    core = ServerCore(capabilities, view=snapshot)
    (action,) = core.receive(b"peer", bytes.fromhex(vector["hex"]), 0.0)
    assert isinstance(action, Send)
    reply = decode(action.frame)
    assert (reply["type"], reply["code"], reply.get("id")) == (
        "error",
        vector["code"],
        vector["id"],
    )
    assert core.garbage == 1


@pytest.mark.parametrize("vector", of_kind("reading", "orientation"))
def test_tilt_and_clearance(vector: dict[str, Any]) -> None:
    up = up_in_body(vector["orientation"])
    assert up == pytest.approx(vector["up"], abs=1e-9)
    assert tilt_of(up) == pytest.approx(vector["tilt"], abs=1e-7)  # asin is steep at its ends
    clearance, saturated = clearance_of(belly_ray(vector["belly_height"], up), vector["upper"])
    assert clearance == pytest.approx(vector["clearance"], abs=1e-9)
    assert saturated == vector["clearance_saturated"]


@pytest.mark.parametrize("vector", of_kind("reading", "gap"))
def test_touch(vector: dict[str, Any]) -> None:
    assert touches(vector["gap"]) == vector["touch"]


def snapshot(state: State = State.IDLE) -> Snapshot:
    return Snapshot(state=state, robot_time=12.5, sequence=0, angles={})


def test_the_session_is_what_the_server_really_says() -> None:
    steps = [vector for vector in VECTORS if vector.get("session")]
    welcome = next(step["json"] for step in steps if step["name"] == "welcome")
    state = State.IDLE
    core = ServerCore(
        Capabilities.from_map(welcome["capabilities"]),
        view=lambda: snapshot(state),
        token=lambda: str(welcome["session"]),
    )
    said: list[str] = []
    for step, following in pairwise([*steps, {"direction": "request"}]):
        if step["direction"] == "request":
            assert said == []
            actions = core.receive(b"peer", bytes.fromhex(step["hex"]), 0.0)
            for action in actions:
                if isinstance(action, Submit):
                    actions = [*core.accept(action.ticket), *act(core, action.ticket, steps)]
                    state = State.HOLDING
            said = [action.frame.hex() for action in actions if isinstance(action, Send)]
        else:
            assert said.pop(0) == step["hex"], step["name"]
        if following["direction"] == "request":
            assert said == [] or step["direction"] == "request"


def act(core: ServerCore, ticket: int, steps: Sequence[dict[str, Any]]) -> list[Send]:
    """What the robot of the example does: one progress, one observation."""
    by_type = {step["json"]["type"]: dict(step["json"]) for step in steps}
    progress, observation = by_type["progress"], parse_reply(by_type["observation"])
    assert isinstance(observation, ObservationReply)
    event = Progressed(
        ticket=ticket,
        phase=progress["phase"],
        fraction=progress["fraction"],
        robot_time=progress["robot_time"],
    )
    return [*core.progress(event), *core.finish(Finished(ticket=ticket, reply=observation))]
