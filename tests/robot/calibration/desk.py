"""What guided sessions are tested with: somebody who answers from a list, and a servo board."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from robot.drivers.links.analogue_inputs import AnalogueInputs
from robot.errors import DeviceTimeoutError
from tests.robot.clocks import InstantClock

Answer = str | tuple[Callable[[], None], str]


class Script:
    """Answers from a list; an answer may first do something. Afterwards the input ends."""

    def __init__(self, *answers: Answer):
        self.prompts: list[str] = []
        self.said: list[str] = []
        self._answers = list(answers)

    @property
    def left(self) -> int:
        return len(self._answers)

    def say(self, text: str) -> None:
        self.said.append(text)

    def ask(self, prompt: str) -> str:
        self.prompts.append(prompt)
        if not self._answers:
            raise EOFError
        answer = self._answers.pop(0)
        if isinstance(answer, tuple):
            act, answer = answer
            act()
        return answer

    def heard(self, words: str) -> bool:
        return any(words in text for text in self.said)


@dataclass
class Board:
    """A servo board in memory that writes down what it was sent, and when."""

    clock: InstantClock = field(default_factory=InstantClock)
    name = "desk"
    repeats = 0
    counts: dict[int, int] = field(default_factory=lambda: dict.fromkeys(range(1, 9), 128))
    sent: list[tuple[float, int, int]] = field(default_factory=list)
    failures: int = 0

    def set_counts(self, counts: Mapping[int, int]) -> None:
        if self.failures:
            self.failures -= 1
            raise DeviceTimeoutError("It took no bytes.", "Look at it.")
        self.clock.sleep(0.02)  # the line takes so long
        for output, count in counts.items():
            self.counts[output] = count
            self.sent.append((self.clock.now(), output, count))

    def read_counts(self, outputs: Sequence[int]) -> dict[int, int]:
        return {output: self.counts[output] for output in outputs}

    def release(self, outputs: Iterable[int]) -> None:
        self.counts |= dict.fromkeys(outputs, 0)

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        return [output for output, count in expected.items() if self.counts[output] != count]

    def forget(self) -> None:
        """Everything is sent every time."""

    def seconds_for(self, changed: int) -> float:
        return 0.01 * changed

    def reopen(self) -> None:
        """There is no link."""

    def close(self) -> None:
        """There is no link."""


class Inputs:
    """A data acquisition board with some noise, ±5 V; a test sets the volts."""

    RAILS = (-5.0, 5.0)

    def __init__(self, *volts: float, noise: float = 1e-4):
        self.volts = list(volts)
        self.noise = noise
        self._random = random.Random(1)

    def probe(self) -> None:
        """They are there."""

    def close(self) -> None:
        """There is no link."""

    def scan(self, low: int, high: int) -> list[float]:
        noisy = [volts + self._random.gauss(0, self.noise) for volts in self.volts[low : high + 1]]
        return [min(max(volts, self.RAILS[0]), self.RAILS[1]) for volts in noisy]

    def connected(self, names: Mapping[int, str]) -> AnalogueInputs:
        """Its inputs, those of some channels connected."""
        inputs = AnalogueInputs(self, name="DAQ", rails=self.RAILS, clock=InstantClock())
        inputs.connect(names)
        return inputs
