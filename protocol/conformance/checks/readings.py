"""Checks of sections 7 to 11: what the robot says, and what it publishes."""

from __future__ import annotations

import math
import time
from itertools import pairwise
from typing import Any, Final

import zmq

from protocol.conformance.raw_connection import Failed, Map, Skipped, expect, said
from protocol.conformance.registry import Need, check
from protocol.conformance.robot_under_test import RobotUnderTest
from protocol.errors import BodyschemaError, RemoteProtocolError
from protocol.sockets.zmq_sockets import Endpoint, connected
from protocol.text import brief
from protocol.transport.telemetry import TOPIC
from protocol.wire.capabilities import Capabilities
from protocol.wire.codec import decode
from protocol.wire.messages import parse_telemetry

_ATTEMPTS: Final = 3  # attempts at the rate: this computer may have had something else to do


def _reads(robot: RobotUnderTest, count: int = 1) -> tuple[Capabilities, list[Map]]:
    client = robot.client()
    capabilities = Capabilities.from_map(client.hello()["capabilities"])
    observations = []
    for _ in range(count):
        reply = client.ask("read")
        if reply["type"] != "observation":
            raise Skipped(f"A read is answered with {said(reply)} now.")
        observations.append(reply)
    return capabilities, observations


@check("7.1", "1.11")
def fields_of_replies(robot: RobotUnderTest) -> None:
    """Replies have their fields, with their types and ranges."""
    client = robot.client()  # welcome and capabilities; a line takes nothing else for a reply
    client.status()
    client.ask("read")
    client.ask("dance")


@check("7.5")
def final_replies_come_once(robot: RobotUnderTest) -> None:
    """Final replies come once, and nothing after them."""
    client = robot.client()
    noted = robot.noted["7.5"]
    expect(not noted, "; ".join(noted[:3]) + ".")
    read = client.request("read")
    interim, _ = client.answer_to(read)
    kinds = [reply["type"] for reply in interim]
    expect("accepted" not in kinds[1:], f"A read was answered with {', '.join(kinds)}.")
    extra = client.connection.reply(read["id"], patience=0.3)
    expect(extra is None, f"After its end, a read was answered with {said(extra)}.")


@check("7.6")
def ids_of_replies(robot: RobotUnderTest) -> None:
    """Every reply has the id of its request."""
    client = robot.client()
    beats = [client.request("heartbeat", id=number) for number in (5, 3, 2**53 - 1, 0)]
    for beat in beats:
        client.connection.send(beat)
    for beat in reversed(beats):
        reply = client.connection.reply(beat["id"])
        expect(reply is not None, f"A heartbeat with id {beat['id']} has no answer with this id.")


@check("7.7")
def observations_fit(robot: RobotUnderTest) -> None:
    """Readings and angles fit the capabilities."""
    state = robot.client().status()["state"]
    capabilities, (observation,) = _reads(robot)
    stiff = {joint.name for joint in capabilities.joints if state != "relaxed"}
    expect(
        observation["angles"].keys() == stiff,
        f"A robot that is {state} has angles of {', '.join(observation['angles']) or 'nothing'}.",
    )
    for modality in ("touch", "tilt", "clearance"):
        sensor = capabilities.sensor(modality)
        reading = observation.get(modality)
        expect(
            (sensor is None) == (reading is None),
            f"A {modality} sensor is {'absent' if sensor is None else 'there'}, "
            f"and its reading is {reading}.",
        )
        if sensor is not None and isinstance(reading, list):
            expect(
                len(reading) == sensor.count,
                f"{modality} has {len(reading)} values instead of {sensor.count}.",
            )


@check("7.8")
def sequences_grow(robot: RobotUnderTest) -> None:
    """Each observation has a larger sequence, and status knows the latest."""
    _, observations = _reads(robot, 4)
    sequences = [observation["sequence"] for observation in observations]
    expect(
        all(before < after for before, after in pairwise(sequences)),
        f"Four reads have the sequences {sequences}.",
    )
    status = robot.client().status()
    expect(
        status["sequence"] >= sequences[-1],
        f"status says {status['sequence']} after observation {sequences[-1]}.",
    )


@check("7.10")
def measured_angles(robot: RobotUnderTest) -> None:
    """The joints that are announced as measured are measured, and no others."""
    capabilities, (observation,) = _reads(robot)
    announced = {j.name for j in capabilities.joints if j.measured_noise is not None}
    measured, off = observation.get("measured"), observation.get("off_target")
    expect(
        (measured or {}).keys() == announced and (measured is None) == (not announced),
        f"measured is {brief(repr(measured))}, and announced {', '.join(announced) or 'nothing'}.",
    )
    stray = sorted((off or {}).keys() - announced)
    expect(not stray and off != {}, f"off_target names {', '.join(stray) or 'nothing'} unmeasured.")


@check("7.11")
def no_zero_pose_in_a_read(robot: RobotUnderTest) -> None:
    """A read, which moves nothing, has no tilt of the zero pose."""
    _, (observation,) = _reads(robot)
    expect("zero_tilt" not in observation, "A read has a zero_tilt.")


