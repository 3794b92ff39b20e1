"""``estimator doctor``: whether a robot can be identified, and why not; what a problem can tell."""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Iterator
from contextlib import closing
from importlib import metadata
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.text import Text

from estimator.cli.console import errors_as_sentences, out
from estimator.cli.findings import ExaminedItem, Fitness, bad, fine, note
from estimator.cli.options import Keys
from estimator.readings.modalities import MODALITIES, check_modalities
from protocol.errors import (
    CLEAR,
    HOLD,
    BodyschemaError,
    RobotError,
    RobotUnreachableError,
    with_address,
)
from protocol.rules.control import HEARTBEAT
from protocol.security.keys import KeyDirectory
from protocol.transport.client import RobotClient
from protocol.transport.connection_probe import Obstacle, probe
from protocol.transport.telemetry import TelemetrySubscriber
from protocol.wire.capabilities import Capabilities
from protocol.wire.messages import ObservationReply, Status


def doctor(
    *,
    robot: Annotated[
        str | None, typer.Option(help="tcp://HOST:PORT: robotd, or sim-robotd.")
    ] = None,
    problem: Annotated[
        str | None, typer.Option(help="A shipped problem by name, or a .toml file; needs no robot.")
    ] = None,
    modalities: Annotated[
        str,
        typer.Option(help="With --problem: sensors that count, as of --modalities of identify."),
    ] = ",".join(MODALITIES),
    keys: Keys = None,
) -> None:
    """Find out whether a robot, and a problem, can be identified, and why not; moves nothing."""
    if robot is None and problem is None:
        raise typer.BadParameter("give --robot, --problem, or both")
    verdicts: list[Fitness] = []
    with errors_as_sentences(None):
        if robot is not None:
            verdicts += [_print_finding(finding) for finding in examine(robot, keys)]
        if problem is not None and Fitness.BAD not in verdicts:
            counted = check_modalities([name.strip() for name in modalities.split(",")])
            capabilities = None if robot is None else _capabilities(robot, keys)
            examine_problem = importlib.import_module(
                "estimator.cli.problem_doctor"
            ).examine_problem
            verdicts += [
                _print_finding(item) for item in examine_problem(problem, capabilities, counted)
            ]
    if Fitness.BAD in verdicts:
        raise typer.Exit(1)


def _print_finding(finding: ExaminedItem) -> Fitness:
    colour = {Fitness.FINE: "green", Fitness.NOTE: "yellow", Fitness.BAD: "red"}[finding.verdict]
    line = Text.assemble(
        (f"{finding.verdict.value:<6}", colour), f"{finding.subject:<13}", finding.sentence
    )
    out.print(line, soft_wrap=True)
    return finding.verdict


ROUND_TRIPS: Final = 100
SLOW: Final = 0.05
"""Longest round trip that is not worth a note, s."""

_PATIENCE: Final = 5.0  # s to wait for an answer or a publication
_MAX_DRIFT: Final = 0.02  # largest drift of a clock against another, as a share
_VIRTUAL: Final = 0.25  # smallest drift of a clock that is not meant to keep wall time, as a share
_JITTER: Final = 0.5  # s by which answers may be held up on a busy computer
_CALM_STATES: Final = ("idle", "holding")
_KEY_OBSTACLES: Final = (
    Obstacle.KEYS_WANTED,
    Obstacle.NO_KEYS_THERE,
    Obstacle.OTHER_ROBOT,
    Obstacle.UNKNOWN_KEY,
)


def examine(uri: str, keys: Path | None = None) -> Iterator[ExaminedItem]:
    """Checks a robot, from the network up; ends early where further checks are impossible.

    Args:
        uri: Address of the robot, ``tcp://host:port``.
        keys: The key directory, where the robot asks for keys.

    Raises:
        EndpointError: ``uri`` is no address of a daemon.
        KeysError: The key directory cannot be used.
    """
    link = probe(uri, KeyDirectory(keys).client_keys() if keys is not None else None)
    if link.obstacle in _KEY_OBSTACLES:
        yield fine("reachability", f"{uri} answers.")
        yield bad("keys", link.sentence)
        return
    if not link.fine:
        yield bad("reachability", link.sentence)
        return
    yield fine("reachability", link.sentence)
    try:
        client = RobotClient(uri, keys=keys, timeout=_PATIENCE, software="estimator doctor")
    except RobotError as error:
        subject = "version" if error.code == "unsupported_version" else "session"
        yield bad(subject, f"{error.message} {error.advice}")
        return
    except RobotUnreachableError as error:
        yield bad("session", str(error))
        return
    with closing(client):
        yield _role(client, with_keys=keys is not None)
        yield _version(client)
        yield _robot(client)
        try:
            yield _latency(client)
            status = client.status()
            yield _control(status, client)
            yield _state(status, uri)
            if status.state in _CALM_STATES:
                yield from _freshness(client)
        except BodyschemaError as error:
            yield bad("connection", str(error))
            return
        yield _telemetry(client, keys)


def _role(client: RobotClient, *, with_keys: bool) -> ExaminedItem:
    try:
        client.release()
    except RobotError as error:
        if error.code == "unauthorised":
            return bad(
                "keys",
                f"{error.message} To identify the robot, this key needs the role controller there.",
            )
    if with_keys:
        return fine("keys", "The robot knows this key, as a controller's.")
    return fine("keys", "The robot asks for none: who can reach it can control it.")


