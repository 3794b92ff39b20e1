"""Checks of section 4: each numbered request is carried out at most once."""

from __future__ import annotations

from protocol.conformance.raw_connection import Skipped, expect, pack, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest

MEMORY = 64


@check("4.2", after=("4.4",))
def memory(robot: RobotUnderTest) -> None:
    """The last 64 outcomes of a client are remembered."""
    client = robot.client()
    first = client.number()
    outcome = client.harmless(first)
    for _ in range(MEMORY - 1):
        client.harmless(client.number())
    again = client.harmless(first)
    expect(again == outcome, f"The 64th last outcome came back as {said(again)}.")


@check("4.4")
def first_outcome(robot: RobotUnderTest) -> None:
    """The same request again brings the first outcome."""
    client = robot.client()
    read = client.request("read")
    outcomes = [client.answer_to(read)[1] for _ in range(3)]
    expect(outcomes[1:] == outcomes[:-1], "A read under the same id brought another answer.")
    if outcomes[0]["type"] != "observation":
        raise Skipped(f"A read is answered with {said(outcomes[0])} now.")
    later = client.expect("observation", "read")
    expect(
        later["sequence"] > outcomes[0]["sequence"], "A repeated read was carried out once more."
    )


@check("4.6", after=("4.4",))
def reused(robot: RobotUnderTest) -> None:
    """Another request under a remembered id is id_reused."""
    client = robot.client()
    number = client.number()
    client.harmless(number)
    client.expect("id_reused", "read", id=number)
    client.expect("id_reused", "acquire", id=number)


@check("4.7", after=("4.4",))
def expired(robot: RobotUnderTest) -> None:
    """A smaller id that is not remembered is expired, and nothing is executed."""
    client = robot.client()
    skipped = client.number()
    client.harmless(client.number())
    before = client.status()["sequence"]
    client.expect("expired", "read", id=skipped)
    client.expect("expired", "release", id=skipped)
    expect(client.status()["sequence"] == before, "An expired read was carried out.")


@check("4.7", after=("4.4",))
def forgotten(robot: RobotUnderTest) -> None:
    """An id that was pushed out of the memory is expired, never executed again."""
    client = robot.client()
    read = client.request("read")
    client.answer_to(read)
    before = client.status()["sequence"]
    for _ in range(MEMORY + 1):
        client.harmless(client.number())
    _, again = client.answer_to(read)
    expect(
        again.get("code") == "expired",
        f"After 65 later outcomes, a read came back as {said(again)} instead of expired.",
    )
    expect(client.status()["sequence"] == before, "A forgotten read was carried out again.")


@check("4.8", after=("4.4", "4.6"))
def the_same(robot: RobotUnderTest) -> None:
    """The order of keys, and 1 against 1.0, make no other request; another value does."""
    client = robot.client()
    number = client.number()
    first = client.ask("perform", id=number, targets={"no joint": 1, "none": 0.5})
    if first.get("code") == "unauthorised":
        raise Skipped("This key is a viewer's.")
    again = client.ask("perform", id=number, targets={"none": 0.5, "no joint": 1.0})
    expect(again == first, f"The same targets in another form were answered {said(again)}.")
    client.expect("id_reused", "perform", id=number, targets={"no joint": 1, "none": 0.25})


@check("4.9", need=Need.CONTROL, after=("4.4", "5.1"))
def refusals_stand(robot: RobotUnderTest) -> None:
    """What was refused is refused again under its id, although it would be possible now."""
    other = robot.client()
    number = other.number()
    refused = other.harmless(number)
    with robot.controlled():
        held = other.ask("acquire", id=(later := other.number()))
    again = other.ask("acquire", id=later)
    expect(again == held, f"acquire was held, and under the same id {said(again)} later.")
    other.expect("ok", "acquire")
    try:
        again = other.harmless(number)
        expect(again == refused, f"A refused release was {said(again)} under the same id later.")
        expect(other.status().get("controller") == other.name, "A refused release was carried out.")
    finally:
        other.ask("release")


@check("4.10", after=("2.10", "3.8"))
def what_is_no_outcome(robot: RobotUnderTest) -> None:
    """malformed, unknown_type and restarted leave an id free."""
    client = robot.client()
    number = client.number()
    client.expect("restarted", "read", id=number, session="no such session")
    client.expect("unknown_type", "dance", id=number)
    request = client.request("read", id=number, client=5)
    client.refused(pack(request), "malformed", number, "A client that is a number")
    reply = client.ask("read", id=number)
    expect(
        reply.get("code") not in ("id_reused", "expired"),
        f"The id of requests that were not looked at is {said(reply)}.",
    )


@check("4.12", after=("2.10", "3.8", "4.4", "4.6", "5.2"))
def order(robot: RobotUnderTest) -> None:
    """Of several things that are wrong, the first in the order is answered."""
    client = robot.client()
    number = client.number()
    client.harmless(number)
    client.expect("restarted", "read", id=number, session="no such session")  # before the id
    client.expect("id_reused", "clear", id=number)  # before control
    client.expect("not_controller", "perform", targets={})  # before the targets
    wrong = client.request("perform", session="no such session", targets=5)
    client.refused(pack(wrong), "malformed", wrong["id"], "Targets that are no map")
    unknown = client.request("dance", session=5)
    client.refused(
        pack(unknown), "unknown_type", unknown["id"], "An unknown type with wrong fields"
    )


@check("4.12", need=Need.CONTROL, after=("7.2",))
def order_in_control(robot: RobotUnderTest) -> None:
    """The targets come before the state."""
    with robot.controlled() as client:
        client.expect("ok", "stop")
        client.expect("bad_targets", "perform", targets={})


@check("4.14", after=("3.5",))
def not_numbered(robot: RobotUnderTest) -> None:
    """Any id will do for hello and heartbeat, again and again."""
    client = robot.client()
    client.harmless(client.number())
    for number in (0, 0, 1, 2**53 - 1, 0):
        client.expect("status", "heartbeat", id=number)
        client.expect("welcome", "hello", id=number, versions=[1])
    client.harmless(client.number())
