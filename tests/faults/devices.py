"""The rows of the fault matrix that are about devices, injected by way of the control socket."""

from __future__ import annotations

from typing import Final

from tests.faults.matrix import AT_ONCE, DeviceRow

BODY_BACK: Final = "`estimator monitor` notices it, `estimator diagnose` says what it is."
CLEAR: Final = "Once it is mended, `clear` works."


def device(
    fault: str,
    spec: str,
    does: str,
    words: str,
    back: str = CLEAR,
    *,
    code: str | None = "fault",
    after: float = 0.0,
    lasts: bool = True,
    mended_first: bool = False,
    sometimes: bool = False,
    limp: bool = False,
) -> DeviceRow:
    """A fault that is noticed, unless ``code`` is ``None``."""
    return DeviceRow(
        fault=fault,
        injected=spec,
        does=does,
        state="holding" if code is None else "fault",
        code=code,
        words=words,
        back=back,
        after=after,
        lasts=lasts,
        mended_first=mended_first,
        sometimes=sometimes,
        limp=limp,
    )


def unnoticed(
    fault: str, spec: str, does: str, told: str, back: str, *, after: float = 0.0
) -> DeviceRow:
    """A fault that is not noticed."""
    return device(fault, spec, does, told, back, code=None, after=after)


def lost_acknowledges(chip: str) -> tuple[DeviceRow, ...]:
    """What a chip on an I²C bus loses now and then is done again, unless it was done."""
    return (
        device(
            "one transfer in 20 is not acknowledged",
            f"{chip}.nak=20",
            "makes it again: nothing is lost. `robotd doctor` counts them",
            "(an observation)",
            "By itself.",
            code=None,
        ),
        device(
            "one transfer in 20 is carried out and its acknowledge lost",
            f"{chip}.unheard=20",
            "makes it again, unless it started something that must not be started twice",
            "(an observation)",
            "By itself.",
            code=None,
        ),
    )


SET_AGAIN: Final = "`clear` loads its settings again."
ADAPTER: Final = "Adapter of the I²C bus"
DISTANCE: Final = "Distance sensor (VL6180X)"
FREEZES: Final = "freezes at the last commanded counts"
NO_READING: Final = "ends the motion without a reading; the servos hold"

