"""A few seconds of what ``make fuzz`` does for long."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from importlib import resources
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from protocol.errors import RemoteProtocolError
from protocol.rules import server_core
from protocol.rules.at_most_once import Client
from protocol.rules.control import Lease
from protocol.rules.server_core import Send, ServerCore
from protocol.wire import codec
from protocol.wire.codec import decode
from tests.fuzz import reference
from tests.fuzz.steps import play
from tests.fuzz.subject import CLIENTS, Subject

VECTORS: list[dict[str, Any]] = json.loads(
    resources.files("protocol").joinpath("vectors.json").read_text("utf-8")
)


@settings(max_examples=400, suppress_health_check=list(HealthCheck))
@given(st.binary(min_size=100, max_size=1500))
def test_whatever_comes(data: bytes) -> None:
    play(Subject(), data)


@pytest.mark.parametrize(
    "vector", [pytest.param(v, id=v["name"]) for v in VECTORS if v["kind"] != "reading"]
)
def test_the_reference_agrees_with_the_vectors(vector: dict[str, Any]) -> None:
    frame = bytes.fromhex(vector["hex"])
    if vector["kind"] == "malformed":
        assert reference.verdict(frame) == vector["code"]
    else:
        assert reference.decode(frame) == vector["json"]
        assert decode(frame) == vector["json"]
        if vector["direction"] == "request":
            assert reference.verdict(frame) is None


def test_both_readings_agree_on_every_short_frame() -> None:
    """All frames of up to two bytes, and all heads with some body."""
    frames = [bytes([a]) for a in range(256)]
    frames += [bytes([a, b]) for a in range(256) for b in range(256)]
    frames += [b"\x81\xa1a" + bytes([head]) + body for head in range(256) for body in _BODIES]
    for frame in frames:
        try:
            ours = decode(frame)
        except RemoteProtocolError:
            with pytest.raises(reference.Invalid):
                reference.decode(frame)
        else:
            assert reference.decode(frame) == ours


_BODIES = (b"", b"\0", b"\xff" * 8, bytes(8), b"\0\0\0\x01x", b"\x01x", b"\0\x01\xc0", b"\x3f" * 8)


# --- could it fail? -------------------------------------------------------------------------------


def _any_integer(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(codec, "MAX_INTEGER", 2**70)


def _keys_twice(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(codec, "_map_of", dict)


def _garbage_is_life(patch: pytest.MonkeyPatch) -> None:
    def complain(self: ServerCore, peer: bytes, error: RemoteProtocolError) -> Send:
        self._lease._heard += 1e-6
        return _complain(self, peer, error)

    patch.setattr(ServerCore, "complain", complain)


def _forgetful(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Client, "recall", lambda self, request: None)


def _no_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ServerCore, "_needs_lease", lambda self, client: None)


def _any_target(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(server_core, "check_targets", lambda joints, targets: None)


def _crash(patch: pytest.MonkeyPatch) -> None:
    def hear(self: Lease, client: str, now: float) -> None:
        if client == self.holder == CLIENTS[1]:
            raise KeyError(client)

    patch.setattr(Lease, "hear", hear)


_complain = ServerCore.complain


@pytest.mark.parametrize(
    "plant",
    [_any_integer, _keys_twice, _garbage_is_life, _forgetful, _no_lease, _any_target, _crash],
    ids=lambda plant: plant.__name__,
)
def test_a_planted_bug_is_found(
    plant: Callable[[pytest.MonkeyPatch], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch)
    rng = random.Random(1)
    with pytest.raises((AssertionError, KeyError)):  # noqa: PT012 - how many plays it takes is open
        for _ in range(2000):
            play(Subject(), rng.randbytes(1000))
