"""``SPEC.md`` says what the code does."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from importlib import resources
from typing import Any

import pytest

from protocol.errors import ERROR_CODES
from protocol.rules.control import EXPIRY, MAY, SILENCE
from protocol.rules.server_core import MAX_READS
from protocol.rules.transitions import REFUSALS, TRANSITIONS, Event
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import MAX_FRAME, MAX_LENGTH, MAX_MESSAGE, MAX_NESTING
from protocol.wire.messages import REPLIES, REQUESTS, Request, State, Telemetry

SPEC = resources.files("protocol").joinpath("SPEC.md").read_text("utf-8")
VECTORS: list[dict[str, Any]] = json.loads(
    resources.files("protocol").joinpath("vectors.json").read_text("utf-8")
)


def rows(text: str) -> list[list[str]]:
    """The cells of all tables in a text, without the lines between head and body."""
    lines = [line for line in text.splitlines() if line.startswith("|") and "---" not in line]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def section(title: str) -> str:
    text = re.search(rf"^## \d+\. {title}.*?(?=^## |\Z)", SPEC, re.MULTILINE | re.DOTALL)
    assert text is not None, title
    return text.group()


def test_the_table_of_states() -> None:
    head, *body = rows(section("States"))
    assert head[1:] == [event.value for event in Event]
    assert [line[0].strip("*") for line in body] == [state.value for state in State]
    requests = {event for event in Event if event.value in REQUESTS}
    for state, line in zip(State, body, strict=True):
        for event, cell in zip(Event, line[1:], strict=True):
            following = TRANSITIONS.get((state, event))
            refusal = f"`{REFUSALS[state]}`" if event in requests else "–"
            assert cell == (following.value if following is not None else refusal), (state, event)


def test_the_table_of_errors() -> None:
    _, *body = rows(section("Errors"))
    assert body == [
        [f"`{code}`", "yes" if kind.retryable else "no", kind.meaning, kind.advice]
        for code, kind in ERROR_CODES.items()
    ]


def test_the_table_of_roles() -> None:
    tables = [line for line in rows(section("Transport")) if len(line) == 2]
    assert tables[0] == ["role", "requests"]
    said = {role.strip("`"): set(re.findall(r"`(\w+)`", kinds)) for role, kinds in tables[1:3]}
    assert said == {role.value: set(kinds) for role, kinds in MAY.items()}
    assert tables[3][1] == "none"
    assert f"may have {MAX_READS} requests under way" in section("Transport")


KINDS: dict[str, Any] = {
    **REQUESTS,
    **REPLIES,
    Telemetry.TYPE: Telemetry,
    "capabilities": Capabilities,
}


@pytest.mark.parametrize("name", KINDS)
def test_the_fields_of_each_message(name: str) -> None:
    paragraph = re.search(rf"^\*\*`{name}`\*\*.*?(?=^\*\*`|^#|\Z)", SPEC, re.MULTILINE | re.DOTALL)
    assert paragraph is not None
    kind = KINDS[name]
    common = {"id"} if name in REPLIES and name != "error" else set()
    if issubclass(kind, Request):
        common = {"id", "client", "session"}
    said = {row[0] for row in rows(paragraph.group())[1:]}
    assert said == {
        f"`{item.name}` ?" if item.default is None else f"`{item.name}`"
        for item in fields(kind)
        if item.name not in common
    }


@pytest.mark.parametrize(
    "number", [f"{MAX_FRAME:,}", f"{MAX_MESSAGE:,}", str(MAX_LENGTH), f"{MAX_NESTING} levels"]
)
def test_the_limits(number: str) -> None:
    assert f"| {number.replace(',', ' ')}" in section("Transport")


def test_the_patience_with_a_silent_controller() -> None:
    delays = [row[1] for row in rows(section("Control"))[1:]]
    assert delays == [f"{SILENCE:g} s", f"{EXPIRY:g} s"]


def test_the_session_is_that_of_the_vectors() -> None:
    blocks = re.findall(
        r"`([\w-]+)`, (\d+) bytes\n\n```json\n(.*?)```\n\n```hex\n(.*?)```",
        section("A session, byte by byte"),
        re.DOTALL,
    )
    shown = [
        (name, int(size), json.loads(text), "".join(code.split()))
        for name, size, text, code in blocks
    ]
    assert shown == [
        (vector["name"], len(vector["hex"]) // 2, vector["json"], vector["hex"])
        for vector in VECTORS
        if vector.get("session")
    ]


def test_links_within_the_page_lead_somewhere() -> None:
    titles = re.findall(r"^## (.*)$", SPEC, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
    assert set(re.findall(r"\(#([^)]*)\)", SPEC)) == anchors