@check("9.1")
def tilt(robot: RobotUnderTest) -> None:
    """Tilt lies in ±π/2, and within what one body can have."""
    _, (observation,) = _reads(robot)
    if "tilt" not in observation:
        raise Skipped("The robot does not feel tilt.")
    left, forward = observation["tilt"]
    expect(
        max(abs(left), abs(forward)) <= math.pi / 2 + 1e-6, f"The tilt is {left}, {forward} rad."
    )
    # u is a unit vector: no body shows more of it. Two noisy angles may overshoot a little.
    total = math.sin(left) ** 2 + math.sin(forward) ** 2
    expect(total <= 1.05, f"No body has the tilt {left}, {forward} rad.")


@check("9.2")
def clearance(robot: RobotUnderTest) -> None:
    """Clearance never exceeds the sensor's upper, and is saturated exactly there."""
    capabilities, (observation,) = _reads(robot)
    sensor = capabilities.sensor("clearance")
    if sensor is None:
        expect(not observation["clearance_saturated"], "clearance_saturated without a sensor.")
        raise Skipped("The robot does not feel clearance.")
    distance = observation["clearance"]
    upper = math.inf if sensor.upper is None else sensor.upper
    expect(distance <= upper + 1e-9, f"The clearance is {distance} m, beyond {upper} m.")
    at_the_end = math.isclose(distance, upper, abs_tol=1e-9)
    expect(
        observation["clearance_saturated"] == at_the_end,
        f"clearance {distance} m of {upper} m has saturated {observation['clearance_saturated']}.",
    )


@check("10.1")
def clocks(robot: RobotUnderTest) -> None:
    """No clock runs backwards."""
    client = robot.client()
    _, observations = _reads(robot, 2)
    times = [
        client.status()["robot_time"],
        *(_reads(robot, 1)[1][0]["robot_time"] for _ in range(2)),
        client.status()["robot_time"],
        client.hello()["robot_time"],
    ]
    expect(times == sorted(times), f"robot_time went {times}.")
    monotonic = [observation["monotonic"] for observation in observations]
    expect(monotonic == sorted(monotonic), f"monotonic went {monotonic}.")


def _publications(robot: RobotUnderTest, seconds: float) -> tuple[float, list[list[bytes]], float]:
    """The promised rate, what was published, and the time in which it was (s)."""
    capabilities = robot.capabilities()
    settings = robot.settings
    try:
        place = Endpoint.parse(capabilities.telemetry).seen_from(settings.uri)
    except BodyschemaError as error:
        raise Failed(f"telemetry: {error}") from None
    options: dict[int, Any] = {zmq.SUBSCRIBE: b"", zmq.RCVTIMEO: 1000}
    subscriber = connected(robot.context, zmq.SUB, str(place), settings.keys, options)
    published: list[list[bytes]] = []
    try:
        patience = max(settings.patience, 3.0 / capabilities.telemetry_rate)
        if not subscriber.poll(math.ceil(patience * 1000)):
            raise Failed(f"Nothing is published at {place}.")
        begun = time.monotonic()
        subscriber.recv_multipart()
        while (remaining := begun + seconds - time.monotonic()) > 0:
            if subscriber.poll(math.ceil(remaining * 1000)):
                published.append(subscriber.recv_multipart())
        if not published and subscriber.poll(math.ceil(patience * 1000)):  # 11.2 judges that
            published.append(subscriber.recv_multipart())
        return capabilities.telemetry_rate, published, time.monotonic() - begun
    finally:
        subscriber.close()


@check("11.1", "11.3")
def publications(robot: RobotUnderTest) -> None:
    """Publications are the topic and a valid frame, and tell what status tells."""
    client = robot.client()
    before = client.status()
    rate = robot.capabilities().telemetry_rate
    _, published, _ = _publications(robot, 1.5 / rate)
    after = client.status()
    expect(bool(published), "Nothing but the first publication came.")
    for parts in published:
        expect(len(parts) == 2, f"A publication has {len(parts)} parts instead of two.")
        expect(parts[0] == TOPIC, f"A publication has the topic {parts[0]!r:.40}.")
        try:
            telemetry = parse_telemetry(decode(parts[1]))
        except RemoteProtocolError as error:
            raise Failed(f"A publication is invalid: {error}") from None
        if before["state"] == after["state"]:
            expect(telemetry.state == before["state"], f"Published is the state {telemetry.state}.")


@check("11.2", after=("11.1",))
def publication_rate(robot: RobotUnderTest) -> None:
    """Publications keep the rate that welcome promises, within a factor of two."""
    rate = robot.capabilities().telemetry_rate
    for _ in range(_ATTEMPTS):
        _, published, seconds = _publications(robot, min(max(4.0 / rate, 0.3), 10.0))
        measured = len(published) / seconds
        if 0.5 <= measured / rate <= 2.0:
            return
    raise Failed(f"They come at {measured:.2f} Hz, not {rate:g} Hz.")


@check("8.1", need=Need.NOTHING)
def error_table(robot: RobotUnderTest) -> None:
    """Errors have a code of the table, and its retryable."""
    client = robot.client()
    client.ask("dance")
    client.ask("read", session="no such session")
    noted = robot.noted["8.1"]
    expect(not noted, "; ".join(noted[:3]) + ".")
