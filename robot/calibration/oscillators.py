"""The oscillators of servo boards, which nothing but an instrument in a person's hands can tell.

A PCA9685 gives pulses as long as its oscillator is slow. How often it gives them says how fast that
runs, so a person measures the frequency at an output without a servo. What comes out belongs into
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
        settings: The servo boards'.
        used: Outputs that have a servo.
        servos: Their driver.
        dialogue: With whom.

    Raises:
        AbandonedError: They were measured; the sentence says what to write before a joint is. Or
            somebody left.
        DeviceError: A board failed when its output was let go.
    """
    if not isinstance(settings, PCA9685Settings) or settings.oscillators_mhz is not None:
        return
    dialogue.say(WHY)
    measured = []
    for index in range(len(settings.boards)):
        own = range(OUTPUTS * index, OUTPUTS * (index + 1))
        free = [output for output in own if output not in used]
        output, servo = (
            (free[-1], "which has no servo") if free else (own[-1], "its servo unplugged")
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
    """How often an output pulses, Hz, as a person measures it; it is left as it was."""
    before = dialogue.attempt(lambda: servos.read_counts([output]))[output]
    if not before:
        dialogue.attempt(lambda: servos.set_counts({output: middle(settings.counts)}))
    slowest, fastest = (10 * mhz / settings.oscillator(1.0) for mhz in OSCILLATORS_MHZ)
    least, most = math.ceil(slowest) / 10, math.floor(fastest) / 10
    try:
        return dialogue.number("the frequency there in Hz, to a tenth", least, most)
    finally:
        if not before:
            servos.release([output])
