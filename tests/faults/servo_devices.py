"""The rows of the fault matrix that are about serial bus servos, of either family."""

from __future__ import annotations

from typing import Final

from tests.faults.devices import CLEAR, FREEZES, device, unnoticed
from tests.faults.matrix import AT_ONCE, DeviceRow

HELD_WHERE_IT_IS: Final = "`clear` works at once: it sets the servo up, and holds it where it is."


def _dead_lines(family: str) -> tuple[DeviceRow, ...]:
    """A line over which nothing comes any more."""
    return (
        device(
            "every third byte to the servos lost",
            f"{family}.drop=3",
            "repeats each query twice, then " + FREEZES,
            "does not answer",
        ),
        device(
            "every third byte to the servos corrupted",
            f"{family}.corrupt=3",
            "likewise; what has a wrong checksum is not followed",
            "does not answer",
        ),
        device(
            "all answers are lost",
            f"{family}.lost=1",
            "repeats each query twice, then " + FREEZES,
            "does not answer",
        ),
    )


def bus_servos(family: str, name: str, *, lets_go_for_a_dip: bool) -> tuple[DeviceRow, ...]:
    """The rows of one family.

    Args:
        family: At the fault panel.
        name: In sentences.
        lets_go_for_a_dip: Whether a supply that gives too little makes them limp.
    """

    def gone(fault: str, spec: str, words: str, back: str, *, lasts: bool) -> DeviceRow:
        """A servo whose torque goes off while moving."""
        return device(
            f"{fault}, while moving",
            f"{family}.{spec}",
            "reads each servo before each step, stops and sends no more; the others hold",
            f"Servo 2 ({name}) {words}",
            back,
            after=0.4,
            lasts=lasts,
            limp=True,
        )

    return (
        device(
            "serial cable unplugged while moving",
            f"{family}.unplugged",
            FREEZES + " (the servos do so by themselves)",
            "failed while",
            after=0.4,
        ),
        device(
            "serial cable unplugged and plugged in again while idle",
            f"{family}.unplugged",
            "notices before it moves, at the next request (on a real robot: within 3 s)",
            "failed while",
            AT_ONCE,
            lasts=False,
            mended_first=True,
        ),
        *(
            device(
                f"one byte in 2,000 to the servos {what}",
                f"{family}.{fault}=2000",
                "asks again, and reads each goal back before the next: nothing is lost",
                "(an observation)",
                "By itself.",
                code=None,
            )
            for fault, what in (("drop", "lost"), ("corrupt", "corrupted"))
        ),
        device(
            "all answers are damaged",
            f"{family}.garbage=1",
            "repeats each query twice, then " + FREEZES,
            "is damaged: two servos have this",
        ),
        *(
            device(
                f"one answer in 97 is {what}",
                f"{family}.{fault}=97",
                "repeats the query: nothing is lost",
                "(an observation)",
                "By itself.",
                code=None,
            )
            for fault, what in (("garbage", "damaged"), ("lost", "lost"))
        ),
        gone("a servo's plug comes off", "silent=2", "does not answer", CLEAR, lasts=True),
        device(
            "another servo on the line has the same id",
            f"{family}.twin=2",
            "cannot read either of them, and freezes",
            f"What servo 2 ({name}) answers is damaged: two servos have this",
        ),
        device(
            "a servo restarts while moving, because its supply dips: it is limp",
            f"{family}.reboot=2",
            "knows it by the volatile registers that it had set, and sends nothing more",
            f"Servo 2 ({name}) ",
            HELD_WHERE_IT_IS,
            after=0.4,
            lasts=False,
            limp=True,
        ),
        device(
            "all servos restart while idle",
            f"{family}.reboot",
            "notices before it moves, at the next request (on a real robot: within 3 s)",
            f"Servo 1 ({name}) ",
            HELD_WHERE_IT_IS,
            lasts=False,
            mended_first=True,
            limp=True,
        ),
        gone(
            "a servo is overloaded and switches its torque off",
            "overload=2",
            "reports ",
            HELD_WHERE_IT_IS + " Relieve the joint before.",
            lasts=False,
        ),
        gone(
            "a servo is too hot and switches its torque off",
            "hot=2",
            "reports ",
            "`clear` is refused until it has cooled, then holds it where it is.",
            lasts=True,
        ),
        gone(
            "another program makes a wheel of a servo",
            "wheel_mode=2",
            "switched its torque off",
            "`clear` is refused, with the mode, until it is a joint again: no permanent memory is "
            "written here.",
            lasts=True,
        ),
        device(
            "the supply of all servos is too low",
            f"{family}.dip",
            "stops; the servos "
            + ("let go, as they are set to" if lets_go_for_a_dip else "go on holding"),
            f"Servo 1 ({name}) reports ",
            after=0.4,
            limp=lets_go_for_a_dip,
        ),
        device(
            "another program on the line moves a servo while idle",
            f"{family}.moved=5",
            "notices before it moves, at the next request (on a real robot: within 3 s), and in "
            "mid-motion before its next step",
            "does not have the commands",
            "`clear` works at once; motion goes on from the goal that the servo has now.",
            lasts=False,
            mended_first=True,
        ),
    )


SERVO_DEVICES: Final = {
    "feetech": {
        "Serial bus servos (Feetech)": bus_servos("feetech", "Feetech", lets_go_for_a_dip=False),
    },
    "dynamixel": {
        "Serial bus servos (DYNAMIXEL)": (
            *bus_servos("dynamixel", "DYNAMIXEL", lets_go_for_a_dip=True),
            *_dead_lines("dynamixel"),
        ),
        "Joints of servos that say where they are": tuple(
            unnoticed(
                what,
                f"servos.{spec}",
                "says in the observation where the joints are (`measured`), and which is not where "
                "it was sent (`off_target`), and why; `status` says so, too",
                f"(an observation that names the joint as {kind})",
                "By itself; repair the joint.",
                after=after,
            )
            for what, spec, kind, after in (
                ("the motor of a servo is dead", "dead=1", "dead", 0.0),
                ("a joint is jammed", "jammed=2", "jammed", 1.0),
                ("a joint is blocked on its way", "blocked=2", "blocked or too weak", 1.0),
            )
        ),
    },
}
"""Faults of bus servos, by set of electronics and section; the sensors are those of ``pi``."""
