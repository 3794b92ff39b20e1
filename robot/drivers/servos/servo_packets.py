"""Packets of serial bus servos: what is the same for every family of them.

The protocols of ROBOTIS and Feetech have the same instructions. What differs is what stands around
them, which a family's ``Decoder`` takes off.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Final

BROADCAST: Final = 0xFE
"""The id to which every servo listens."""


class Instruction(IntEnum):
    """What a packet asks for; ``REBOOT`` and ``STATUS`` only DYNAMIXEL servos know."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REBOOT = 0x08
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


@dataclass(frozen=True)
class Packet:
    """One packet, without header, length, stuffing and checksum.

    Attributes:
        id: ID of the servo that is asked, or that answers; ``BROADCAST`` is all of them.
        instruction: An ``Instruction``, or another byte, which a servo does not know; in the answer
            of a Feetech servo, its error.
        parameters: Parameters of the instruction.
    """

    id: int
    instruction: int
    parameters: bytes = b""


class Decoder(ABC):
    """Finds packets in bytes as they come, whatever stands between them.

    Attributes:
        header: Bytes with which each packet begins.
        damaged: Number of damaged packets, since ``begin``.
    """

    header: ClassVar[bytes]

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = bytearray()
        self._question = b""

    @property
    def pending(self) -> int:
        """Number of bytes that may be the beginning of a packet."""
        return len(self._buffer)

    def begin(self, question: bytes = b"") -> None:
        """Forgets what came before a question, which some adapters echo."""
        self._buffer.clear()
        self._question = question
        self.damaged = 0

    def feed(self, data: bytes) -> list[Packet]:
        """Takes bytes; returns the packets that are complete with them."""
        buffer, packets = self._buffer, list[Packet]()
        buffer += data
        while (start := buffer.find(self.header)) >= 0:
            del buffer[:start]
            size, packet = self._first(buffer)
            if not size:
                return packets
            del buffer[:size]
            packets += [] if packet is None else [packet]
        # What it ends with may be the beginning of a header.
        del buffer[: max(0, len(buffer) - len(self.header) + 1)]
        return packets

    @abstractmethod
    def take(self, data: bytes) -> list[tuple[int, bytes]]:
        """Takes bytes; returns the answers complete with them: ID, and error with data."""

    @abstractmethod
    def _first(self, buffer: bytearray) -> tuple[int, Packet | None]:
        """How many bytes the packet at the front takes, 0 if more are needed, and that packet.

        Of a damaged one, which it counts, or of none at all: how many bytes to leave out.
        """
