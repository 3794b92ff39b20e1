"""The servo driver: what moves the joints, whatever the board or the bus.

A *count* is the integer that a driver commands to an output; the calibration of a joint says which
angle a count is. 0 is not a count: it means that an output is limp.

Servos that answer tell their positions: their driver has ``read_states``, by which it is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, cast

from robot.drivers.buses import Buses, DriverSettings
from robot.errors import CommandError


class ServoBus(Protocol):
    """An open servo driver.

    Attributes:
        name: Name of the device, for messages, such as ``SV203``.
    """

    name: str

    @property
    def repeats(self) -> int:
        """Number of queries asked again, because the answer was damaged or did not come."""

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Commands outputs to counts, and returns when they are sent.

        A device that was reset since it was last read must not follow: its servos would leap. Nor
        must one that another program altered, as far as the driver can tell before it sends.

        Raises:
            CommandError: An output or count is out of range; nothing was sent.
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
        """Makes the next ``read_counts`` take the device as it finds it, reset or not."""

    def seconds_for(self, changed: int) -> float:
        """Time that ``set_counts`` takes for ``changed`` outputs, s."""

    def reopen(self) -> None:
        """Closes the link, which may be dead, and opens it anew under the configured name.

        Raises:
            DeviceMissingError: The link cannot be opened.
        """

    def close(self) -> None:
        """Closes the link; the servos stay where they are if the device can hold them."""


@dataclass(frozen=True, kw_only=True)
class ServoState:
    """What a servo says of itself.

    Attributes:
        position: Position in counts, not necessarily whole.
        driven: Whether the torque is on.
        fault: Fault that the servo reports, in words such as ``overload``; empty for none.
        load: Drive as a share of the largest possible; positive towards higher counts.
        voltage: Voltage of the supply, V.
        temperature: Temperature, °C.
        current: Current that the servo takes, A.
        limits: Counts between which the servo lets itself be driven.
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
            DeviceError: A servo does not answer, or not properly.
        """


def answering(servos: ServoBus) -> AnsweringServoBus | None:
    """The driver, if its servos tell their positions, else ``None``."""
    is_answering = callable(getattr(servos, "read_states", None))
    return cast(AnsweringServoBus, servos) if is_answering else None


def check_outputs(outputs: Iterable[int], known: range) -> None:
    """Refuses outputs that do not exist.

    Raises:
        CommandError: An output does not exist; names the first.
    """
    for output in outputs:
        if output not in known:
            raise CommandError(
                f"the servo boards have outputs {known[0]} to {known[-1]}, not {output}"
            )


def check_counts(counts: Mapping[int, int], known: range, outputs: range) -> None:
    """Refuses counts that no output can be commanded to, and outputs that do not exist.

    Raises:
        CommandError: There is such an output or count; names the first.
    """
    check_outputs(counts, outputs)
    for output, count in counts.items():
        if count not in known:
            raise CommandError(
                f"servo {output}: the count must lie in {known[0]} to {known[-1]}, not {count}"
            )


class ServoSettings(DriverSettings, Protocol):
    """The settings of one kind of servo driver, the ``[servos]`` table.

    Attributes:
        reads_back: Whether the device can be asked for the counts that it holds.
    """

    reads_back: ClassVar[bool]

    @property
    def outputs(self) -> range:
        """Numbers of the outputs, consecutive, of all boards together."""

    @property
    def counts(self) -> range:
        """Counts that can be commanded, consecutive, from 1 or above: range and resolution."""

    @property
    def known_counts(self) -> range:
        """Counts that a calibration may have: ``counts`` under the widest limits there can be.

        Where they are the same, the servos turn as far per count.
        """

    @property
    def per_update(self) -> int:
        """Number of outputs that one transmission commands, and that are verified at once."""

    def open(self, buses: Buses) -> ServoBus:
        """Opens the link to the device."""
