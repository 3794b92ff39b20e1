"""The rows of the fault matrix that are about the chips on an I²C bus: ``--electronics pi``."""

from __future__ import annotations

from typing import Final

from tests.faults.devices import (
    CLEAR,
    FREEZES,
    NO_READING,
    SET_AGAIN,
    device,
    lost_acknowledges,
    unnoticed,
)
from tests.faults.matrix import AT_ONCE, DeviceRow

SWITCHED_ON: Final = (
    "`clear` works at once: it sets the board up as at power-up, and switches the servos on where "
    "they were last sent; they go there at their own speed."
)
AT_START: Final = (
    "not before the next start or `clear`, which identify and test the chip and are refused then"
)

NOT_AS_SET_UP: Final = "does not run as it was set up"


def altered(
    fault: str,
    spec: str,
    does: str = "reads it back before the next move, stops and writes nothing",
    words: str = "",
    back: str = SWITCHED_ON,
    *,
    limp: bool = False,
) -> tuple[DeviceRow, DeviceRow]:
    """A servo board that was altered behind the daemon's back, while moving and while idle."""
    return (
        device(
            f"{fault}, while moving",
            spec,
            does,
            words,
            back,
            after=0.4,
            lasts=False,
            limp=limp,
        ),
        device(
            f"{fault}, while idle",
            spec,
            "notices before it moves, at the next request (on a real robot: within 3 s)",
            words,
            back,
            lasts=False,
            mended_first=True,
            limp=limp,
        ),
    )


