"""The oscillators of servo boards.

The pulses of a PCA9685 are the longer, the slower its oscillator is. Their frequency tells how fast
it runs, so a person measures that at an output without a servo. The result belongs into
``robot.toml``, for the driver must know it before it commands a pulse.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final

from robot.calibration.questions import Questions
from robot.configuration.joint_calibration import middle
from robot.drivers.servos.pca9685 import OSCILLATORS_MHZ, PCA9685Settings
from robot.drivers.servos.pca9685_board import OUTPUTS
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings
from robot.errors import AbandonedError

WHY: Final = """
Servo board. Its pulses are as long as its oscillator is slow. That should run at 25 MHz, and boards
lie between 23 and 27; robot.toml has no oscillator_mhz, so pulses may be 9 % wider, or 7 %
narrower, than pulse_us says. A multimeter that shows hertz, an oscilloscope or a logic analyser
tells."""


def measure_oscillators(
    settings: ServoSettings, used: Collection[int], servos: ServoBus, dialogue: Questions
) -> None:
    """Leads through the oscillators of boards that have them, where nobody has measured them.

    Args:
        settings: Settings of the servo boards.
        used: Outputs that have a servo.
        servos: Driver of the servo boards.
        dialogue: Dialogue with the person.

    Raises:
        AbandonedError: The oscillators were measured; the message says what to write before a joint
            is calibrated. Or somebody left.
        DeviceError: A board failed when its output was let go.
    """
    if not isinstance(settings, PCA9685Settings) or settings.oscillators_mhz is not None:
        return
    dialogue.say(WHY)
    measured = []
    for index in range(len(settings.boards)):
        board_outputs = range(OUTPUTS * index, OUTPUTS * (index + 1))
        unused = [output for output in board_outputs if output not in used]
        output, servo = (
            (unused[-1], "which has no servo")
            if unused
            else (board_outputs[-1], "its servo unplugged")
        )
        prompt = f"instrument between output {output}, {servo}, and ground: Enter; or skip"
        if dialogue.choose(prompt, "", "skip"):
            return
        measured.append(settings.oscillator(_frequency(settings, output, servos, dialogue)))
    written = ", ".join(f"{mhz:.2f}" for mhz in measured)
    raise AbandonedError(
        f"Write oscillator_mhz = {f'[{written}]' if measured[1:] else written} below [servos] in "
        "robot.toml, then start again: the limits of all pulses follow from it."
    )


def _frequency(
    settings: PCA9685Settings, output: int, servos: ServoBus, dialogue: Questions
) -> float:
    """Pulse frequency of an output, Hz, as a person measures it; its count is left as it was."""

    def switch_on() -> None:
        servos.read_counts([output])  # a board that failed wants to be read before it moves
        servos.set_counts({output: middle(settings.counts)})

    count = dialogue.attempt(lambda: servos.read_counts([output]))[output]
    slowest, fastest = (10 * mhz / settings.oscillator(1.0) for mhz in OSCILLATORS_MHZ)
    least, most = math.ceil(slowest) / 10, math.floor(fastest) / 10
    try:
        if not count:
            dialogue.attempt(switch_on)
        return dialogue.number("the frequency there in Hz, to a tenth", least, most)
    finally:
        if not count:
            servos.release([output])