def _version(client: RobotClient) -> ExaminedItem:
    theirs, ours = client.capabilities.software, f"bodyschema {metadata.version('bodyschema')}"
    if theirs == ours:
        return fine("version", f"Both sides run {ours}.")
    return note("version", f"The robot runs {theirs}, this is {ours}.")


def _robot(client: RobotClient) -> ExaminedItem:
    capabilities = client.capabilities
    missing = [modality for modality in MODALITIES if capabilities.sensor(modality) is None]
    senses = [sensor.modality for sensor in capabilities.sensors]
    joints = f"{capabilities.robot}: {len(capabilities.joints)} joints"
    if not senses:
        return bad("robot", f"{joints}; it has no sensors, so nothing is learnt.")
    sentence = f"{joints}; senses {', '.join(senses)}"
    if missing:
        return note("robot", f"{sentence}, but not {', '.join(missing)}.")
    return fine("robot", f"{sentence}.")


def _latency(client: RobotClient) -> ExaminedItem:
    waits = []
    for _ in range(ROUND_TRIPS):
        started = time.perf_counter()
        client.status()
        waits.append(time.perf_counter() - started)
    waits.sort()
    sentence = (
        f"{ROUND_TRIPS} round trips: median {waits[ROUND_TRIPS // 2] * 1000:.1f} ms, "
        f"99 % within {waits[ROUND_TRIPS * 99 // 100 - 1] * 1000:.1f} ms, "
        f"longest {waits[-1] * 1000:.1f} ms."
    )
    if waits[-1] > HEARTBEAT:
        return bad(
            "latency", f"{sentence} The robot needs a sign of life each second: mend the network."
        )
    return note("latency", sentence) if waits[-1] > SLOW else fine("latency", sentence)


def _control(status: Status, client: RobotClient) -> ExaminedItem:
    if status.controller in (None, client.client_id):
        return fine("control", "Nobody holds the robot.")
    return bad(
        "control",
        f"Client {status.controller} holds the robot: wait until it releases, or ask its owner.",
    )


def _state(status: Status, uri: str) -> ExaminedItem:
    reason = f" ({status.reason})" if status.reason else ""
    sentence = f"The robot is {status.state}{reason}."
    if status.state in _CALM_STATES:
        return fine("state", sentence)
    advice = {
        "stopped": f"Make sure that it is safe, then: {CLEAR}",
        "fault": f"Mend the cause, then: {CLEAR}",
        "relaxed": f"Hold it first: {HOLD}",
    }.get(status.state, "Wait for the end of its motion.")
    return bad("state", f"{sentence} {with_address(advice, uri)}")


def _freshness(client: RobotClient) -> Iterator[ExaminedItem]:
    """Reads twice: are the readings fresh, and do the clocks agree?"""
    try:
        first, heard_first = client.read(), time.monotonic()
        client.status()
        second, heard_second = client.read(), time.monotonic()
    except RobotError as error:
        yield bad("freshness", f"It cannot be read: {error}")
        return
    if second.robot_time < first.robot_time or second.monotonic <= first.monotonic:
        yield bad("freshness", "A second reading is not younger than the first.")
        return
    yield fine(
        "freshness",
        f"Readings are fresh: {first.sequence}, then {second.sequence}, "
        f"each an average of {second.samples} samples.",
    )
    yield _clock(first, second, heard_second - heard_first)


def _clock(first: ObservationReply, second: ObservationReply, elapsed: float) -> ExaminedItem:
    robot_elapsed = second.monotonic - first.monotonic
    if not math.isclose(robot_elapsed, elapsed, rel_tol=_MAX_DRIFT, abs_tol=_JITTER):
        return bad(
            "clock",
            f"Between two readings {elapsed:.3f} s passed here and {robot_elapsed:.3f} s at the "
            "robot: one of the clocks is wrong, or the readings were held up.",
        )
    virtual_elapsed = second.robot_time - first.robot_time
    if not math.isclose(virtual_elapsed, robot_elapsed, rel_tol=_VIRTUAL):
        return fine(
            "clock",
            f"The robot's time is virtual: {virtual_elapsed:.3f} s passed there in "
            f"{robot_elapsed:.3f} s.",
        )
    return fine("clock", f"Clocks agree to {abs(robot_elapsed - elapsed) * 1000:.1f} ms.")


def _telemetry(client: RobotClient, keys: Path | None) -> ExaminedItem:
    rate = client.capabilities.telemetry_rate
    uri = client.telemetry_endpoint
    try:
        with TelemetrySubscriber(uri, keys=keys) as subscriber:
            subscriber.next(max(_PATIENCE, 3.0 / rate))
            started = time.monotonic()
            subscriber.next(max(_PATIENCE, 3.0 / rate))
            waited = time.monotonic() - started
    except BodyschemaError:
        return bad(
            "telemetry",
            f"Nothing is heard at {uri}, although requests are answered: is that port open, too?",
        )
    sentence = f"Publications come at {uri}, the last after {waited:.2f} s of {1 / rate:.2f} s."
    is_late = waited > 2.0 / rate + _JITTER
    return note("telemetry", sentence) if is_late else fine("telemetry", sentence)


def _capabilities(uri: str, keys: Path | None) -> Capabilities:
    with closing(RobotClient(uri, keys=keys, timeout=_PATIENCE)) as client:
        return client.capabilities
