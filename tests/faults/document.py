"""Writes ``docs/faults.md`` from the fault matrix: ``python -m tests.faults.document``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sim_robot.faults.fault_panel import KNOWN
from tests.faults.devices import DEVICES
from tests.faults.matrix import NETWORK, PROCESSES, Row
from tests.faults.pi_devices import PI_DEVICES

CABLE = ("cut", "pulled")  # scenarios that belong to the network
PAGE = Path(__file__).parents[2] / "docs" / "faults.md"

HEAD = """\
# Faults

What the robot does when something fails, what its controller is told, and how it comes back. This
page is written from the tables that the tests run (`matrix.py`, `devices.py` and `pi_devices.py` in
`tests/faults`): each row is injected there, in a real `sim-robotd` or `robotd` process, and
checked. `make faults` writes the page anew.

Four rules hold throughout:

1. **A fault is a state.** The servos freeze at the counts last commanded, never limp. The request
   ends with an error; `status` and telemetry say `fault` and why. Every motion and reading is
   refused until somebody sends `clear`, which opens, identifies and tries every device, and is
   refused with a sentence while one of them still fails.
2. **No reading is invented, repeated or stale.** An observation is given only if every sample of it
   was fresh, a finite number and possible, whatever the sensor, and if the servo board, which
   acknowledges nothing and which other programs may reach, was asked before the samples and after
   them whether it has the counts that it was sent, and, a PCA9685, whether it is set up as it was.
3. **Nothing is done twice.** A request is carried out once, however often it arrives.
4. **No leap is commanded.** Whatever failed, or another program did, a joint is told to go no
   further at once than it moves in one update of its count at top speed: 5.6° with eight servos at
   9600 baud, 21° with 24 on three boards of one line, where an update takes 0.27 s and `stop` cuts
   in between its lines.
   `make leaps` injects a thousand faults while joints move (resets, cables, silence, garbage,
   processes that stand still, clocks that jump, up to three at once) on eight servos, and reads the
   emulated board's own record: in 732 motions the longest step was 0.97 of that, and none of 160
   resets went unnoticed. With a PCA9685 one update is 2.4°: in 937 motions with a thousand
   faults the longest step was 0.99 of that, and no pulse that the daemon commanded was shorter than
   500 or longer than 2,500 µs. Of 84 resets and 567 interventions of another program on the bus,
   which put the board to sleep, woke it, changed PRE_SCALE or MODE2, moved or switched its outputs,
   none went unnoticed that changed a pulse. (Microseconds are true as far as `oscillator_mhz` is:
   [calibration.md](calibration.md).)

Servos may leap without a command. They go to neutral when an SV203 is reset, and a limp robot that
is held goes back to where it was, both at the servos' own speed; a PCA9685 that is reset leaves
them limp. Another program that reaches the board moves them as it likes: the bus is locked against
programs that ask for the lock, and others do not. A PCA9685 is read back before each move, and then
gets none, for putting it right would be the next leap. An SV203 cannot be asked in mid-motion: its
next line takes over from wherever the servo is. And it acts upon a line that lost a digit of a
position, until the next line brings the servo back. In a thousand more faults, bytes lost or
changed on the line and servos moved by other programs, these were up to 27 times the longest
step.

This takes an SV203 that is not selected when it is switched on, as it leaves the factory. Of
several boards on one line each is asked, whenever it is selected, for the count that it holds
furthest from neutral; one that has another gets no move, and the robot goes down in mid-motion. In
763 motions with a thousand faults on two boards the longest step was 0.97 of one update, and of 166
resets none that threw a servo went unnoticed; one that found all servos of its board at neutral has
thrown none.

What cannot be noticed stands here as such.
"""

GRAMMAR = """
## Injecting faults

    sim-robotd --fault daq.stuck_channel=3@2i+10s
    sim-robotd --electronics pi --fault pwm.reset@4i
    sim-robotd --control ipc:///tmp/faults
    python -m sim_robot.faults.control_socket ipc:///tmp/faults inject servo_board.unplugged
    python -m sim_robot.faults.control_socket ipc:///tmp/faults inject body.cut=2:50
    python -m sim_robot.faults.control_socket ipc:///tmp/faults mend
    python -m sim_robot.faults.control_socket ipc:///tmp/faults report

The control socket is for this computer alone: a Unix-domain socket (`ipc://PATH`), or a loopback
port (`tcp://127.0.0.1:PORT`), which every user of the computer can reach.

A fault is written `DEVICE.FAULT[=N[:AMOUNT]][@START][+DURATION]`: `body.cut=2:50` leaves half of
the second motor's leg. START is `3i`, in the zero pose of the third interaction, or `12.5s`, at
that robot time; without it the fault begins at once. DURATION is
`2i` (interactions), `5s` (robot time) or `5w` (seconds on the wall: the virtual time of a robot
that is down stands still); without it the fault lasts until it is mended.

| fault | what it does |
| --- | --- |
"""


def table(rows: Iterable[Row]) -> str:
    """Rows as Markdown."""
    lines = [
        "| fault | how it is injected | the robot | its state | the controller is told | "
        "how it comes back |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        injected = f"`{row.injected}`" if "." in row.injected.split()[0] else row.injected
        told = row.words if row.code is None else f"`{row.code}`: “…{row.words}…”"
        lines.append(
            f"| {row.fault} | {injected} | {row.does} | {row.state} | {told} | {row.back} |"
        )
    return "\n".join(lines) + "\n"


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    parts += [
        f"\n## {section}\n\n{table(rows)}" for section, rows in {**DEVICES, **PI_DEVICES}.items()
    ]
    parts.append(f"\n## Network\n\n{table([*NETWORK, *(PROCESSES[name] for name in CABLE)])}")
    rest = [row for name, row in PROCESSES.items() if name not in CABLE]
    parts.append(f"\n## Processes and computers\n\n{table(rest)}")
    known = "".join(f"| `{name}` | {what} |\n" for name, what in KNOWN.items())
    return "".join(parts) + GRAMMAR + known


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
