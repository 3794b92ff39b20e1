"""The fault matrix: what is broken, how, and what must come of it.

The tests run every row, and ``python -m tests.faults.document`` writes ``docs/faults.csv`` from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from bench.network_proxy import Weather

AT_ONCE: Final = "`clear` works at once."


@dataclass(frozen=True, kw_only=True)
class Row:
    """One fault.

    Attributes:
        fault: What goes wrong.
        injected: How the test makes it go wrong.
        does: What the robot does.
        state: Its state afterwards.
        code: The error code that the controller is answered with; ``None``: an observation, or the
            request's ordinary reply.
        words: Part of the sentence in that answer; or else what the controller is told instead.
        back: How it comes back.
    """

    fault: str
    injected: str
    does: str
    state: str
    code: str | None
    words: str
    back: str


@dataclass(frozen=True, kw_only=True)
class DeviceRow(Row):
    """A device's fault, in ``sim-robotd`` by way of its control socket.

    Attributes:
        after: Seconds of robot time from the ``perform`` until the fault begins. The motion is: 0.1
            s checking the board, 0.7 s homing, settling, 0.7 s moving, settling, 0.4 s sampling.
        lasts: Whether ``clear`` is refused until the fault is mended.
        mended_first: Whether the fault has been mended before anybody asks for anything.
        sometimes: Whether the observation may come through instead, being true.
        limp: Whether the joints go limp, because the servo board lost its settings.
    """

    after: float = 0.0
    lasts: bool = True
    mended_first: bool = False
    sometimes: bool = False
    limp: bool = False


@dataclass(frozen=True, kw_only=True)
class WeatherRow(Row):
    """Messages between client and robot that do not come as they should."""

    weather: Weather


AGAIN: Final = "By itself: the client repeats each request under its id until it is answered."

NETWORK: Final = (
    WeatherRow(
        fault="a quarter of all messages lost",
        injected="a relay between client and `sim-robotd`",
        does="carries out each request once, however often it comes",
        state="holding",
        code=None,
        words="(each observation, once)",
        back=AGAIN,
        weather=Weather(loss=0.25),
    ),
    WeatherRow(
        fault="half of all messages duplicated",
        injected="the same relay",
        does="carries out each request once",
        state="holding",
        code=None,
        words="(each observation, once)",
        back="By itself.",
        weather=Weather(duplication=0.5),
    ),
    WeatherRow(
        fault="every message late by 0.2 s",
        injected="the same relay",
        does="carries out each request once",
        state="holding",
        code=None,
        words="(each observation, once)",
        back="By itself.",
        weather=Weather(delay=0.2),
    ),
    WeatherRow(
        fault="messages overtake each other",
        injected="the same relay, each message late by up to 0.1 s, half of them doubled",
        does="carries out each request once; one that comes after a later one, for the first time, "
        "is `out_of_order` and not carried out",
        state="holding",
        code=None,
        words="(each observation, once)",
        back="By itself.",
        weather=Weather(jitter=0.1, duplication=0.5),
    ),
)

PROCESSES: Final = {
    "cut": Row(
        fault="connections reset while moving, network back after 1 s",
        injected="a TCP relay",
        does="goes on: the controller may be silent for 5 s",
        state="holding",
        code=None,
        words="(the observation, once it is back)",
        back="By itself: the client connects anew and asks again under the same id.",
    ),
    "pulled": Row(
        fault="cable pulled for longer than 5 s while moving",
        injected="a TCP relay that passes nothing on and tells nobody",
        does="holds where it is when it has heard nothing for 5 s; control is kept for 30 s",
        state="holding",
        code="aborted_silent",
        words="The controller was silent for too long",
        back="By itself: when the cable is back the client hears how its motion ended, and may "
        "send another.",
    ),
    "death": Row(
        fault="controller killed (SIGKILL) while moving",
        injected="the real process, really killed",
        does="holds where it is when it has heard nothing for 5 s",
        state="holding",
        code="held",
        words="holds the robot",
        back="Others may `stop` at once, and control it after 30 s.",
    ),
    "term": Row(
        fault="SIGTERM (or SIGHUP) to the daemon while moving",
        injected="the real process",
        does="ends the motion, slews to zero and exits within 5 s",
        state="(gone)",
        code="shutting_down",
        words="The daemon is shutting down.",
        back="Start it again.",
    ),
    "kill": Row(
        fault="SIGKILL to the daemon while moving",
        injected="the real process, on a servo board that outlives it",
        does="the board holds the servos where they are by itself; the next daemon reads its "
        "counts and slews from there",
        state="idle",
        code=None,
        words="`RobotRestartedError` (code `restarted`): whether the motion was carried out is "
        "unknown, and it is never repeated",
        back="Start it again; say `hello` again.",
    ),
    "stall": Row(
        fault="the daemon's computer stands still for 2.5 s while moving",
        injected="SIGSTOP and SIGCONT",
        does="freezes when it goes on; no joint leaps. After less than 2 s it goes on moving, from "
        "where it was and no faster than ever",
        state="fault",
        code="fault",
        words="The robot clock jumped by +",
        back=AT_ONCE,
    ),
    "date": Row(
        fault="the computer's date is set, by hours and in both directions, while moving",
        injected="a `time.time` that jumps at every call, in the real process",
        does="nothing: it never asks for the date",
        state="holding",
        code=None,
        words="(the observation)",
        back="By itself.",
    ),
    "disk": Row(
        fault="disk full on the robot",
        injected="standard error is `/dev/full`: no log line can be written",
        does="goes on without a log, and parks on SIGTERM",
        state="holding",
        code=None,
        words="(the observation)",
        back="By itself.",
    ),
    "workstation": Row(
        fault="disk full on the workstation",
        injected="a limit of 0 bytes on the files of a real process with the estimator's store",
        does="nothing: a request whose id cannot be written down is never sent",
        state="idle",
        code=None,
        words="(it asked for nothing; the estimator ends with a sentence)",
        back="Make room, then `estimator resume`.",
    ),
    "renamed": Row(
        fault="USB adapter re-plugged, and now another device behind the same stable link",
        injected="the pseudo-terminal is closed, and its name taken, before the link comes back",
        does="asks the idle board for its counts every 3 s, and freezes",
        state="fault",
        code="fault",
        words="failed while",
        back="`clear` opens the link anew, and works at once.",
    ),
    "unasked": Row(
        fault="brown-out while idle, and nobody asks for anything",
        injected="the emulated board's supply dips",
        does="asks the waiting board, also of a limp or stopped robot, for its counts every 3 s, "
        "and freezes",
        state="fault",
        code="fault",
        words="it was reset",
        back="`clear` works at once; motion goes on from where the board stands now.",
    ),
    "hanging servos": Row(
        fault="the driver of the servos does not return, while moving",
        injected="`set_counts` waits, in the real process",
        does="answers `stop` within 250 ms, as `not_confirmed`; what the driver had been given "
        "goes out when it returns, one update of some joints, and nothing after it. `status` says "
        "from 0.25 s on that the control loop does not turn, and from 2 s on `fault`",
        state="fault",
        code="fault",
        words="The control loop does not turn: the driver of the SV203 does not return from "
        "set_counts",
        back="Refused while the driver hangs; afterwards `clear` works. A driver in C that waits "
        "without giving up Python's lock holds all answers up, too: the service manager's watchdog "
        "ends the daemon then, and the board holds the servos by itself.",
    ),
    "hanging sensor": Row(
        fault="the driver of a sensor does not return, while moving",
        injected="`acceleration` waits, in the real process",
        does="likewise",
        state="fault",
        code="fault",
        words="does not return from acceleration",
        back="Likewise.",
    ),
    "hanging at the end": Row(
        fault="SIGTERM while the driver of the servos does not return",
        injected="the real process, its driver waiting in `set_counts`",
        does="waits for the driver for 2 s, and for each that does not close for 1 s, says so, and "
        "exits with status 1",
        state="(gone)",
        code="fault",
        words="does not return from set_counts",
        back="Start it again.",
    ),
    "dying servos": Row(
        fault="the driver of the servos raises `SystemExit`, while moving",
        injected="the real process, the driver of which does",
        does="freezes at the last commanded counts; logs where the driver raised it",
        state="fault",
        code="fault",
        words="The driver of the SV203 failed in verify: SystemExit",
        back="`clear` works once the driver does.",
    ),
    "dying sensor": Row(
        fault="the driver of a sensor raises `KeyboardInterrupt`, or anything else",
        injected="likewise",
        does="likewise",
        state="fault",
        code="fault",
        words="The driver of the VL6180X failed in distance: KeyboardInterrupt",
        back="Likewise.",
    ),
}
"""Faults of processes, computers and cables, by the scenario that tests them."""
