"""Emulated serial bus servos: what is the same for every family of them.

A family brings its servo (``BusServo``) and its packets, with how they are written and found.
Servos are told where the world has their horns; without a world, a horn is wherever its motor
drives it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import zip_longest
from typing import ClassVar, Final, Generic, TypeVar

from robot.drivers.servos.servo_packets import BROADCAST, Decoder, Instruction, Packet
from robot.host.clock import Clock
from sim_robot.electronics.fault_switch import EVERY_NTH, Fault
from sim_robot.electronics.serial_device import SerialDevice
from sim_robot.electronics.servos import Felt

STEPS: Final = 4096
"""Number of positions in a turn."""
LIMP: Final = 0
BOOT: Final = 0.3
"""Seconds after a reset in which a servo answers nothing; a guess."""

_WARM, _HOT = 38, 85  # °C
_MOVED_GOAL: Final = 3000  # where the event "moved" sends a servo


class BusServo(ABC):
    """One servo; no I/O, no threads.

    Attributes:
        USUAL: Usual voltage of the supply, 0.1 V.
        DIPPED: Voltage of the supply when it dips, 0.1 V.
        now: Tells the time, s.
        on_move: Called with position before and after, whenever the host has it driven elsewhere.
        position: Position of the horn, in steps.
        torque: Share of its torque that the servo gives.
        heat: Temperature, °C.
        volts: Voltage of the supply, 0.1 V.
        switched_on: Time of the last reset, s.
    """

    USUAL: ClassVar[int]
    DIPPED: ClassVar[int]

    def __init__(self) -> None:
        self.now: Callable[[], float] = lambda: 0.0
        self.on_move: Callable[[float, float], None] = lambda before, after: None
        self.position = STEPS / 2
        self.torque = 0.0
        self.heat, self.volts = _WARM, self.USUAL
        self.switched_on = -BOOT
        self._felt = False

    @property
    @abstractmethod
    def number(self) -> int:
        """ID of the servo."""

    @property
    @abstractmethod
    def baud(self) -> int:
        """Baud rate at which the servo listens."""

    @property
    def deaf(self) -> bool:
        """Whether the servo has not yet come up after a reset."""
        return self.now() - self.switched_on < BOOT

    def feel(self, felt: Felt) -> None:
        """Takes over the position and the torque that the world gives the servo."""
        self.position, self.torque = felt
        self._felt = True

    def warm_up(self) -> None:
        """Makes the servo one that has been on for a while."""
        self.switched_on = self.now() - BOOT

    @abstractmethod
    def power_up(self) -> None:
        """Does what happens when the supply comes (back)."""

    @abstractmethod
    def look(self) -> None:
        """Brings the servo's state up to date with its temperature and supply."""

    @abstractmethod
    def overload(self) -> None:
        """Makes the servo find itself overloaded."""

    @abstractmethod
    def send_to(self, position: int) -> None:
        """Moves the servo as another program would."""

    @abstractmethod
    def set_wheel(self, on: bool) -> None:
        """Sets wheel mode, or position mode again, as another program would; torque goes off."""

    @abstractmethod
    def driven_to(self) -> float:
        """The position that the motor drives to, in steps; ``LIMP`` where it has no torque."""

    @abstractmethod
    def twin(self) -> BusServo:
        """Another servo with the same ID, in another state."""

    @abstractmethod
    def answer(self, packet: Packet) -> Packet | None:
        """Acts on a packet for this servo alone; returns its answer, or ``None``."""

    def _drives(self, to: float) -> float:
        if not self._felt:
            self.position = to
        return max(to, 1.0)


S = TypeVar("S", bound=BusServo)


