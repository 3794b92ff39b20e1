"""A strain gauge: its volts with the foot free, and with one known load on it."""

from __future__ import annotations

import math
from typing import Final

from robot.calibration.questions import Questions, number
from robot.configuration.calibration_file import GaugeCalibration
from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.host.clock import Clock
from robot.sensing.samples import Spread, sample_channel
from robot.sensing.sensors import TouchPoint

SAMPLES: Final = 100
GRAVITY: Final = 9.81
LOADS: Final = (0.05, 200.0)  # N
_CLEAR_OF_NOISE: Final = 10.0  # a load must stand out of the noise by this
_QUIET: Final = 6.0  # so many times the noise below the threshold, a free foot never seems to touch
_MIN_CHANGE: Final = 2e-3  # V


class GaugeSession:
    """Leads through one gauge.

    Args:
        point: The part that carries it, and its thresholds so far.
        channel: Its analogue input.
        inputs: Those of its board.
        rate: Samples per second.
        clock: The robot clock.
        dialogue: With whom.
    """

    def __init__(
        self,
        point: TouchPoint,
        channel: int,
        inputs: AnalogueInputs,
        *,
        rate: float,
        clock: Clock,
        dialogue: Questions,
    ):
        self._point = point
        self._channel = channel
        self._inputs = inputs
        self._rate = rate
        self._clock = clock
        self._dialogue = dialogue

    def run(self) -> GaugeCalibration | None:
        """The calibration, or ``None`` if it was skipped.

        Raises:
            AbandonedError: Somebody left.
        """
        name = self._point.name
        if self._dialogue.choose(f"{name} free of any load: Enter or skip", "", "skip"):
            return None
        free = self._dialogue.attempt(self._sample)
        while True:
            load, loaded = self._dialogue.attempt(self._loaded)
            change = loaded.mean - free.mean
            if abs(change) > max(_MIN_CHANGE, _CLEAR_OF_NOISE * free.deviation):
                break
            self._dialogue.say(
                f"{load:g} N changed it by {change * 1000:.1f} mV only, with "
                f"{free.deviation * 1000:.1f} mV of noise. Is the load on this foot, and is "
                f"channel {self._channel} this gauge's? Load it again, or leave with q."
            )
        gain = change / load
        return self._thresholds(free, gain)

    def _thresholds(self, free: Spread, gain: float) -> GaugeCalibration:
        """Keeps the thresholds that are set, unless the noise would cross them."""
        noise = free.deviation / abs(gain)
        on = self._point.on
        if on < _QUIET * noise:
            on = math.ceil(_QUIET * noise * 100) / 100
            self._dialogue.say(
                f"The free foot reads {noise:.3f} N of noise, so it touches above {on:g} N "
                f"instead of {self._point.on:g} N."
            )
        share = self._point.off / self._point.on if self._point.on else 0.5
        return GaugeCalibration(tare=free.mean, volts_per_newton=gain, on=on, off=on * share)

    def _load(self) -> float:
        prompt = f"{self._point.name} with a known load: newtons, or grams as in '100 g'"
        while True:
            answer = self._dialogue.ask(prompt)
            value = number(answer.removesuffix("g"))
            if value is not None:
                load = value * GRAVITY / 1000 if answer.endswith("g") else value
                if LOADS[0] <= load <= LOADS[1]:
                    return load
            self._dialogue.say(f"Answer a load from {LOADS[0]:g} to {LOADS[1]:g} N, or q to leave.")

    def _loaded(self) -> tuple[float, Spread]:
        return self._load(), self._sample()

    def _sample(self) -> Spread:
        return sample_channel(
            self._inputs, self._channel, count=SAMPLES, rate=self._rate, clock=self._clock
        )
