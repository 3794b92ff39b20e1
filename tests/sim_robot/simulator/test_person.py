"""The simulated person measures the world and not the electronics."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

import pytest

from robot.errors import CommandError
from sim_robot.simulator.daemon import Emulation, emulation
from sim_robot.simulator.person import PROTRACTOR, UNEVEN, SimulatedPerson
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NO_NOISE

BODY = load_body(default_body_path())


@pytest.fixture
def parts() -> Iterator[Emulation]:
    with emulation(
        BODY, seed=0, levels=NO_NOISE, real_time=False, log=logging.getLogger("test"), wrong=8
    ) as emulated:
        yield emulated


@pytest.fixture
def person(parts: Emulation) -> SimulatedPerson:
    return SimulatedPerson(parts, seed=1, echo=lambda text: None)


def test_the_protractor_shows_the_real_angle(parts: Emulation, person: SimulatedPerson) -> None:
    person.ask("on the stand: Enter")
    parts.devices.servos.read_counts([3])
    parts.devices.servos.set_counts({3: 150})
    readings = [
        float(person.ask("hip_right at its new 0°: the angle measured, or Enter"))
        for _ in range(20)
    ]
    real = math.degrees(parts.world.angles()[2])
    assert real == pytest.approx(math.degrees(parts.truth.joints[2].scale.angle(150)), abs=0.01)
    assert all(abs(reading - real) <= PROTRACTOR + 1e-9 for reading in readings)
    assert len(set(readings)) > 1


@pytest.mark.parametrize(
    ("position", "up"),
    [("nose up", (1, 0, 0)), ("left side down", (0, -1, 0)), ("upside down", (0, 0, -1))],
)
def test_the_body_is_held_as_asked(
    parts: Emulation, person: SimulatedPerson, position: str, up: tuple[float, ...]
) -> None:
    person.ask(f"{position}, hold it still, then Enter")
    leans = math.degrees(math.acos(sum(a * b for a, b in zip(parts.world.up(), up, strict=True))))
    assert 0 < leans < math.hypot(UNEVEN, UNEVEN)


def test_only_the_foot_in_question_is_loaded(parts: Emulation, person: SimulatedPerson) -> None:
    person.ask("lower_front free of any load: Enter or skip")
    assert not any(parts.world.loads())
    assert person.ask("lower_front with a known load: newtons, or grams as in '100 g'") == "200 g"
    assert parts.world.loads() == pytest.approx((0, 1.962, 0, 0))


def test_plate_and_ground(parts: Emulation, person: SimulatedPerson) -> None:
    person.ask("plate at 80 mm, 1 of 16: Enter")
    assert parts.world.belly_ray() == pytest.approx(0.08, abs=1e-4)


def test_what_was_never_asked_is_not_understood(person: SimulatedPerson) -> None:
    with pytest.raises(CommandError, match="favourite colour"):
        person.ask("your favourite colour")
