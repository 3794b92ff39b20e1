"""The servo driver: what moves the joints, whatever the board or the bus.

A *count* is the integer that a driver commands to an output; the calibration of a joint says which
angle a count is. 0 is not a count: it means that an output is limp.

Servos that answer say where they are: a driver of such has ``read_states``, and that declares it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, cast

from robot.drivers.buses import Buses
from robot.errors import CommandError
from robot.toml_sections import Section


class ServoBus(Protocol):
    """An open servo driver.

    Attributes:
        name: What the device is called in sentences, such as ``SV203``.
    """

    name: str

    @property
    def repeats(self) -> int:
        """Queries that had to be asked again, because the answer was damaged or did not come."""

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Commands outputs to counts, and returns when they are sent.

        A device that was reset since it was last read must not follow: its servos would leap. Nor
        one that another program altered, as far as the driver can tell before it sends.

        Raises:
            CommandError: An output or count out of range; nothing was sent.
            DeviceError: The device failed.
        """

    def read_counts(self, outputs: Sequence[int]) -> dict[int, int]:
        """The counts that the device holds, 0 where an output is limp.

        A driver whose device cannot be read back gives what it last sent, and 0 before that.
        """

    def release(self, outputs: Sequence[int]) -> None:
        """Lets outputs go limp."""

    def verify(self, expected: Mapping[int, int]) -> list[int]:
        """Compares the device with what it should hold.

        Returns:
            The outputs that differ; none for a device that cannot be read back.

        Raises:
            DeviceError: The device was reset or altered, or failed.
        """

    def forget(self) -> None:
        """Takes the device, reset or not, as the next ``read_counts`` finds it."""

    def seconds_for(self, changed: int) -> float:
        """How long ``set_counts`` takes for so many outputs, s."""

    def reopen(self) -> None:
        """Closes the link, which may be dead, and opens it anew under the configured name.

        Raises:
            DeviceMissingError: It cannot be opened.
        """

    def close(self) -> None:
        """Closes the link; the servos stay where they are if the device can hold them."""


@dataclass(frozen=True, kw_only=True)
class ServoState:
    """What a servo says of itself.

    Attributes:
        position: Where it is, in counts, of which it need not be a whole one.
        driven: Whether its torque is on.
        fault: What is wrong with it in its own opinion, in words such as ``overload``; or empty.
        load: How hard it drives, as a share of the most that it can; positive to higher counts.
        voltage: Of its supply, V.
        temperature: °C.
        current: That it takes, A.
        limits: The counts between which it lets itself be driven.
    """

    position: float
    driven: bool
    fault: str = ""
    load: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    current: float | None = None
    limits: tuple[float, float] | None = None


class AnsweringServoBus(ServoBus, Protocol):
    """An open driver of servos that say where they are.

    ``set_counts`` makes the goal of a limp output its present position before its torque goes on.
    ``verify`` raises ``DeviceDataError`` where a servo restarted or switched its torque off.
    """

    def read_states(self, outputs: Sequence[int]) -> dict[int, ServoState]:
        """What servos say of themselves, by output.

        Raises:
            DeviceError: One does not answer, or not in order.
        """


def answering(servos: ServoBus) -> AnsweringServoBus | None:
    """The driver, if its servos say where they are."""
    found = callable(getattr(servos, "read_states", None))
    return cast(AnsweringServoBus, servos) if found else None


def check_outputs(outputs: Iterable[int], known: range) -> None:
    """Refuses outputs that there are none of.

    Raises:
        CommandError: Names the first.
    """
    for output in outputs:
        if output not in known:
            raise CommandError(
                f"the servo boards have outputs {known[0]} to {known[-1]}, not {output}"
            )


def check_counts(counts: Mapping[int, int], known: range, outputs: range) -> None:
    """Refuses counts that no output can be commanded to, and outputs that there are none of.

    Raises:
        CommandError: Names the first.
    """
    check_outputs(counts, outputs)
    for output, count in counts.items():
        if count not in known:
            raise CommandError(
                f"servo {output}: the count must lie in {known[0]} to {known[-1]}, not {count}"
            )


class ServoSettings(Protocol):
    """The ``[servos]`` table of one kind of servo driver; what the registry names.

    A frozen dataclass: its ``repr`` is part of the configuration's hash. ``str`` says where the
    device is, for the log.

    Attributes:
        name: As ``ServoBus.name``.
        reads_back: Whether the device can be asked for the counts that it holds.
    """

    name: ClassVar[str]
    reads_back: ClassVar[bool]

    @property
    def outputs(self) -> range:
        """The numbers of its outputs, consecutive, of all boards together."""

    @property
    def counts(self) -> range:
        """The counts that it can command, consecutive, from 1 or above: range and resolution."""

    @property
    def per_update(self) -> int:
        """Outputs that one transmission commands, and that are verified at once."""

    @classmethod
    def read(cls, table: Section) -> ServoSettings:
        """Reads the table's keys, ``driver`` aside.

        Raises:
            ConfigError: Names file, key and reason.
        """

    def open(self, buses: Buses) -> ServoBus:
        """Opens the link to the device.

        Raises:
            DeviceMissingError: It cannot be opened; the sentence says why.
        """
