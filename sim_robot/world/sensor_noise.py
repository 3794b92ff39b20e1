"""Sensor noise as configuration, the same again for the same seed and interaction.

One offset is drawn per interaction (a sensor that is off by 0.3° stays off while the robot rests)
and smaller white noise per sample. Both come from (seed, number of the interaction), so a robot
that is asked again after a crash reads the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot.toml_sections import read_toml
from sim_robot.electronics.dmm32 import Dither


@dataclass(frozen=True, kw_only=True)
class NoiseLevels:
    """Root mean square values: offsets of one observation, and white noise of one sample.

    The robot announces its offsets times ``announced``: less than 1 makes it noisier than it says.
    """

    tilt_deg: float = 0.3
    clearance_mm: float = 1.0
    tilt_sample_deg: float = 0.05
    clearance_sample_mm: float = 0.3
    load_sample_n: float = 0.01
    announced: float = 1.0


NO_NOISE = NoiseLevels(
    tilt_deg=0, clearance_mm=0, tilt_sample_deg=0, clearance_sample_mm=0, load_sample_n=0
)


def load_noise(choice: str) -> NoiseLevels:
    """The levels for ``default``, ``none`` or a TOML file with the fields of ``NoiseLevels``.

    Raises:
        ConfigError: Names file, key and reason.
    """
    if choice == "default":
        return NoiseLevels()
    if choice == "none":
        return NO_NOISE
    table = read_toml(Path(choice))
    levels = {
        name: table.number(name, 0, 1e6, default) for name, default in vars(NoiseLevels()).items()
    }
    table.done()
    return NoiseLevels(**levels)


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