DEVICES: Final = {
    "Serial line and servo board": (
        device(
            "serial cable unplugged while moving",
            "servo_board.unplugged",
            FREEZES + " (the board does so by itself)",
            "failed while",
            "Plug it in and `clear`, which opens the port named in the configuration anew; the "
            "adapter may have become another device behind that name. Motion goes on from the "
            "counts that the board has.",
            after=0.4,
        ),
        device(
            "serial cable unplugged and plugged in again while idle",
            "servo_board.unplugged",
            "notices before it moves, at the next request (on a real robot: within 3 s)",
            "failed while",
            AT_ONCE,
            lasts=False,
            mended_first=True,
        ),
        device(
            "every third byte to the board lost",
            "servo_board.drop=3",
            "repeats each query twice, then " + FREEZES,
            "The servo board",
        ),
        device(
            "one byte in 61 to the board lost while moving",
            "servo_board.drop=61",
            "queries are repeated; where a position was lost, the board's counts differ at the end "
            "of the motion. A line that lost a digit moves a servo elsewhere for a moment: the "
            "board's language has no checksum",
            "does not have the commands",
            "If `clear` finds the board's counts readable, it works; else it is refused.",
            after=0.2,
            lasts=False,
            sometimes=True,
        ),
        device(
            "every third byte to the board corrupted",
            "servo_board.corrupt=3",
            "repeats each query twice, then " + FREEZES,
            "The servo board",
        ),
        device(
            "one byte in 67 to the board corrupted while moving",
            "servo_board.corrupt=67",
            "as with lost bytes",
            "does not have the commands",
            "As with lost bytes.",
            after=0.2,
            lasts=False,
            sometimes=True,
        ),
        device(
            "the board's answers are garbage",
            "servo_board.garbage=1",
            "repeats each query twice, then " + FREEZES,
            "instead of a number 0 to 255",
        ),
        device(
            "every third answer of the board is garbage",
            "servo_board.garbage=3",
            "repeats the query: nothing is lost",
            "(an observation)",
            "By itself.",
            code=None,
        ),
        device(
            "the board answers nothing",
            "servo_board.mute",
            "repeats each query twice, then " + FREEZES,
            "did not answer",
        ),
        device(
            "brown-out while moving: the board is deselected, servos jump to neutral",
            "servo_board.brown_out",
            "sees it when it has moved (to zero, or to the targets) and reads the board back. "
            "Meanwhile the board ignores it, for what moves servos never selects a board: they "
            "stay where the reset threw them, all of them",
            "it was reset",
            "`clear` works at once; motion goes on from where the board stands now.",
            after=0.4,
            lasts=False,
        ),
        device(
            "brown-out while idle",
            "servo_board.brown_out",
            "notices before it moves, at the next request (on a real robot: within 3 s)",
            "it was reset",
            "`clear` works at once; motion goes on from where the board stands now.",
            lasts=False,
            mended_first=True,
        ),
        device(
            "another program on the line moves a servo while idle",
            "servo_board.moved=2",
            "notices before it moves, at the next request (on a real robot: within 3 s). In "
            "mid-motion a board cannot be asked, so that is seen at its end, unless the motion's "
            "own lines have brought the servo back",
            "does not have the commands",
            "`clear` works at once; motion goes on from where the board has the joint now.",
            lasts=False,
            mended_first=True,
        ),
    ),
    "Servos": (
        unnoticed(
            "a servo is dead",
            "servos.dead=1",
            "nothing: servos report nothing, and a robot that does not know its body cannot tell "
            "which reading would be right",
            "**not noticed** (an observation: what was commanded, and what was measured)",
            "`robotd doctor --move` and `estimator validate` show it; repair the servo.",
        ),
        unnoticed(
            "a servo is jammed",
            "servos.jammed=2",
            "nothing, likewise",
            "**not noticed** (an observation, likewise)",
            "Likewise.",
            after=1.0,
        ),
        unnoticed(
            "two servos have exchanged their plugs",
            "servos.swapped=1",
            "nothing, likewise",
            "**not noticed** (an observation, likewise)",
            "`robotd calibrate` and `robotd doctor --move` show it; exchange the plugs.",
        ),
        unnoticed(
            "all servos stop short",
            "servos.short=2",
            "its joints stop 2° before the angles that it tells",
            "**not noticed** (an observation)",
            "None: the estimator weighs it, and says so where readings tell (`servo_short_deg`).",
        ),
    ),
    "Body and sensors' mounts": (
        *(
            unnoticed(
                fault,
                spec,
                "nothing: its readings are those of another body",
                "**not noticed** (an observation)",
                BODY_BACK,
            )
            for fault, spec in (
                ("a leg breaks off in the middle", "body.cut=2:50"),
                ("a leg is longer or shorter", "body.length=2:60"),
                ("a leg is bent", "body.bent=2:40"),
                ("a hinge is turned about its leg", "body.twisted=2:60"),
                ("a leg points aside", "body.aside=2:45"),
                ("a weight hangs at a leg's end", "body.weight=1:500"),
                ("a gauge feels no load", "sensors.deaf=2"),
                ("a gauge feels a load in every pose", "sensors.pressed=1"),
                ("the accelerometer is turned to the left", "sensors.tilt_left=4"),
                ("the accelerometer is turned forward", "sensors.tilt_forward=-4"),
                ("the distance sensor reads too much", "sensors.too_high=8"),
                ("a servo's horn slips", "servos.slipped=2:15"),
                ("a servo turns less far", "servos.travel=2:50"),
            )
        ),
    ),
    "Ground": (
        *(
            unnoticed(
                f"the ground rises {way}",
                f"ground.rises_{name}=2",
                "moves (beyond 3° it refuses with `not_planar`, unless somebody lays it down)",
                "(an observation, whose `zero_tilt` shows it)",
                "Level the ground.",
            )
            for way, name in (("to the left", "left"), ("forward", "forward"))
        ),
    ),
    "Analogue inputs (DMM-32)": (
        device("board gone", "daq.absent", NO_READING, "everything there reads 0xFF", after=0.9),
        device("stuck WAIT", "daq.stuck_wait", NO_READING, "settling its input (WAIT)"),
        device("stuck STS", "daq.stuck_busy", NO_READING, "the conversion (STS)", after=1.5),
        device("FIFO overflow", "daq.overflow", NO_READING, "its FIFO overflowed"),
        device("a sample is lost", "daq.lost_sample", NO_READING, "its FIFO held fewer samples"),
        device(
            "an axis of the accelerometer is stuck",
            "daq.stuck_channel=0",
            "notices the same 16-bit code 20 scans running (live inputs dither), and gives no "
            "observation",
            "is stuck: it gave exactly",
            CLEAR,
        ),
        device(
            "a strain gauge's input is stuck",
            "daq.stuck_channel=4",
            "likewise",
            "the gauge of",
        ),
        device(
            "an axis of the accelerometer is railed",
            "daq.railed_channel=1",
            NO_READING,
            "is at the end of its range",
        ),
        device(
            "a strain gauge's input is railed",
            "daq.railed_channel=5",
            NO_READING,
            "is at the end of its range",
        ),
        unnoticed(
            "two gauges, or the x and y axes, have exchanged their wires",
            "daq.swapped_channels=3",
            "nothing: both readings are possible. (The z axis exchanged with another shows as a "
            "robot that does not lie flat: `not_planar`)",
            "**not noticed** (an observation)",
            "`robotd calibrate` asks for each gauge and axis in turn; exchange the wires.",
        ),
    ),
    DISTANCE: (
        device(
            "no acknowledge",
            "distance.nak",
            "makes each transfer three times, then " + NO_READING,
            "Nothing acknowledges",
        ),
        *lost_acknowledges("distance"),
        device("bus hangs", "distance.hang", NO_READING, "The I²C bus hangs"),
        device("measurement never ends", "distance.busy", NO_READING, "within 0.1 s"),
        device("it reports a laser failure", "distance.error=3", NO_READING, "(error 3)"),
        device(
            "frozen value",
            "distance.frozen",
            "notices that ten measurements counted exactly the same photons, and gives no "
            "observation. (A value that is wrong but alive is noticed where it contradicts the "
            "tilt: a belly that leans cannot be on the ground)",
            "is frozen",
        ),
        device(
            "reset while moving: its settings are lost",
            "distance.reset",
            NO_READING,
            "has been reset",
            "`clear` identifies it again and loads its settings.",
            after=0.4,
            lasts=False,
        ),
        device(
            "another program sets the range to a third while moving",
            "distance.rescaled",
            "reads scale and limits back before each measurement, and gives no observation. What "
            "was left before the start is set anew by every start",
            "does not measure as it was set up",
            SET_AGAIN,
            after=0.4,
            lasts=False,
        ),
    ),
    ADAPTER: (
        device(
            "unplugged while moving",
            "i2c.unplugged",
            "fails at the first chip on it: a servo board goes on with its pulses",
            "is gone",
            "Plug it in and `clear`, which opens the bus named in the configuration anew; what was "
            "open stays dead.",
            after=0.4,
        ),
    ),
    "Robot clock": (
        device(
            "jumps by +10 s while moving",
            "clock.jump=10",
            FREEZES + "; no joint leaps",
            "The robot clock jumped by +10",
            AT_ONCE,
            after=0.4,
            lasts=False,
        ),
        device(
            "jumps by −10 s while moving",
            "clock.jump=-10",
            FREEZES + "; `robot_time` never runs backwards",
            "The robot clock jumped by -10",
            AT_ONCE,
            after=0.4,
            lasts=False,
        ),
        device(
            "jumps by −100 s while idle",
            "clock.jump=-100",
            "nothing; `robot_time` never runs backwards",
            "(an observation)",
            "By itself.",
            code=None,
        ),
    ),
}
"""Faults of devices, by section: ``--electronics pc104``."""
