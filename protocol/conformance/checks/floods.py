"""Checks with many requests at once, and of what waits for what."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final

from protocol.conformance.expectations import Untried, expect
from protocol.conformance.raw_connection import FINAL, GRACE, Map, Unanswered, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import RobotOnTrial, TrialClient

MOST: Final = 64
"""Requests that a client may have under way."""

_MOST_OF_A_KEY: Final = 8
_FLOOD: Final = 200
_TOO_QUICK: Final = "It reads too quickly for that."


def _read_all(client: TrialClient, reads: Sequence[Map]) -> list[Map]:
    """All replies to reads that were sent, in the order in which they came."""
    waiting = {read["id"] for read in reads}
    replies: list[Map] = []
    while waiting:
        reply = client.connection.first_of(waiting)
        if reply is None:
            client.connection.expect_ids()  # an error without its id may have ended a read
            raise Unanswered(f"{len(waiting)} of {len(reads)} reads were not answered to the end.")
        replies.append(reply)
        if reply["type"] in FINAL:
            waiting.remove(reply["id"])
    return replies


def _most_under_way(replies: Sequence[Map]) -> int:
    """The most reads that had been accepted, and not ended, at the same time."""
    under_way: set[int] = set()
    most = 0
    for reply in replies:
        if reply["type"] == "accepted":
            under_way.add(reply["id"])
        elif reply["type"] in FINAL:
            under_way.discard(reply["id"])
        most = max(most, len(under_way))
    return most


def _time_of_a_read(client: TrialClient) -> float:
    begun = time.monotonic()
    client.expect("observation", "read")
    return time.monotonic() - begun


@check("4.11", need=Need.CONTROL, after=("5.9",))
def a_flood(robot: RobotOnTrial) -> None:
    """In a flood of reads all are answered, 64 at most are under way, and a stop ends it."""
    with robot.controlled() as client:
        reads = [client.request("read") for _ in range(_FLOOD)]
        for read in reads:
            client.connection.send(read)
        client.expect("ok", "stop")
        replies = _read_all(client, reads)
        client.expect("ok", "clear")
        most = _most_under_way(replies)
        expect(most <= MOST, f"{most} reads of one client were under way at once.")
        ends = {reply["id"]: reply for reply in replies if reply["type"] in FINAL}
        if not any(end.get("code") == "busy" for end in ends.values()):
            raise Untried(_TOO_QUICK)
        last = ends[reads[-1]["id"]]
        if last.get("code") == "busy":
            again = client.answer_to(reads[-1])[1]
            expect(again.get("code") != "busy", "A read that was busy in a flood stays busy.")


@check("1.18", need=Need.KEYS)
def a_flood_of_a_key(robot: RobotOnTrial) -> None:
    """Of the reads of a key without control, 8 at most are under way, and one more is busy."""
    client = robot.client()
    reads = [client.request("read") for _ in range(4 * _MOST_OF_A_KEY)]
    for read in reads:
        client.connection.send(read)
    replies = _read_all(client, reads)
    most = _most_under_way(replies)
    expect(most <= _MOST_OF_A_KEY, f"{most} reads of one key were under way at once.")
    if not any(reply.get("code") == "busy" for reply in replies):
        raise Untried(_TOO_QUICK)


@check("5.16", "5.15", need=Need.CONTROL)
def commands_go_before_reads(robot: RobotOnTrial) -> None:
    """A command ends the reads before it, and waits for none of them."""
    with robot.controlled() as client:
        each = min(_time_of_a_read(client) for _ in range(3))
        reads = [client.request("read") for _ in range(MOST - 1)]
        clear = client.request("clear")
        for request in (*reads, clear):
            client.connection.send(request)
        begun = time.monotonic()
        reply = client.connection.final(clear["id"], patience=robot.settings.motion)[1]
        waited = time.monotonic() - begun
        expect(reply["type"] == "ok", f"A clear among reads was answered with {said(reply)}.")
        ends = [reply for reply in _read_all(client, reads) if reply["type"] in FINAL]
        wrong = {said(end) for end in ends} - {"observation", "aborted_read"}
        expect(not wrong, f"Before a clear, reads ended with {', '.join(sorted(wrong))}.")
        if any(end["type"] == "error" for end in ends):
            return
        expect(
            waited < max(each * len(reads) / 2, GRACE),
            f"A clear waited {waited:.2f} s for {len(reads)} reads.",
        )
        raise Untried(_TOO_QUICK)
