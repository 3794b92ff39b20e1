"""NXP PCA9685: 16 servos a board, up to 62 boards on an I²C bus, 12 bits of the PWM period.

A count is the width of a pulse in ticks, 4096 to a period: 4.88 µs at 50 Hz, where the oscillator
runs at 25 MHz. Boards lie between 23 and 27 MHz, and nothing but an instrument tells: the frequency
of each is configured, and so the widths are kept in µs. PRE_SCALE does not depend on it, so to
measure the oscillator later does not change the pulse of any count. Outputs are numbered as on the
boards, 0 to 15 on the first one, 16 to 31 on the second, and so on.

A hobby servo jumps to wherever its first pulse tells it. So a board that was not set up yet is set
up with all outputs off, which is how it leaves its reset, and they stay off until they are
commanded; a board that already runs as it should, because it outlived the last daemon, is left as
it is, and read back.

A board that loses its supply comes back asleep: it takes commands and gives no pulses. And the bus
is open to other programs, which put boards to sleep, change the length of every tick, invert the
outputs or move them. So each move is preceded by a reading of all that the boards' pulses depend
on, and of the pulses: where anything is not as it was left, nothing is written, because putting it
right would leap as well. Between that reading and the move is a millisecond, and 7 more for each
further board; what is changed just then is found by reading back in the transfer that moves, too
late for this one move. Only a query sets a board up, when the driver begins and after it was told
to ``forget``.

Where the boards' pin OE is wired to an output line of the computer (``enable_line``), that line
cuts all pulses when the last output is released, whatever the bus does. Boards pull the pin down,
so that without the line, or without a daemon, their pulses go on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar, Final, TypeVar

from robot.drivers.buses import Buses
from robot.drivers.links.gpio import GPIODevices, GPIOLine, LinePlace, output_line
from robot.drivers.links.i2c import I2CLink
from robot.drivers.servos.pca9685_board import (
    ALL_CALL,
    BYTES_PER_OUTPUT,
    BYTES_TO_MOVE,
    BYTES_TO_READ,
    NAME,
    OUTPUTS,
    TICKS,
    PCA9685Board,
    by_board,
)
from robot.drivers.servos.servo_bus import check_counts, check_outputs
from robot.errors import CommandError, DeviceDataError, DeviceError
from robot.host.clock import Clock
from robot.toml_sections import Section

T = TypeVar("T")
ADDRESSES: Final = range(0x40, 0x80)
WIDTHS_US: Final = (500, 2500)
"""Widths of pulse that hobby servos know, µs; beyond, they run against their stops."""

RATES_HZ: Final = (40.0, 333.0)
ANALOGUE_RATES_HZ: Final = (40.0, 60.0)
OSCILLATOR_MHZ: Final = 25.0
OSCILLATORS_MHZ: Final = (22.0, 28.0)
"""Lowest and highest frequency of an oscillator, MHz; none beyond was reported."""

_SECONDS_PER_BYTE: Final = 9 / 100e3  # on a bus in standard mode


@dataclass(frozen=True, kw_only=True)
class PCA9685Settings:
    """Where the boards are, how often they pulse, and the widest and narrowest pulse.

    Attributes:
        bus: Number of the I²C bus.
        boards: Addresses of the boards, in the order of the outputs.
        prescale: Prescale of the chips' oscillators, for the update rate at 25 MHz.
        widths_us: The narrowest and the widest pulse, µs.
        oscillators_mhz: Measured frequency of each board, MHz, or ``None``: taken as 25.
        enable: The GPIO line to the boards' pin OE, or ``None``.
    """

    name: ClassVar = NAME
    reads_back: ClassVar = True
    bus: int
    boards: tuple[int, ...]
    prescale: int
    widths_us: tuple[float, ...]
    oscillators_mhz: tuple[float, ...] | None = None
    enable: LinePlace | None = None

    @classmethod
    def read(cls, table: Section) -> PCA9685Settings:
        """Reads the table's keys, as in ``robot-pi.toml``."""
        boards = table.integers(
            "address", ADDRESSES[0], ADDRESSES[-1], (ADDRESSES[0],), written="{:#x}"
        )
        if ALL_CALL in boards:
            raise table.refuse("address", "must leave out 0x70, where all boards answer at once.")
        kind = table.choice("servos", ("analogue", "digital"), "analogue")
        rate = table.number("update_hz", *RATES_HZ, default=50)
        if kind == "analogue" and rate > ANALOGUE_RATES_HZ[1]:
            raise table.refuse(
                "update_hz",
                f"is {rate:g}, and an analogue servo follows {ANALOGUE_RATES_HZ[0]:g} to "
                f'{ANALOGUE_RATES_HZ[1]:g}; write servos = "digital" if the data sheet of each '
                "of them allows it.",
            )
        low, high = table.numbers("pulse_us", 2, *WIDTHS_US, default=WIDTHS_US)
        if low >= high:
            raise table.refuse("pulse_us", f"must rise, not {low:g} to {high:g}.")
        key = "oscillator_mhz"
        oscillators: tuple[float, ...] | None = None
        if table.has(key) and len(boards) > 1:
            oscillators = table.numbers(key, len(boards), *OSCILLATORS_MHZ)
        elif table.has(key):
            oscillators = (table.number(key, *OSCILLATORS_MHZ),)
        return cls(
            bus=table.integer("bus", 0, 255, 1),
            boards=boards,
            prescale=round(OSCILLATOR_MHZ * 1e6 / (TICKS * rate)) - 1,
            widths_us=(low, high),
            oscillators_mhz=oscillators,
            enable=LinePlace.read(table, "enable_") if table.has("enable_line") else None,
        )

    @property
    def outputs(self) -> range:
        """The outputs of all boards."""
        return range(OUTPUTS * len(self.boards))

    @property
    def ticks_us(self) -> tuple[float, ...]:
        """The width of a count on each board, µs."""
        oscillators = self.oscillators_mhz or (OSCILLATOR_MHZ,) * len(self.boards)
        return tuple((self.prescale + 1) / mhz for mhz in oscillators)

    @property
    def counts(self) -> range:
        """The counts between the narrowest and the widest pulse, on every board."""
        low, high = self.widths_us
        ticks = self.ticks_us
        return range(-int(-low / min(ticks) // 1), int(high / max(ticks)) + 1)

    @property
    def known_counts(self) -> range:
        """The counts of all pulses that servos know, whatever the oscillator: by the prescale."""
        low, high = (
            width * mhz / (self.prescale + 1)
            for width, mhz in zip(WIDTHS_US, OSCILLATORS_MHZ, strict=True)
        )
        return range(math.ceil(low), math.floor(high) + 1)

    @property
    def per_update(self) -> int:
        """Number of all outputs: one update commands them all."""
        return len(self.outputs)

    @property
    def period(self) -> float:
        """Time from one pulse to the next, on the slowest board, s."""
        return TICKS * max(self.ticks_us) / 1e6

    def oscillator(self, hz: float) -> float:
        """Oscillator frequency of a board that gives ``hz`` pulses a second, MHz."""
        return hz * TICKS * (self.prescale + 1) / 1e6

    @property
    def claims(self) -> tuple[str, ...]:
        """The boards' own addresses, the one at which all of them answer, and the line to OE."""
        line = () if self.enable is None else (f"GPIO {self.enable}",)
        return (*(f"0x{one:x} on I²C bus {self.bus}" for one in (*self.boards, ALL_CALL)), *line)

    def open(self, buses: Buses) -> PCA9685:
        """Opens the bus and identifies the boards; outputs stay as they are."""
        return PCA9685(
            buses.i2c(self.bus),
            settings=self,
            clock=buses.clock,
            gpio=buses.gpio,
        )

    def __str__(self) -> str:
        boards = " and ".join(f"0x{address:x}" for address in self.boards)
        ticks = " and ".join(f"{tick:.2f}" for tick in self.ticks_us)
        caveat = "" if self.oscillators_mhz else " if the oscillator runs at 25 MHz, not measured"
        return (
            f"{boards} on I²C bus {self.bus}, {1 / self.period:.1f} pulses a second, counts of "
            f"{ticks} µs{caveat}"
        )


class PCA9685:
    """The boards of one robot; not thread-safe.

    Methods raise ``CommandError`` for an output or count out of range, and send nothing then;
    ``DeviceError`` where a board failed, or does not run as it was set up (``DeviceDataError``).

    Args:
        link: The bus, which the driver opens and closes.
        settings: Where the boards are.
        clock: Paces the updates: one a pulse.
        gpio: GPIO chips, for the line to the pin OE.

    Attributes:
        name: Name of the boards, for messages.

    Raises:
        DeviceError: A board does not answer, or is something else.
    """

    name = NAME

    def __init__(
        self,
        link: I2CLink,
        *,
        settings: PCA9685Settings,
        clock: Clock,
        gpio: GPIODevices,
    ):
        self._link = link
        self._gpio = gpio
        self._line: GPIOLine | None = None
        self._on = False
        self._settings = settings
        self._clock = clock
        self._driven: set[int] = set()
        self._held: dict[int, int] = {}  # counts that outputs were last read at or commanded to
        self._ready = False
        self._open()

    @property
    def repeats(self) -> int:
        """Number of times that a transfer was made again, because nobody acknowledged."""
        return self._link.repeats

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Commands outputs to counts, and waits for a pulse of that width.

        Args:
            counts: Count by output. All outputs of a board change at the same time.

        Raises:
            CommandError: The boards were not read since the driver began, forgot or noticed a
                reset; nothing was sent.
            DeviceDataError: A board, or the pulse of an output, is not as it was left; nothing was
                sent.
        """
        if not self._ready:
            raise CommandError("read the servo board's counts before moving its servos")
        check_counts(counts, self._settings.counts, self._settings.outputs)
        altered = self._differing(self._held)
        if altered:
            plural = "s" if altered[1:] else ""
            raise DeviceDataError(
                f"The servo board (PCA9685) does not have the commands for output{plural} "
                f"{', '.join(map(str, altered))}: another program wrote there, or writes were "
                "lost.",
                "Check that nothing else drives the board, then its cable.",
            )
        self._driven |= counts.keys()
        for index, outputs in by_board(counts).items():
            for output in outputs:
                self._held.pop(output, None)
            moves = {output % OUTPUTS: counts[output] for output in outputs}
            self._sound(self._boards[index].move, moves)
            self._held |= {output: counts[output] for output in outputs}
        self._switch(on=True)
        self._clock.sleep(self._settings.period)

    def release(self, outputs: Iterable[int]) -> None:
        """Stops the pulses of some outputs; if no other has any, of all boards at once.

        That takes one transfer to the address at which every board answers, also one that was reset
        or that does not answer at its own address any more.

        Raises:
            DeviceError: A board failed; the others were told.
        """
        released = list(outputs)
        check_outputs(released, self._settings.outputs)
        self._driven -= set(released)
        self._held |= dict.fromkeys(released, 0)
        if not self._driven:
            self._switch(on=False)
            with suppress(DeviceError):  # each is told once more, and its answer awaited
                self._board(ALL_CALL).all_off()
        failure: DeviceError | None = None
        for board, group in by_board(released).items():
            for output in group:
                try:
                    self._boards[board].off(output % OUTPUTS)
                except DeviceError as error:
                    failure = error
        if failure is not None:
            raise failure

    def read_counts(self, outputs: Sequence[int]) -> dict[int, int]:
        """Sets up boards that do not run, and reads the registers; no servo reports anything.

        Returns:
            Count by output, 0 where there are no pulses.
        """
        check_outputs(outputs, self._settings.outputs)
        if not self._ready:
            for board in self._boards:
                board.set_up(self._clock.sleep)
            self._switch(on=self._on)  # the bus cannot tell the level of this line
            self._held.clear()
            self._ready = True
        all_counts = self._read()
        counts = {output: all_counts[output] for output in outputs}
        self._held |= counts
        self._driven |= {output for output, count in all_counts.items() if count}
        return counts

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """Compares the boards with the counts they should have; reads again if they differ.

        Returns:
            The outputs that differ, ascending.

        Raises:
            DeviceDataError: A board was not read since it was opened, or found altered.
        """
        check_outputs(expected, self._settings.outputs)
        if not self._ready:
            raise DeviceDataError(
                "The servo board (PCA9685) was not read since it failed or was opened.",
                "Read its counts first.",
            )
        return self._differing(expected)

    def forget(self) -> None:
        """Makes the next query set up each board that does not run as it should."""
        self._ready = False

    def reopen(self) -> None:
        """Closes the bus and opens it anew."""
        self.close()
        self.forget()
        self._open()

    def seconds_for(self, changed: int) -> float:
        """Time of ``set_counts``: a pulse, and the transfers on a bus of 100 kHz, s."""
        fixed = len(self._settings.boards) * (BYTES_TO_READ + BYTES_TO_MOVE)
        return self._settings.period + (fixed + changed * BYTES_PER_OUTPUT) * _SECONDS_PER_BYTE

    def close(self) -> None:
        """Closes the bus; the boards keep the servos where they are."""
        self._link.close()
        if self._line is not None:
            self._line.close()
            self._line = None

    def _open(self) -> None:
        self._link.open()
        try:
            self._link.keep_others_out(self.name)
            self._boards = [self._board(address) for address in self._settings.boards]
            for board in self._boards:
                board.identify()
            if self._settings.enable is not None:
                self._on = any(board.pulses() for board in self._boards)
                self._line = output_line(self._gpio, self._settings.enable, not self._on)
        except BaseException:
            self._link.close()
            raise

    def _switch(self, *, on: bool) -> None:
        """Lets the pulses of all boards out, or cuts them: the pin is active low."""
        self._on = on
        if self._line is not None:
            self._line.set(not on)

    def _board(self, address: int) -> PCA9685Board:
        settings = self._settings
        return PCA9685Board(self._link, address, prescale=settings.prescale, counts=settings.counts)

    def _read(self) -> dict[int, int]:
        """Counts of all outputs; checks that the boards run as they were set up."""
        counts: dict[int, int] = {}
        for index, board in enumerate(self._boards):
            counts.update(enumerate(self._sound(board.counts), OUTPUTS * index))
        return counts

    def _differing(self, expected: Mapping[int, int]) -> list[int]:
        counts = self._read()
        if any(counts[output] != count for output, count in expected.items()):
            counts = self._read()  # it may be the reading that was damaged
        return sorted(output for output, count in expected.items() if counts[output] != count)

    def _sound(self, transfer: Callable[..., T], *arguments: Any) -> T:
        """Makes a transfer with a board that was set up; if it was altered, forgets all boards."""
        try:
            return transfer(*arguments)
        except DeviceDataError:
            self.forget()
            raise
