"""Packets of Feetech's STS and SMS servos, and how they are found on a line.

A packet is a header, ID, length, instruction, parameters and a checksum. In an answer the error
stands in the place of the instruction.

Source: Feetech, protocol manual of the STS and SMS series.
"""

from __future__ import annotations

from typing import Final

from robot.drivers.servos import servo_packets
from robot.drivers.servos.servo_packets import BROADCAST, Packet

OVERHEAD: Final = 6
"""Bytes of a packet around its parameters."""

_HEADER: Final = b"\xff\xff"
_MAX_LENGTH: Final = 250


def encode(packet: Packet) -> bytes:
    """A packet as it goes over the line."""
    body = bytes((packet.id, len(packet.parameters) + 2, packet.instruction)) + packet.parameters
    return _HEADER + body + bytes((_checksum(body),))


class Decoder(servo_packets.Decoder):
    """Finds Feetech's packets; ``damaged`` counts impossible lengths and wrong checksums."""

    header = _HEADER

    def take(self, data: bytes) -> list[tuple[int, bytes]]:
        """Takes bytes; returns the answers complete with them: ID, and error with data."""
        return [
            (packet.id, bytes((packet.instruction,)) + packet.parameters)
            for packet in self.feed(data)
            if packet.id != BROADCAST and encode(packet) != self._question
        ]

    def _first(self, buffer: bytearray) -> tuple[int, Packet | None]:
        if len(buffer) < OVERHEAD:
            return 0, None
        length = buffer[3]
        end = length + 4
        if buffer[2] == _HEADER[0] or length < 2:
            return 1, None
        if length <= _MAX_LENGTH and len(buffer) < end:
            return 0, None
        if length > _MAX_LENGTH or _checksum(bytes(buffer[2 : end - 1])) != buffer[end - 1]:
            self.damaged += 1
            return 1, None
        return end, Packet(buffer[2], buffer[4], bytes(buffer[5 : end - 1]))


def _checksum(body: bytes) -> int:
    return ~sum(body) & 0xFF
