"""The line to serial bus servos: questions, and answers that come one after another.

A family brings its packets (``Decoder``) and its registers (``Chain``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final, Generic, TypeVar

import serial

from robot.drivers.links.device_files import readers
from robot.drivers.links.serial_line import SerialLine
from robot.drivers.servos.servo_bus import ServoState
from robot.drivers.servos.servo_packets import Decoder
from robot.errors import DeviceDataError, DeviceError, DeviceTimeoutError
from robot.host.clock import Clock

Known = TypeVar("Known")
_ATTEMPTS: Final = 3  # at a query; a sound line needs one, and the doctor counts the others
_USUAL_DELAY: Final = 500e-6  # s before an answer of a servo that did not tell


@dataclass(frozen=True, kw_only=True)
class Registers:
    """What one servo has in its registers: its goal, whether it has the mark, and its state."""

    goal: int
    marked: bool
    state: ServoState


class Chain(ABC, Generic[Known]):
    """The servos of one line, in the packets of their family.

    Every method raises ``DeviceError``, with a sentence that names line and servo. ``Known`` is
    what a family remembers of a servo that was set up.

    Args:
        open_port: Opens the line, which this object closes.
        clock: Paces the packets.
        reply_timeout: Longest wait for an answer, s.

    Attributes:
        name: Name of the servos, for messages.
        overhead: Number of bytes of an answer around its data.
        decoder: Class that finds the answers in what comes in.
        repeats: Number of questions asked again: an answer was damaged or did not come.
    """

    name: ClassVar[str]
    overhead: ClassVar[int]
    decoder: ClassVar[type[Decoder]]

    def __init__(
        self,
        open_port: Callable[[], serial.Serial],
        *,
        clock: Clock,
        reply_timeout: float = 0.2,
    ):
        self.repeats = 0
        self._clock = clock
        self._answers = self.decoder()
        self._known: dict[int, Known] = {}
        self._delays: dict[int, float] = {}  # s before an answer, by servo, where it told
        self._line = SerialLine(open_port, clock=clock, reply_timeout=reply_timeout)

    @property
    def bytes_written(self) -> int:
        """Bytes handed to the line, for a clock that must know when emulated servos have them."""
        return self._line.bytes_written

    @abstractmethod
    def ping(self, servo: int) -> bool:
        """Whether a servo answers, asked once; a damaged answer, as of two at once, counts."""

    @abstractmethod
    def set_up(self, servos: Sequence[int]) -> None:
        """Identifies servos, refuses one that is not fit for use, and marks them.

        Their torque, goals and permanent memory stay as they are. A fault that has switched a
        torque off is acknowledged, if it is over.
        """

    @abstractmethod
    def read(self, servos: Sequence[int]) -> dict[int, Registers]:
        """Registers of some servos, read in one query for all where the family has such."""

    @abstractmethod
    def send(self, goals: Mapping[int, int]) -> None:
        """Writes goals, in one packet, which nobody acknowledges.

        In some families this alone switches the torque on.
        """

    @abstractmethod
    def switch(self, servos: Sequence[int], *, on: bool) -> None:
        """Switches torque, in one packet, which nobody acknowledges."""

    @abstractmethod
    def seconds_for(self, servos: int) -> float:
        """Time that reading so many servos and sending to them takes, s."""

    def reopen(self) -> None:
        """Closes the line and opens it anew."""
        self._line.close()
        self._line.open()

    def close(self) -> None:
        """Closes the line; the servos hold their goals."""
        self._line.close()

    def _delay(self, servos: int) -> float:
        """Longest time that so many servos wait before they answer, in all, s."""
        return servos * max(self._delays.values(), default=_USUAL_DELAY)

    def _query(
        self, question: Callable[[Sequence[int]], bytes], servos: Sequence[int], size: int
    ) -> dict[int, bytes]:
        """Asks servos, and asks again those from which no sound answer came.

        Args:
            question: Returns the packet that asks some servos.
            servos: Servos to ask.
            size: Number of bytes of data in an answer.

        Returns:
            Error and data by servo.
        """
        answers: dict[int, bytes] = {}
        damaged = False
        for attempt in range(_ATTEMPTS):
            missing = [servo for servo in servos if servo not in answers]
            if not missing:
                break
            self.repeats += attempt > 0
            new_answers, damaged = self._ask(question(missing), missing, size)
            answers |= new_answers
        for servo in servos:
            if servo not in answers:
                raise self._unanswered(servo, damaged=damaged)
        return answers

    def _ask(
        self, question: bytes, servos: Sequence[int], size: int
    ) -> tuple[dict[int, bytes], bool]:
        """Asks once; returns the answers, which come in order, and whether damaged bytes came."""
        self._line.clear()
        self._answers.begin(question)
        self._line.write(question)
        answers: dict[int, bytes] = {}
        bytes_left = len(servos) * (self.overhead + size)
        while servos[-1] not in answers and (bytes_left > 0 or not self._answers.damaged):
            count = max(1, self.overhead + size - self._answers.pending)
            data = self._line.read(count)
            bytes_left -= len(data)
            for servo, answer in self._answers.take(data):
                if servo in servos:
                    answers[servo] = answer
            if len(data) < count:
                break
        self._clock.charge(sum(self._delays.get(servo, _USUAL_DELAY) for servo in answers))
        return answers, bool(self._answers.damaged or self._answers.pending)

    def _unanswered(self, servo: int, *, damaged: bool) -> DeviceError:
        who = readers(self._line.port)
        if damaged:
            return DeviceDataError(
                f"What servo {servo} ({self.name}) answers is damaged: two servos have this ID, or "
                "the line is bad.",
                f"Connect them to {self._line.port} one by one; check cable and ground, and {who}",
            )
        return DeviceTimeoutError(
            f"Servo {servo} ({self.name}) does not answer.",
            "Check its ID and baud rate (robotd scan lists who answers), its plug and the servos' "
            f"supply, and {who}",
        )

    def _unfit(self, servo: int, what: str, advice: str) -> DeviceDataError:
        return DeviceDataError(f"Servo {servo} ({self.name}) {what}.", advice)
