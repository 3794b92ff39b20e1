"""Rules of the protocol, each broken by one server; the number is that of the clause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgpack

from protocol.rules import at_most_once, server_core
from protocol.rules.at_most_once import Client, Clients
from protocol.rules.server_core import ServerCore
from protocol.sockets import zmq_sockets
from protocol.transport import telemetry
from protocol.transport.server import Server
from protocol.wire.capabilities import Joint, check_targets
from protocol.wire.messages import Clear
from tests.protocol.conformance.spoilt import (
    Fault,
    Map,
    any_number_under_way,
    any_session,
    controller_may_go,
    decodes,
    finds_the_client_of_a_stop,
    first_connection_only,
    first_of_several,
    garbage_ends_control,
    keys_twice_inside,
    last_come_first_served,
    loosely,
    loses,
    new_session_each_time,
    nothing_expires,
    nothing_is_remembered,
    once_only,
    parses,
    patches,
    refusals_are_forgotten,
    replies,
    requests,
    short,
    text_of_bytes,
    twice,
    unknown_session_uses_ids_up,
)


def _slow_telemetry(server: Server) -> None:
    server._period *= 3


def _another_port(message: Map) -> Map:
    message["capabilities"]["telemetry"] = "tcp://127.0.0.1:1"
    return message


def _turned(message: Map) -> Map:
    return message | {"retryable": not message["retryable"]}


def _off(message: Map) -> Map:
    return message | {"angles": {name: angle + 0.2 for name, angle in message["angles"].items()}}


def _calibrated(capabilities: Map) -> Map:
    first, *others = capabilities["joints"]
    return capabilities | {"joints": [first | {"zero_sigma": -0.01}, *others]}


def _check_loosely(joints: Sequence[Joint], targets: Mapping[str, float]) -> None:
    wider = [replace(one, lower=one.lower - 0.01, upper=one.upper + 0.01) for one in joints]
    check_targets(wider, targets)


_SILENT = {"aborted_stop": "aborted_silent"}

FAULTS: dict[str, tuple[str, Fault]] = {
    "answers with a delimiter": ("1.1", Fault(reply=lambda frame: [[b"", frame]])),
    "takes messages of several parts": ("1.2", Fault(request=lambda parts: parts[-1:])),
    "takes long frames": ("1.5", requests("heartbeat", short)),
    "does not answer long frames": ("1.5", loses(lambda message: "padding" in message)),
    "answers enormous frames": ("1.6", patches(zmq_sockets, "MAX_MESSAGE", 1 << 22)),
    "nests without end": ("1.7", decodes(loosely)),
    "takes arrays of any length": ("1.8", decodes(loosely)),
    "takes any number of versions": (
        "1.9",
        requests("hello", lambda message: message | {"versions": message.get("versions", [])[:64]}),
    ),
    "shortens names": (
        "1.10",
        requests("hello", lambda f: f | {"client": f.get("client", "")[:64]}),
    ),
    "takes bytes for characters": (
        "1.10",
        parses(lambda f: "long" if len(str(f.get("client")).encode()) > 64 else None),
    ),
    "ignores what follows a frame": ("2.1", decodes(first_of_several)),
    "takes the last of two keys": ("2.2", decodes(loosely)),
    "takes the last of two inner keys": ("2.2", decodes(keys_twice_inside)),
    "takes binary for text": ("2.3", decodes(text_of_bytes)),
    "takes any integer": ("2.4", decodes(loosely)),
    "takes only its own encoding": (
        "2.5",
        Fault(request=lambda p: p if p[-1] == msgpack.packb(loosely(p[-1])) else [b"\xc1"]),
    ),
    "takes no integer for a float": (
        "2.6",
        parses(
            lambda f: (
                "integer"
                if isinstance(f.get("targets"), dict)
                and any(isinstance(value, int) for value in f["targets"].values())
                else None
            )
        ),
    ),
    "takes a float for an integer": (
        "2.7",
        requests("hello", lambda f: f | {"versions": [*map(int, f.get("versions", ()))]}),
    ),
    "does not know nil": ("2.8", parses(lambda f: "nil" if None in f.values() else None)),
    "refuses unknown fields": ("2.9", parses(lambda f: "future" if "future" in f else None)),
    "calls unknown types malformed": (
        "2.10",
        replies("error", lambda f: f | {"code": f["code"].replace("unknown_type", "malformed")}),
    ),
    "does not answer garbage": ("2.11", loses(lambda message: "type" not in message)),
    "leaves the id out of errors": (
        "2.12",
        replies("error", lambda f: {key: value for key, value in f.items() if key != "id"}),
    ),
    "lets garbage end control": ("2.11", patches(ServerCore, "complain", garbage_ends_control)),
    "chooses another version": ("3.2", replies("welcome", lambda f: f | {"version": 2})),
    "takes any version": ("3.3", requests("hello", lambda f: f | {"versions": [1]})),
    "needs no session": (
        "3.4",
        requests("heartbeat", lambda f: f if "session" in f else f | {"session": "s"}),
    ),
    "makes a session for each hello": ("3.5", patches(Clients, "welcome", new_session_each_time)),
    "has one session for all": (
        "3.6",
        Fault(spoil=lambda server: setattr(server._core._clients, "_token", lambda: "s")),
    ),
    "takes any session": ("3.8", patches(Clients, "find", any_session)),
    "remembers few clients": ("3.7", patches(at_most_once, "MAX_CLIENTS", 32, move=True)),
    "remembers too many clients": ("3.7", patches(at_most_once, "MAX_CLIENTS", 96, move=True)),
    "lets a crowd push the controller out": (
        "3.7",
        patches(Clients, "welcome", controller_may_go, move=True),
    ),
    "answers where it was asked first": ("3.10", first_connection_only()),
    "remembers few outcomes": ("4.2", patches(at_most_once, "MAX_OUTCOMES", 32)),
    "remembers too many outcomes": ("4.7", patches(at_most_once, "MAX_OUTCOMES", 512)),
    "carries a request out again": ("4.4", patches(Client, "recall", nothing_is_remembered)),
    "does not look at what a request says": (
        "4.6",
        patches(at_most_once, "_fingerprint", lambda request: b""),
    ),
    "carries out old ids": ("4.7", patches(Client, "recall", nothing_expires)),
    "minds the order of keys": ("4.8", patches(at_most_once, "_sorted", dict)),
    "tries again what it refused": ("4.9", patches(Client, "recall", refusals_are_forgotten)),
    "takes refused sessions' ids for used": (
        "4.10",
        patches(Clients, "find", unknown_session_uses_ids_up),
    ),
    "loses reads in a flood": (
        "4.11",
        loses(lambda f: f.get("type") == "read" and f["id"] % 100 == 99),
    ),
    "takes any number of requests": ("4.11", patches(Client, "begin", any_number_under_way)),
    "looks at targets before control": (
        "4.12",
        parses(lambda f: "empty" if f.get("targets") == {} else None),
    ),
    "numbers heartbeats": ("4.14", loses(twice(lambda f: f.get("type") == "heartbeat"))),
    "forgets its clients' ids": ("4.15", replies("welcome", lambda f: f | {"last_id": 0})),
    "does not answer heartbeats": (
        "5.5",
        loses(lambda f: f.get("type") == "heartbeat"),
    ),
    "hides the controller": (
        "5.1",
        replies("status", lambda f: {key: f[key] for key in f if key != "controller"}),
    ),
    "needs no control": (
        "5.2",
        patches(ServerCore, "_needs_lease", lambda server_core, client: None),
    ),
    "gives control once only": ("5.3", patches(ServerCore, "_acquire", once_only)),
    "gives control to whoever comes": (
        "5.4",
        patches(ServerCore, "_acquire", last_come_first_served),
    ),
    "does not say who has control": (
        "5.4",
        replies("error", lambda f: f | {"message": "Somebody else."}),
    ),
    "stops only in a session": (
        "5.9",
        loses(lambda f: f.get("type") == "stop" and "session" not in f),
    ),
    "refuses a stop of an old session": ("5.9", Fault(spoil=finds_the_client_of_a_stop)),
    "lets anybody clear": (
        "5.11",
        patches(Clear, "NEEDS_CONTROL", False),
    ),
    "stops once only": ("5.12", loses(twice(lambda f: f.get("type") == "stop"))),
    "says that it is idle after clear": (
        "6.1",
        replies("ok", lambda f: f | {"state": f["state"].replace("holding", "idle")}),
    ),
    "answers twice": ("7.5", Fault(reply=lambda frame: [[frame], [frame]])),
    "counts the ids of answers": ("7.6", replies("status", lambda f: f | {"id": f["id"] // 2})),
    "leaves a field out": (
        "7.1",
        replies("status", lambda f: {key: f[key] for key in f if key != "sequence"}),
    ),
    "has done more than all": ("7.1", replies("progress", lambda f: f | {"fraction": 1.5})),
    "is a plate as wide as no box around it": (
        "7.1",
        replies(
            "welcome", lambda f: f | {"capabilities": f["capabilities"] | {"base_radius": 0.5}}
        ),
    ),
    "is calibrated to less than nothing": (
        "7.1",
        replies("welcome", lambda f: f | {"capabilities": _calibrated(f["capabilities"])}),
    ),
    "has a touch too few": ("7.7", replies("observation", lambda f: f | {"touch": f["touch"][1:]})),
    "forgets an angle": (
        "7.7",
        replies("observation", lambda f: f | {"angles": {"hip_left": 0.0}}),
    ),
    "never names a saturated joint": (
        "7.9",
        replace(replies("observation", lambda f: f | {"saturated_joints": []}), move=True),
    ),
    "names joints that are not saturated": (
        "7.9",
        replace(
            replies("observation", lambda f: f | {"saturated_joints": [*f["angles"]]}), move=True
        ),
    ),
    "measures what it did not announce": (
        "7.10",
        replies("observation", lambda f: f | {"measured": {"hip_left": 0.0}}),
    ),
    "is off target unmeasured": (
        "7.10",
        replies("observation", lambda f: f | {"off_target": {"hip_left": "jammed"}}),
    ),
    "has a zero pose in a read": (
        "7.11",
        replies("observation", lambda f: f | {"zero_tilt": [0.0, 0.0]}),
    ),
    "repeats a sequence": ("7.8", replies("observation", lambda f: f | {"sequence": 1})),
    "has errors that can be retried": ("8.1", replies("error", _turned)),
    "makes up codes": ("8.1", replies("error", lambda f: f | {"code": "oops"})),
    "tells tilt in degrees": ("9.1", replies("observation", lambda f: f | {"tilt": [30.0, 0.0]})),
    "has a tilt that cannot be": ("9.1", replies("observation", lambda f: f | {"tilt": [1.5] * 2})),
    "tells clearance in millimetres": (
        "9.2",
        replies("observation", lambda f: f | {"clearance": 42.0}),
    ),
    "calls all clearances saturated": (
        "9.2",
        replies("observation", lambda f: f | {"clearance": 0.1, "clearance_saturated": True}),
    ),
    "runs backwards": (
        "10.1",
        replies("status", lambda f: f | {"robot_time": -f["robot_time"]}),
    ),
    "publishes another topic": ("11.1", patches(telemetry, "TOPIC", b"news")),
    "publishes at another address": ("11.3", replies("welcome", _another_port)),
    "publishes too seldom": ("11.2", Fault(spoil=_slow_telemetry)),
    "takes any joints": ("7.2", patches(server_core, "check_targets", lambda *_: None, move=True)),
    "takes any angles": ("7.3", patches(server_core, "check_targets", lambda *_: None, move=True)),
    "clamps angles a little beyond": (
        "7.3",
        patches(server_core, "check_targets", _check_loosely, move=True),
    ),
    "misses its targets": ("7.4", replace(replies("observation", _off), move=True)),
    "calls every end a silence": (
        "5.10",
        replace(
            replies("error", lambda f: f | {"code": _SILENT.get(f["code"], f["code"])}),
            move=True,
        ),
    ),
}