PI_DEVICES: Final = {
    "Servo board on I²C (PCA9685)": (
        device(
            "no acknowledge while moving",
            "pwm.nak",
            "makes each transfer three times, then "
            + FREEZES
            + " (the board goes on with its pulses)",
            "Nothing acknowledges",
            after=0.4,
        ),
        device(
            "every third transfer is not acknowledged",
            "pwm.nak=3",
            "makes it again: nothing is lost",
            "(an observation)",
            "By itself.",
            code=None,
        ),
        device(
            "every third transfer is carried out and its acknowledge lost",
            "pwm.unheard=3",
            "makes it again: a pulse that is commanded twice is the same pulse",
            "(an observation)",
            "By itself.",
            code=None,
        ),
        device("bus hangs while moving", "pwm.hang", FREEZES, "The I²C bus hangs", after=0.4),
        device(
            "writes are acknowledged and lost, while moving",
            "pwm.lost=1",
            "reads the board's registers back before each move, and stops at the next one",
            "does not have the commands",
            AT_ONCE,
            after=0.4,
            lasts=False,
        ),
        *altered(
            "reset",
            "pwm.reset",
            "reads all that pulses depend on (PRE_SCALE, MODE1, MODE2, each output) back before "
            "each move, and stops at once. A board that was reset sleeps: it gives no pulses, so "
            "nothing leaps",
            NOT_AS_SET_UP,
            limp=True,
        ),
        *altered("put to sleep by another program", "pwm.sleep", words=NOT_AS_SET_UP, limp=True),
        *altered(
            "put to sleep and woken by another program, which does not restart the outputs",
            "pwm.doze",
            words="MODE1 is 0xa1 instead of 0x21; its outputs are off and the joints limp",
            limp=True,
        ),
        *altered(
            "another program sets PRE_SCALE: all joints leap at once",
            "pwm.prescale=60",
            "reads it back before the next move, stops and writes nothing: putting PRE_SCALE right "
            "would make them leap again",
            "PRE_SCALE is 0x3c instead of 0x79; its pulses are 0.50 times as long",
        ),
        *altered(
            "another program inverts the outputs",
            "pwm.mode2=20",
            words="MODE2 is 0x14 instead of 0x04",
        ),
        *altered(
            "another program moves a joint",
            "pwm.moved=1",
            "reads it back before the next move, stops and writes nothing: sending the joint back "
            "would make it leap again",
            "does not have the commands",
            "`clear` works at once; motion goes on from where the board has the joint now.",
        ),
        *altered(
            "another program switches an output fully on: a level, no pulses",
            "pwm.full_on=2",
            words="does not have the commands",
            limp=True,
        ),
        *altered(
            "another program switches all outputs off",
            "pwm.all_off",
            words="does not have the commands",
            limp=True,
        ),
    ),
    "Analogue inputs on I²C (ADS1115)": (
        device(
            "no acknowledge",
            "adc.nak",
            "makes each transfer three times, then " + NO_READING,
            "Nothing acknowledges",
        ),
        *lost_acknowledges("adc"),
        device("bus hangs", "adc.hang", NO_READING, "The I²C bus hangs"),
        device("a conversion never ends", "adc.busy", NO_READING, "did not end a conversion"),
        device(
            "a foot's input is railed",
            "adc.railed_channel=1",
            NO_READING,
            "is at the end of its range",
        ),
        unnoticed(
            "a foot's input is stuck",
            "adc.stuck_channel=1",
            "nothing: this converter is so quiet that a foot in the air may always give one code",
            "**not noticed** (an observation)",
            "`robotd try` and `robotd calibrate` show it; look at the resistor and the wires.",
        ),
        unnoticed(
            "reset while moving",
            "adc.reset",
            "nothing: every conversion brings its settings, and reads them back before the result",
            "(an observation)",
            "By itself.",
            after=0.4,
        ),
        unnoticed(
            "another program uses its comparator, and converts on and on, while moving",
            "adc.comparing",
            "likewise; the thresholds, by which the chip is known, are set anew by every start",
            "(an observation)",
            "By itself.",
            after=0.4,
        ),
    ),
    "Accelerometer on I²C (MPU-6050)": (
        device(
            "no acknowledge",
            "accelerometer.nak",
            "makes each transfer three times, then " + NO_READING,
            "Nothing acknowledges",
        ),
        *lost_acknowledges("accelerometer"),
        device("bus hangs", "accelerometer.hang", NO_READING, "The I²C bus hangs"),
        device(
            "an axis is stuck",
            "accelerometer.stuck_axis=0",
            "notices the same code 20 samples running (its noise is some 40 codes), and gives no "
            "observation",
            "x axis is stuck",
        ),
        device(
            "an axis is at the end of its range",
            "accelerometer.railed_axis=1",
            NO_READING,
            "at the end of its range, 2 g",
        ),
        device(
            "reset while moving: it sleeps",
            "accelerometer.reset",
            NO_READING,
            "was reset: it sleeps",
            "`clear` sets it up and tests it again.",
            after=0.4,
            lasts=False,
        ),
        device(
            "put to sleep by another program while moving: it repeats its last sample",
            "accelerometer.sleep",
            "reads its power register with every sample, and gives no observation",
            "The MPU-6050 sleeps",
            "`clear` sets it up and tests it again.",
            after=0.4,
            lasts=False,
        ),
        device(
            "another program sets its range to ±8 g while moving",
            "accelerometer.reranged",
            "reads range, filter, rate and offsets back with every sample, and gives no "
            "observation. What was left before the start ends with the reset of every start",
            "does not measure as it was set up",
            SET_AGAIN,
            after=0.4,
            lasts=False,
        ),
        unnoticed(
            "an axis is worn: it moves by 70 % of what it should in the self-test",
            "accelerometer.weak=1",
            AT_START,
            "(an observation)",
            CLEAR,
        ),
        unnoticed(
            "another chip is in its place",
            "accelerometer.other=152",
            AT_START,
            "(an observation)",
            CLEAR,
        ),
        unnoticed(
            "a copy of the chip, without factory trim, is in its place",
            "accelerometer.untrimmed",
            AT_START,
            "(an observation)",
            CLEAR,
        ),
    ),
}
"""Faults of these chips, by section; the distance sensor's are those of ``devices``."""

GPIO_DEVICES: Final[dict[str, tuple[DeviceRow, ...]]] = {
    "Foot switches on GPIO lines": (
        device(
            "the chip is unplugged while moving",
            "gpio.unplugged",
            NO_READING,
            "cannot be read: No such device",
            "Plug it in and `clear`, which takes the lines anew.",
            after=0.4,
        ),
        unnoticed(
            "a wire has come off",
            "gpio.broken=22",
            "nothing: an open line looks like an open switch",
            "**not noticed** (an observation)",
            "`robotd try` shows it: press each foot.",
        ),
        unnoticed(
            "a wire touches ground",
            "gpio.short=17",
            "nothing: it looks like a pressed switch",
            "**not noticed** (an observation)",
            "`robotd try` shows it: lift each foot.",
        ),
    ),
}
"""Faults of what ``docs/robots/crawler/robot.toml`` has in the place of analogue inputs."""
