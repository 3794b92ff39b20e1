"""A strain gauge's force becomes one bit: hysteresis against dithering, debounce against spikes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TouchGauge:
    """Calibration of one strain gauge.

    Attributes:
        name: The part that carries it.
        channel: Analogue input.
        tare: Volts of the free foot.
        volts_per_newton: Sensitivity; its sign is the direction of mounting.
        on: Load above which the foot touches, N.
        off: Load below which it no longer does, N.
        debounce: Consecutive samples that must agree before the bit changes.
    """

    name: str
    channel: int
    tare: float
    volts_per_newton: float
    on: float
    off: float
    debounce: int

    def force(self, volts: float) -> float:
        """Load on the foot, N."""
        return (volts - self.tare) / self.volts_per_newton


class TouchDetector:
    """The bit of one gauge, sample by sample."""

    def __init__(self, gauge: TouchGauge):
        self.gauge = gauge
        self.reset()

    def reset(self) -> None:
        """Forgets: what a foot felt in an earlier pose says nothing about this one."""
        self.touching = False
        self._against = 0

    def feed(self, volts: float) -> bool:
        """Takes one sample and returns the bit."""
        force = self.gauge.force(volts)
        wanted = force > self.gauge.off if self.touching else force > self.gauge.on
        self._against = self._against + 1 if wanted != self.touching else 0
        if self._against >= self.gauge.debounce:
            self.touching = wanted
            self._against = 0
        return self.touching
