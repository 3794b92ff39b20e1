"""Noise: configured, seeded, repeatable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot.errors import ConfigError
from sim_robot.simulator.electronics_sets import pc104
from sim_robot.world.body import body_path, load_body
from sim_robot.world.sensor_noise import NO_NOISE, Noise, NoiseLevels, load_noise


def test_the_same_interaction_feels_the_same_again() -> None:
    first, second = Noise(NoiseLevels(), 3), Noise(NoiseLevels(), 3)
    first.begin(7)
    values = (first.tilt(), first.clearance(), first.load())
    second.begin(6)
    second.tilt()
    second.begin(7)
    assert (second.tilt(), second.clearance(), second.load()) == values
    second.begin(8)
    assert second.tilt() != values[0]


def test_offsets_have_the_announced_size() -> None:
    noise = Noise(NoiseLevels(tilt_sample_deg=0, clearance_sample_mm=0), 1)
    tilts: list[float] = []
    clearances: list[float] = []
    for interaction in range(2000):
        noise.begin(interaction)
        tilts += noise.tilt()
        clearances.append(noise.clearance())
    assert np.degrees(np.std(tilts)) == pytest.approx(0.3, rel=0.05)
    assert np.std(clearances) == pytest.approx(0.001, rel=0.06)


def test_none_is_none() -> None:
    noise = Noise(load_noise("none"), 1)
    assert noise.tilt() == (0.0, 0.0)
    assert noise.clearance() == 0.0
    assert load_noise("none") == NO_NOISE


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("tilt = 1", "noise.toml: tilt: is not a known key. Did you mean 'tilt_deg'"),
        ("tilt_deg = -1", "tilt_deg: must be a number from 0 to .* degrees, not -1"),
        ("tilt_deg =", "TOML"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, word: str) -> None:
    file = tmp_path / "noise.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=word):
        load_noise(str(file))


def test_a_file_sets_what_it_names(tmp_path: Path) -> None:
    file = tmp_path / "noise.toml"
    file.write_text("tilt_deg = 1.5\n")
    assert load_noise(str(file)) == NoiseLevels(tilt_deg=1.5)
    with pytest.raises(ConfigError, match="cannot be read"):
        load_noise("loud")


@pytest.mark.parametrize("value", ["[" * 5000, "9" * 400, "9" * 5000])
def test_what_no_parser_should_meet_is_a_sentence(tmp_path: Path, value: str) -> None:
    file = tmp_path / "noise.toml"
    file.write_text(f"tilt_deg = {value}")
    with pytest.raises(ConfigError, match="is not valid TOML"):
        load_noise(str(file))


def test_a_robot_may_be_noisier_than_it_says() -> None:
    body = load_body(body_path("three_legs"))
    levels = NoiseLevels(tilt_deg=0.9, clearance_mm=3.0, announced=1 / 3)
    announced = pc104(body, levels).noise
    assert np.degrees(announced.tilt) == pytest.approx(0.3)
    assert announced.clearance == pytest.approx(0.001)
