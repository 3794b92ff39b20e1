"""Serial bus servos that answer: what is the same for every family of them.

A family brings its packets and its table of registers (``Chain``). Its servos hold a goal, and
their torque goes off by itself, after a reset or an overload; so each is read before it is sent
a goal, and a *mark* in its volatile memory, which a reset wipes out, tells whether the servo is
still as it was set up. An output is the servo's own number (ID) on the bus.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final, Self

from robot.drivers.buses import Buses
from robot.drivers.servos.servo_bus import ServoState, check_counts, check_outputs
from robot.drivers.servos.servo_chain import Chain, Registers
from robot.errors import CommandError, DeviceDataError
from robot.toml_sections import Section

_SENDINGS: Final = 4  # times that a packet that nobody acknowledges is sent, until it is given up
_SUPPLY_ADVICE: Final = (
    "Check the servos' supply under load and the plug of this one, then clear the fault."
)


@dataclass(frozen=True, kw_only=True)
class AnsweringServoSettings:
    """The serial line to servos; each family is a subclass.

    Attributes:
        counts: Positions of a turn; 0 means limp here, and is left out.
        outputs: The IDs that a servo can have, and that joints name.
        bauds: Baud rates that the servos know.
        usual_baud: Baud rate for a table that names none.
        chain: Class of the line, which speaks the family's protocol.
    """

    name: ClassVar[str]
    counts: ClassVar = range(1, 4096)
    known_counts: ClassVar = counts
    outputs: ClassVar[range]
    bauds: ClassVar[Sequence[int]]
    usual_baud: ClassVar[int]
    chain: ClassVar[type[Chain[Any]]]
    reads_back: ClassVar = True
    port: str = field(repr=False)  # a re-plugged adapter may have another name
    baud: int

    @property
    def per_update(self) -> int:
        """Number of all outputs: one transmission commands them all."""
        return len(self.outputs)

    @classmethod
    def read(cls, table: Section) -> Self:
        """Reads the keys ``port`` and ``baud``."""
        return cls(port=table.text("port"), baud=table.one_of("baud", cls.bauds, cls.usual_baud))

    def open(self, buses: Buses) -> AnsweringServos:
        """Opens the line; a servo is first heard of at its first query."""
        chain = self.chain(lambda: buses.open_serial(self.port, self.baud), clock=buses.clock)
        return AnsweringServos(chain, outputs=self.outputs, counts=self.counts)

    def __str__(self) -> str:
        return f"{self.port}, {self.baud} baud"


class AnsweringServos:
    """The servos of one line; not thread-safe.

    Methods raise ``CommandError`` for an output or count out of range, and send nothing then;
    ``DeviceError`` where a servo does not answer, or the line failed.

    Args:
        chain: Line to the servos, which this object closes.
        outputs: Numbers that servos can have.
        counts: Goals that servos can be sent.
    """

    def __init__(self, chain: Chain[Any], *, outputs: range, counts: range):
        self._chain = chain
        self._outputs = outputs
        self._counts = counts
        self._held: dict[int, int] = {}  # goals that servos that were set up should hold, 0 limp
        self._previous: dict[int, int] = {}  # goals before the last ones, which may have been lost
        self._resendings = 0
        self.name = chain.name

    @property
    def repeats(self) -> int:
        """Number of packets sent again, because they or their answers did not arrive."""
        return self._chain.repeats + self._resendings

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the line, for a clock that must know when emulated servos have them."""
        return self._chain.bytes_written

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Sends goals to servos, if they are as they were left; first holds limp ones in place.

        Raises:
            CommandError: A servo was not read since the driver began, forgot or noticed a reset;
                nothing was sent.
            DeviceDataError: A servo is not as it was left; nothing was sent.
        """
        check_counts(counts, self._counts, self._outputs)
        if not all(output in self._held for output in counts):
            raise CommandError("read the servos' counts before moving them")
        repeats = self._chain.repeats
        answers = self._read_sound(list(self._held))
        if self._chain.repeats > repeats:  # by then the first answers are old
            answers = self._read_sound(list(self._held))
        answers = self._resent(answers)
        for output, registers in answers.items():
            goal = self._held[output]
            if goal and registers.goal != goal:
                if registers.goal == self._previous.get(output):
                    raise self._untaken([output])
                self.forget()
                raise DeviceDataError(
                    f"{self._name_of([output])} has the goal {registers.goal}, not {goal}: another "
                    "program wrote to it.",
                    "Check that nothing else drives the servos.",
                )
        limp = {
            output: self._nearest(answers[output].state.position)
            for output in counts
            if not self._held[output]
        }
        if limp:
            self._stiffen(limp)
        self._previous |= {output: self._held[output] for output in counts}
        self._held |= counts
        self._chain.send(counts)

    def release(self, outputs: Iterable[int]) -> None:
        """Switches the torque of some servos off, also of one that failed.

        Raises:
            DeviceDataError: Torque stayed on.
        """
        released = list(outputs)
        check_outputs(released, self._outputs)
        self._chain.switch(released, on=False)
        self._held |= {output: 0 for output in released if output in self._held}
        self._previous = {n: goal for n, goal in self._previous.items() if n not in released}
        stiff = [n for n, servo in self._chain.read(released).items() if servo.state.driven]
        if stiff:
            self._chain.switch(stiff, on=False)  # the packet was damaged
            stiff = [n for n, servo in self._chain.read(stiff).items() if servo.state.driven]
        if stiff:
            raise DeviceDataError(
                f"{self._name_of(stiff)} did not switch the torque off.",
                "Switch the supply of the servos off, then check the cable.",
            )

    def read_counts(self, outputs: Sequence[int]) -> dict[int, int]:
        """Goals of servos, 0 where torque is off; first sets up those that were forgotten or new.

        Raises:
            DeviceDataError: A servo is not fit for use, or is driven to what is no count.
        """
        check_outputs(outputs, self._outputs)
        unread = [output for output in outputs if output not in self._held]
        if unread:
            self._chain.set_up(unread)
        answers = self._chain.read(outputs)
        for output, registers in answers.items():
            self._refuse_faulty(output, registers)
            goal, driven = registers.goal, registers.state.driven
            if driven and goal not in self._counts:
                self.forget()
                raise DeviceDataError(
                    f"{self._name_of([output])} is driven to {goal}, beyond {self._counts[0]} to "
                    f"{self._counts[-1]}: another program did that.",
                    "Switch the servos' supply off and on, so that it is limp.",
                )
            self._held[output] = goal if driven else 0
        return {output: self._held[output] for output in outputs}

    def read_states(self, outputs: Sequence[int]) -> dict[int, ServoState]:
        """States that servos report of themselves, faults included."""
        check_outputs(outputs, self._outputs)
        return {output: servo.state for output, servo in self._chain.read(outputs).items()}

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """Compares the servos with the goals they should have; sends a goal again that was lost.

        Returns:
            The outputs that differ, ascending.

        Raises:
            DeviceDataError: A servo restarted, switched its torque off or reports a fault.
        """
        check_outputs(expected, self._outputs)
        unread = [output for output in expected if output not in self._held]
        if unread:
            raise DeviceDataError(
                f"{self._name_of(unread)} was not read since it failed or was opened.",
                "Read its counts first.",
            )
        answers = self._resent(self._read_sound(list(expected)))
        return sorted(
            output
            for output, registers in answers.items()
            if (registers.goal if registers.state.driven else 0) != expected[output]
        )

    def forget(self) -> None:
        """Makes the next ``read_counts`` set each servo up, whatever happened to it."""
        self._held.clear()
        self._previous.clear()

    def reopen(self) -> None:
        """Closes the line and opens it anew."""
        self.forget()
        self._chain.reopen()

    def seconds_for(self, changed: int) -> float:
        """Time that ``set_counts`` takes for ``changed`` outputs, s."""
        return self._chain.seconds_for(max(changed, len(self._held)))

    def close(self) -> None:
        """Closes the line; the servos hold their goals."""
        self._chain.close()

    def _read_sound(self, outputs: Sequence[int]) -> dict[int, Registers]:
        """Registers of servos that should be as they were left; if one is not, forgets all."""
        answers = self._chain.read(outputs)
        for output, registers in answers.items():
            self._refuse_faulty(output, registers)
            goal, state = self._held[output], registers.state
            reason = ""
            if not registers.marked:
                reason = "restarted"
            elif goal and not state.driven:
                reason = "switched its torque off"
            elif state.driven and not goal:
                reason = "has its torque on, which another program must have done"
            if reason:
                self.forget()
                raise DeviceDataError(f"{self._name_of([output])} {reason}.", _SUPPLY_ADVICE)
        return answers

    def _stiffen(self, limp: Mapping[int, int]) -> None:
        """Holds limp servos where they are; their torque goes on when they have that goal."""
        self._held |= limp  # if this fails half-way, some are driven
        for _ in range(_SENDINGS):
            self._chain.send(limp)
            answers = self._chain.read(list(limp))
            if all(answers[output].goal == goal for output, goal in limp.items()):
                break
            self._resendings += 1
        else:
            raise self._untaken([n for n, goal in limp.items() if answers[n].goal != goal])
        for _ in range(_SENDINGS):
            self._chain.switch(list(limp), on=True)
            answers = self._chain.read(list(limp))
            if all(registers.state.driven for registers in answers.values()):
                return
            self._resendings += 1
        raise self._untaken([n for n, registers in answers.items() if not registers.state.driven])

    def _resent(self, found: Mapping[int, Registers]) -> dict[int, Registers]:
        """Registers of servos, after sending goals again to those that still have their last ones.

        Nobody acknowledges a goal. One that was lost unnoticed would make two steps one.
        """
        found = dict(found)
        for _ in range(_SENDINGS):
            lost_goals = {
                output: self._held[output]
                for output, registers in found.items()
                if self._held[output] != registers.goal == self._previous.get(output)
            }
            if not lost_goals:
                break
            self._resendings += 1
            self._chain.send(lost_goals)
            found |= self._read_sound(list(lost_goals))
        return found

    def _untaken(self, servos: Sequence[int]) -> DeviceDataError:
        self.forget()
        return DeviceDataError(
            f"{self._name_of(servos)} did not take what was sent, {_SENDINGS} times.",
            "Check the cable and the ground: packets to the servos are lost.",
        )

    def _refuse_faulty(self, output: int, registers: Registers) -> None:
        fault, driven = registers.state.fault, registers.state.driven
        if fault:
            self.forget()
            torque_off = "" if driven else " and switched its torque off"
            raise DeviceDataError(
                f"{self._name_of([output])} reports {fault}{torque_off}.",
                "Relieve and cool it, check its supply, then clear the fault.",
            )

    def _nearest(self, position: float) -> int:
        return min(max(round(position), self._counts[0]), self._counts[-1])

    def _name_of(self, outputs: Sequence[int]) -> str:
        plural = "s" if len(outputs) > 1 else ""
        return f"Servo{plural} {', '.join(map(str, outputs))} ({self.name})"
