"""What is wrong with a message is said with the way to it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rules.control import MAY, Role
from protocol.wire.capabilities import Capabilities, Joint
from protocol.wire.codec import decode, encode
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
            lambda said: said["joints"][0].update(zero_sigma=-0.1),
            "welcome: capabilities: joints 1: 'zero_sigma' must be at least 1e-09, not -0.1",
        ),
        (
            lambda said: said["joints"][0].update(travel_sigma=0),
            "welcome: capabilities: joints 1: 'travel_sigma' must be at least 1e-09, not 0",
        ),
        (
            lambda said: said["sensors"][1].update(zero_sigma=float("nan")),
            "welcome: capabilities: sensors 2: 'zero_sigma' must be finite, not nan",
        ),
        (
            lambda said: said["sensors"][2].update(gain_sigma=10**400),
            "welcome: capabilities: sensors 3: 'gain_sigma' must be a number that a float can hold",
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


@pytest.mark.parametrize(
    ("fraction", "sentence"),
    [
        (-0.1, "progress: 'fraction' must be at least 0.0, not -0.1"),
        (1.5, "progress: 'fraction' must be at most 1.0, not 1.5"),
    ],
)
def test_a_share_lies_in_0_to_1(fraction: float, sentence: str) -> None:
    answer = {"type": "progress", "id": 1, "phase": "moving", "robot_time": 0.0}
    for valid in (0, 1):
        parse_reply(answer | {"fraction": valid})
    with pytest.raises(RemoteProtocolError) as caught:
        parse_reply(answer | {"fraction": fraction})
    assert str(caught.value) == sentence


sigmas = st.none() | st.floats(1e-9, 1e300)


@given(sigmas, sigmas)
def test_how_well_a_robot_is_calibrated_comes_over_the_wire(
    zero: float | None, gain: float | None
) -> None:
    usual = make_capabilities()
    joint = replace(usual.joints[0], zero_sigma=zero, travel_sigma=gain)
    sensors = [replace(one, zero_sigma=zero, gain_sigma=gain) for one in usual.sensors]
    known = replace(usual, joints=(joint, usual.joints[1]), sensors=tuple(sensors))
    assert Capabilities.from_map(decode(encode(known.to_map()))) == known
    assert ("zero_sigma" in joint.to_map()) == (zero is not None)


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
