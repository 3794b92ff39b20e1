"""Sensor noise as configuration, the same again for the same seed and interaction.

One offset is drawn per interaction (a sensor that is off by 0.3° stays off while the robot rests)
and smaller white noise per sample. Both come from (seed, number of the interaction), so a robot
that is asked again after a crash feels the same.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from protocol.text.toml import TomlError, parse_toml
from sim_robot.electronics.dmm32 import Dither
from sim_robot.errors import NoiseError


@dataclass(frozen=True, kw_only=True)
class NoiseLevels:
    """Root mean square values: offsets of one observation, and white noise of one sample."""

    tilt_deg: float = 0.3
    clearance_mm: float = 1.0
    tilt_sample_deg: float = 0.05
    clearance_sample_mm: float = 0.3
    load_sample_n: float = 0.01

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if (
                isinstance(value, bool)
                or not isinstance(value, int | float)
                or not 0 <= value < 1e6
            ):
                raise NoiseError(f"{item.name}: must be a number of at least 0, not {value!r}.")


NO_NOISE = NoiseLevels(
    tilt_deg=0, clearance_mm=0, tilt_sample_deg=0, clearance_sample_mm=0, load_sample_n=0
)


def load_noise(choice: str) -> NoiseLevels:
    """The levels for ``default``, ``none`` or a TOML file with the fields of ``NoiseLevels``.

    Raises:
        NoiseError: Names file, key and reason.
    """
    if choice == "default":
        return NoiseLevels()
    if choice == "none":
        return NO_NOISE
    try:
        values = parse_toml(Path(choice).read_text(encoding="utf-8"))
    except OSError as error:
        raise NoiseError(
            f"{choice}: cannot be read: {error.strerror}. Write default, none or a file."
        ) from error
    except (TomlError, UnicodeDecodeError) as error:
        raise NoiseError(f"{choice}: is not valid TOML: {error}.") from error
    known = [item.name for item in fields(NoiseLevels)]
    for key in values:
        if key not in known:
            raise NoiseError(f"{choice}: {key}: is not a known key. Known: {', '.join(known)}.")
    try:
        return NoiseLevels(**values)
    except NoiseError as error:
        raise NoiseError(f"{choice}: {error}") from error


class Noise:
    """Draws the noise of one robot."""

    def __init__(self, levels: NoiseLevels, seed: int):
        self._levels = levels
        self._seed = seed
        self._dither = Dither()
        self.begin(0)

    def begin(self, interaction: int) -> None:
        """Draws the offsets of an interaction and restarts its white noise."""
        self._dither.restart()
        self._random = np.random.default_rng([self._seed, interaction])
        levels = self._levels
        self._tilt = np.radians(levels.tilt_deg) * self._random.standard_normal(2)
        self._clearance = levels.clearance_mm / 1000 * self._random.standard_normal()

    def tilt(self) -> tuple[float, float]:
        """Error of one tilt sample (left/right, forward/back), rad."""
        white = np.radians(self._levels.tilt_sample_deg) * self._random.standard_normal(2)
        left_right, forward_back = self._tilt + white
        return float(left_right), float(forward_back)

    def clearance(self) -> float:
        """Error of one distance sample, m."""
        white = self._levels.clearance_sample_mm / 1000 * self._random.standard_normal()
        return float(self._clearance + white)

    def load(self) -> float:
        """Error of one strain gauge sample, N."""
        return float(self._levels.load_sample_n * self._random.standard_normal())

    def dither(self) -> float:
        """Error of the converter in one scan, V; it is there without any level of noise, too."""
        return self._dither.next_scan()
