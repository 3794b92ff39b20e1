"""Frames that are no requests, and what everybody is told."""

from __future__ import annotations

from typing import Any

import msgpack
from hypothesis import given
from hypothesis import strategies as st

from protocol.rules.server_core import ServerCore
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import decode
from tests.protocol.rules.core_bench import ServerCoreBench


@given(frame=st.binary(max_size=100))
def test_garbage_is_answered_and_counted(capabilities: Capabilities, frame: bytes) -> None:
    core = ServerCore(capabilities, view=ServerCoreBench.view)
    reply = ServerCoreBench.reply(core.receive(b"p", frame, 0.0))
    assert reply["type"] == "error"
    assert reply["code"] in ("malformed", "unknown_type")
    assert core.garbage == 1


def test_an_oversized_frame_is_answered(bench: ServerCoreBench) -> None:
    reply = bench.reply(bench.core.receive(b"p", b"x" * 65_537, 0.0))
    assert reply["code"] == "too_large"
    assert "id" not in reply


@given(
    st.dictionaries(
        st.sampled_from(["type", "id", "client", "session", "targets"]),
        st.none()
        | st.integers()
        | st.text()
        | st.floats()
        | st.binary()
        | st.sampled_from(["hello", "perform", "read", "heartbeat"]),
    )
)
def test_maps_of_the_wrong_shape_are_answered(
    capabilities: Capabilities, message: dict[str, Any]
) -> None:
    core = ServerCore(capabilities, view=ServerCoreBench.view)
    try:
        frame = msgpack.packb(message)
    except (OverflowError, ValueError):
        return
    assert ServerCoreBench.reply(core.receive(b"p", frame, 0.0))["type"] == "error"


def test_telemetry_names_the_controller(bench: ServerCoreBench) -> None:
    assert "controller" not in decode(bench.core.publication())
    bench.control()
    assert decode(bench.core.publication())["controller"] == "c"
