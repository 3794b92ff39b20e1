"""Checks of section 4: each numbered request is carried out at most once."""

from __future__ import annotations

from protocol.conformance.expectations import Untried, expect
from protocol.conformance.raw_connection import pack, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_on_trial import RobotOnTrial

MEMORY = 64


@check("4.2", after=("4.4",))
def memory(bench: RobotOnTrial) -> None:
    """The last 64 outcomes of a client are remembered."""
    party = bench.party()
    first = party.number()
    outcome = party.harmless(first)
    for _ in range(MEMORY - 1):
        party.harmless(party.number())
    again = party.harmless(first)
    expect(again == outcome, f"The 64th last outcome came back as {said(again)}.")


@check("4.4")
def first_outcome(bench: RobotOnTrial) -> None:
    """The same request again brings the first outcome."""
    party = bench.party()
    read = party.request("read")
    outcomes = [party.answer_to(read)[1] for _ in range(3)]
    expect(outcomes[1:] == outcomes[:-1], "A read under the same id brought another answer.")
    if outcomes[0]["type"] != "observation":
        raise Untried(f"A read is answered with {said(outcomes[0])} now.")
    later = party.expect("observation", "read")
    expect(
        later["sequence"] > outcomes[0]["sequence"], "A repeated read was carried out once more."
    )


@check("4.6", after=("4.4",))
def reused(bench: RobotOnTrial) -> None:
    """Another request under a remembered id is id_reused."""
    party = bench.party()
    number = party.number()
    party.harmless(number)
    party.expect("id_reused", "read", id=number)
    party.expect("id_reused", "acquire", id=number)


@check("4.7", after=("4.4",))
def expired(bench: RobotOnTrial) -> None:
    """A smaller id that is not remembered is expired, and nothing is executed."""
    party = bench.party()
    skipped = party.number()
    party.harmless(party.number())
    before = party.status()["sequence"]
    party.expect("expired", "read", id=skipped)
    party.expect("expired", "release", id=skipped)
    expect(party.status()["sequence"] == before, "An expired read was carried out.")


@check("4.7", after=("4.4",))
def forgotten(bench: RobotOnTrial) -> None:
    """An id that was pushed out of the memory is expired, never executed again."""
    party = bench.party()
    read = party.request("read")
    party.answer_to(read)
    before = party.status()["sequence"]
    for _ in range(MEMORY + 1):
        party.harmless(party.number())
    _, again = party.answer_to(read)
    expect(
        again.get("code") == "expired",
        f"After 65 later outcomes, a read came back as {said(again)} instead of expired.",
    )
    expect(party.status()["sequence"] == before, "A forgotten read was carried out again.")


@check("4.8", after=("4.4", "4.6"))
def the_same(bench: RobotOnTrial) -> None:
    """The order of keys, and 1 against 1.0, make no other request; another value does."""
    party = bench.party()
    number = party.number()
    first = party.ask("perform", id=number, targets={"no joint": 1, "none": 0.5})
    if first.get("code") == "unauthorised":
        raise Untried("This key is a viewer's.")
    again = party.ask("perform", id=number, targets={"none": 0.5, "no joint": 1.0})
    expect(again == first, f"The same targets in another form were answered {said(again)}.")
    party.expect("id_reused", "perform", id=number, targets={"no joint": 1, "none": 0.25})


@check("4.9", need=Need.CONTROL, after=("4.4", "5.1"))
def refusals_stand(bench: RobotOnTrial) -> None:
    """What was refused is refused again under its id, although it would be possible now."""
    other = bench.party()
    number = other.number()
    refused = other.harmless(number)
    with bench.controlled():
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
def what_is_no_outcome(bench: RobotOnTrial) -> None:
    """malformed, unknown_type and restarted leave an id free."""
    party = bench.party()
    number = party.number()
    party.expect("restarted", "read", id=number, session="no such session")
    party.expect("unknown_type", "dance", id=number)
    request = party.request("read", id=number, client=5)
    party.refused(pack(request), "malformed", number, "A client that is a number")
    reply = party.ask("read", id=number)
    expect(
        reply.get("code") not in ("id_reused", "expired"),
        f"The id of requests that were not looked at is {said(reply)}.",
    )


@check("4.12", after=("2.10", "3.8", "4.4", "4.6", "5.2"))
def order(bench: RobotOnTrial) -> None:
    """Of several things that are wrong, the first in the order is answered."""
    party = bench.party()
    number = party.number()
    party.harmless(number)
    party.expect("restarted", "read", id=number, session="no such session")  # before the id
    party.expect("id_reused", "clear", id=number)  # before control
    party.expect("not_controller", "perform", targets={})  # before the targets
    wrong = party.request("perform", session="no such session", targets=5)
    party.refused(pack(wrong), "malformed", wrong["id"], "Targets that are no map")
    unknown = party.request("dance", session=5)
    party.refused(pack(unknown), "unknown_type", unknown["id"], "An unknown type with wrong fields")


@check("4.12", need=Need.CONTROL, after=("7.2",))
def order_in_control(bench: RobotOnTrial) -> None:
    """The targets come before the state."""
    with bench.controlled() as party:
        party.expect("ok", "stop")
        party.expect("bad_targets", "perform", targets={})


@check("4.14", after=("3.5",))
def not_numbered(bench: RobotOnTrial) -> None:
    """Any id will do for hello and heartbeat, again and again."""
    party = bench.party()
    party.harmless(party.number())
    for number in (0, 0, 1, 2**53 - 1, 0):
        party.expect("status", "heartbeat", id=number)
        party.expect("welcome", "hello", id=number, versions=[1])
    party.harmless(party.number())
