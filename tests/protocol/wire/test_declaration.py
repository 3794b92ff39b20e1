"""What is wrong with a message is said with the way to it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rules.control import MAY, Role
from protocol.wire.capabilities import Capabilities, Joint
from protocol.wire.messages import REQUESTS, Welcome, parse_reply, parse_request
from tests.protocol.conftest import make_capabilities

WELCOME = Welcome(id=1, version=1, session="s", robot_time=0.0, capabilities=make_capabilities())
Map = dict[str, Any]


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (
            lambda said: said["joints"][1].update(speed=0),
            "welcome: capabilities: joints 2: 'speed' must be at least 1e-09, not 0",
        ),
        (
            lambda said: said["joints"].append(5),
            "welcome: capabilities: joints 3: must be a map, not 5",
        ),
        (
            lambda said: said["sensors"][0].pop("unit"),
            "welcome: capabilities: sensors 1: missing unit",
        ),
        (
            lambda said: said.update(base_radius=0.08),
            "welcome: capabilities: 'base_size' of a round main body must begin with its width "
            "twice, 0.16, 0.16, not 0.14, 0.14",
        ),
        (
            lambda said: said.update(base_size=[1, 2]),
            "welcome: capabilities: 'base_size' must have 3 items, not 2",
        ),
        (
            lambda said: said.update(part_radii=[0.1, "x"]),
            "welcome: capabilities: 'part_radii 2' must be a number, not 'x'",
        ),
    ],
)
def test_the_way_to_a_flaw_counts_from_1(spoil: Callable[[Map], object], sentence: str) -> None:
    answer = copy.deepcopy(WELCOME.to_map())
    spoil(answer["capabilities"])
    with pytest.raises(RemoteProtocolError) as caught:
        parse_reply(answer)
    assert str(caught.value) == sentence


def test_items_of_a_request_count_from_1() -> None:
    hello = {"type": "hello", "id": 1, "client": "c", "versions": [1, "2"]}
    with pytest.raises(RemoteProtocolError, match=r"^hello: 'versions 2' must be an integer"):
        parse_request(hello)


def test_a_map_becomes_the_record_that_it_came_from() -> None:
    known = make_capabilities()
    assert Capabilities.from_map(known.to_map() | {"of a later version": 1}) == known
    with pytest.raises(LocalProtocolError, match=r"^missing name, resolution$"):
        Joint.from_map({"lower": -1.0, "upper": 1.0, "speed": 1.0})
    wrongs: tuple[Any, ...] = (5, [], None, "joint")
    for wrong in wrongs:
        with pytest.raises(LocalProtocolError, match=r"^must be a map, not "):
            Joint.from_map(wrong)


def test_what_a_request_needs_is_declared_with_it() -> None:
    in_control = {name for name, kind in REQUESTS.items() if kind.NEEDS_CONTROL}
    assert in_control == {"release", "perform", "hold", "relax", "clear"}
    assert not in_control & MAY[Role.VIEWER]