class BusServos(SerialDevice, Generic[S]):
    """Servos on a serial line.

    Args:
        servos: Servos in the order of the robot's joints.
        decoder: Finds the packets in what comes.

    Attributes:
        SYNC_HEAD: Bytes before the servos in the parameters of a sync instruction: address and size
            of what is read or written, half of them each.
        servos: The servos, as given.
    """

    SYNC_HEAD: ClassVar[int]
    FAULTS: ClassVar[Mapping[str, Fault]] = {
        **SerialDevice.FAULTS,
        "silent": Fault("servo n answers nothing and has no torque, as without its cable"),
        "garbage": Fault("every n-th answer arrives with a bit flipped", EVERY_NTH),
        "lost": Fault("every n-th answer is lost", EVERY_NTH),
        "twin": Fault("another servo on the line has the id n, too"),
        "hot": Fault(f"servo n is at {_HOT} °C: it switches its torque off"),
        "dip": Fault("the supply gives less than the servos are set to bear"),
        "wheel_mode": Fault("another program makes a wheel of servo n, its torque off"),
        "reboot": Fault(
            "the supply of servo n dips, of all without a number: it comes back limp", once=True
        ),
        "overload": Fault("servo n is overloaded, and switches its torque off", once=True),
        "moved": Fault(f"another program on the line sends servo n to {_MOVED_GOAL}", once=True),
    }

    def __init__(self, servos: Iterable[S], decoder: Decoder):
        self.servos = list(servos)
        self._decoder = decoder
        self._answer_count = 0
        self._twins: list[S] = []
        self._wheel: S | None = None
        self._find: Callable[[], Iterable[Felt]] = tuple
        super().__init__()

    @staticmethod
    @abstractmethod
    def encode(packet: Packet) -> bytes:
        """A packet as it goes over the line."""

    def connect(self, clock: Clock) -> None:
        """Gives the servos the time of their world, in which they have been on for a while."""
        for servo in self.servos:
            servo.now = clock.now
            servo.warm_up()

    def watch_moves(self, on_move: Callable[[int, float, float], None]) -> None:
        """Reports every move that the host commands: servo from 1, position before and after."""
        for number, servo in enumerate(self.servos, 1):
            servo.on_move = partial(on_move, number)

    def feel(self, find: Callable[[], Iterable[Felt]]) -> None:
        """Puts the servos into a world.

        Args:
            find: Returns the position of each servo's horn, in steps, and the share of its torque
                that it gives; asked when bytes come.
        """
        self._find = find

    def pulses(self) -> tuple[int, ...]:
        """The position that each servo drives to, in steps, or ``LIMP``."""
        with self._changed:
            silent = self._faults.get("silent")
            return tuple(
                LIMP if number == silent else round(servo.driven_to())
                for number, servo in enumerate(self.servos, 1)
            )

    def numbers(self, fault: str) -> Sequence[int]:
        """Numbers of a fault: the servos' from 1 if it befalls one; of a reboot also 0, for all."""
        match fault:
            case "silent" | "twin" | "hot" | "wheel_mode" | "overload" | "moved":
                return range(1, len(self.servos) + 1)
            case "reboot":
                return range(len(self.servos) + 1)
        return super().numbers(fault)

    def inject(self, fault: str, value: int = 0, amount: float = 0.0) -> None:
        """Switches a fault on, or makes an event happen."""
        super().inject(fault, value, amount)
        self._apply_faults()

    def mend(self, fault: str | None = None) -> None:
        """Switches a fault off, or all of them."""
        super().mend(fault)
        self._apply_faults()

    def receive(self, data: bytes) -> bytes:
        """Gives bytes to every servo that listens at this baud rate; returns what they answer."""
        if self.host_baud not in {servo.baud for servo in self.servos}:
            return b""  # noise, to all of them
        for servo, felt in zip(self.servos, self._find(), strict=False):
            servo.feel(felt)
        return b"".join(line for packet in self._decoder.feed(data) for line in self._obey(packet))

    def _obey(self, packet: Packet) -> Iterator[bytes]:
        """Acts on a packet; yields what comes back, one servo after another."""
        ids: Iterable[int] = (packet.id,)
        head, rest = packet.parameters[: self.SYNC_HEAD], packet.parameters[self.SYNC_HEAD :]
        if packet.instruction == Instruction.SYNC_WRITE:
            address, size = head[: len(head) // 2], int.from_bytes(head[len(head) // 2 :], "little")
            for start in range(0, len(rest) - size, size + 1):
                data = rest[start + 1 : start + 1 + size]
                for servo in self.called(rest[start]):
                    servo.answer(Packet(BROADCAST, Instruction.WRITE, address + data))
            return
        if packet.instruction == Instruction.SYNC_READ:
            ids, packet = rest, Packet(0, Instruction.READ, head)
        elif packet.id == BROADCAST:
            ids = sorted({servo.number for servo in self.servos})
        for number in ids:
            answers = [servo.answer(packet) for servo in self.called(number)]
            yield self.at_once([self.encode(answer) for answer in answers if answer is not None])

    def called(self, number: int) -> list[S]:
        """Servos with an ID that listen at the host's baud rate."""
        silent = self._faults.get("silent")
        return [
            servo
            for index, servo in enumerate((*self.servos, *self._twins), 1)
            if servo.number == number and servo.baud == self.host_baud and index != silent
        ]

    def at_once(self, answers: Sequence[bytes]) -> bytes:
        """Bytes on the line when several servos send packets at the same time; a low level wins."""
        line = bytes(map(_wired_and, zip_longest(*answers, fillvalue=0xFF)))
        return self._damage_answer(line) if line and self._faults else line

    def _damage_answer(self, line: bytes) -> bytes:
        self._answer_count += 1
        if self._strikes("lost", self._answer_count):
            return b""
        if self._strikes("garbage", self._answer_count):
            return line[:-1] + bytes((line[-1] ^ 1,))
        return line

    def _happen(self, event: str, value: int) -> None:
        with self._changed:
            for servo in [self.servos[value - 1]] if value else self.servos:
                match event:
                    case "reboot":
                        servo.power_up()
                    case "overload":
                        servo.overload()
                    case "moved":
                        servo.send_to(_MOVED_GOAL)

    def _apply_faults(self) -> None:
        """Brings the servos into the state that the faults make."""
        with self._changed:
            hot, twin, wheel = (self._faults.get(name) for name in ("hot", "twin", "wheel_mode"))
            for number, servo in enumerate(self.servos, 1):
                servo.heat = _HOT if number == hot else _WARM
                servo.volts = servo.DIPPED if "dip" in self._faults else servo.USUAL
                servo.look()
            self._twins = [] if twin is None else [self.servos[twin - 1].twin()]  # type: ignore[list-item]
            if wheel is None and self._wheel is not None:
                self._wheel.set_wheel(False)
                self._wheel = None
            elif wheel is not None and self._wheel is None:
                self._wheel = self.servos[wheel - 1]
                self._wheel.set_wheel(True)


def _wired_and(column: Sequence[int]) -> int:
    value = 0xFF
    for byte in column:
        value &= byte
    return value
