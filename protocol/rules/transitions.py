"""The robot's state machine, as data.

Theory of operation: the robot is always in exactly one state. *Events* are either requests of a
client or things that happen to the robot. A pair (state, event) that is absent from
``TRANSITIONS`` is not allowed: a request is then refused with the code that ``REFUSALS`` gives for
the state; an internal event there changes nothing. Everything that affects the
state lives in this table; ``SPEC.md`` prints it and the tests hold the two together.
"""

from __future__ import annotations

from enum import StrEnum
from types import MappingProxyType
from typing import Final

from protocol.wire.messages import State


class Event(StrEnum):
    """What can change the state."""

    PERFORM = "perform"
    READ = "read"
    HOLD = "hold"
    RELAX = "relax"
    STOP = "stop"
    CLEAR = "clear"
    ARRIVED = "arrived"  # every joint was sent its target
    DEPARTED = "departed"  # homing done, slewing on to the targets
    DONE = "done"  # the motion ended, well or not
    FAILED = "failed"  # a device failed


_BUSY: Final = (State.MOVING, State.SETTLING)
_CALM: Final = (State.IDLE, State.HOLDING)

TRANSITIONS: Final = MappingProxyType(
    {(state, Event.PERFORM): State.MOVING for state in _CALM}
    | {(state, Event.READ): state for state in (*_CALM, State.RELAXED)}
    | {(state, Event.HOLD): State.HOLDING for state in (*_CALM, *_BUSY, State.RELAXED)}
    | {(state, Event.RELAX): State.RELAXED for state in (*_CALM, *_BUSY, State.RELAXED)}
    | {(state, Event.STOP): State.STOPPED for state in State if state is not State.FAULT}
    | {(State.FAULT, Event.STOP): State.FAULT}
    | {(State.STOPPED, Event.CLEAR): State.HOLDING, (State.FAULT, Event.CLEAR): State.HOLDING}
    | {(state, Event.CLEAR): state for state in (*_CALM, State.RELAXED)}
    | {
        (State.MOVING, Event.ARRIVED): State.SETTLING,
        (State.SETTLING, Event.DEPARTED): State.MOVING,
    }
    | {(state, Event.DONE): State.HOLDING for state in _BUSY}
    | {(state, Event.FAILED): State.FAULT for state in State}
)

REFUSALS: Final = MappingProxyType(
    {
        State.MOVING: "busy",
        State.SETTLING: "busy",
        State.STOPPED: "stopped",
        State.FAULT: "fault",
        State.RELAXED: "wrong_state",
        State.IDLE: "wrong_state",
        State.HOLDING: "wrong_state",
    }
)
"""The error code with which a request that a state does not allow is refused."""
