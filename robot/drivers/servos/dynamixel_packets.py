"""Packets of the DYNAMIXEL protocol 2.0: bytes on the line ↔ instructions and their answers.

    FF FF FD 00  id  length (2 bytes, low first)  instruction  parameters…  CRC (2, low first)

*length* counts what follows it. The header never stands inside a packet: after FF FF FD in what the
instruction and its parameters are made of, a further FD is stuffed in, which counts for length and
CRC and is taken out again when the CRC was found right. An answer (status) is a packet with
instruction 0x55, whose first parameter is the error.

Source: ROBOTIS e-Manual, DYNAMIXEL Protocol 2.0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import Final

from robot.drivers.servos import servo_packets
from robot.drivers.servos.servo_packets import BROADCAST, Instruction, Packet

HEADER: Final = b"\xff\xff\xfd\x00"
OVERHEAD: Final = 11
"""Bytes of a status packet without parameters; an instruction packet has one fewer."""
LONGEST: Final = 1024
"""Most bytes of a packet; one with a larger length is damaged."""

_BEFORE_INSTRUCTION: Final = len(HEADER) + 3
_CRC_BYTES: Final = 2
_STUFFED: Final = b"\xff\xff\xfd"
_POLYNOMIAL: Final = 0x8005


class PacketError(IntEnum):
    """Why a servo did not do what a packet asked for."""

    RESULT_FAIL = 0x01
    INSTRUCTION = 0x02
    CRC = 0x03
    DATA_RANGE = 0x04
    DATA_LENGTH = 0x05
    DATA_LIMIT = 0x06
    ACCESS = 0x07


ALERT: Final = 0x80
"""Bit of a status packet's error: the servo has a hardware error, whatever it was asked."""


def _crc_of_byte(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1) ^ (_POLYNOMIAL if crc & 0x8000 else 0)
    return crc & 0xFFFF


_CRC_TABLE: Final = tuple(map(_crc_of_byte, range(256)))


def crc16(data: Iterable[int]) -> int:
    """The CRC of bytes: polynomial 0x8005, high bit first, from 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _CRC_TABLE[crc >> 8 ^ byte]
    return crc


def encode(packet: Packet) -> bytes:
    """A packet as it goes over the line."""
    body = bytes((packet.instruction,)) + packet.parameters
    body = body.replace(_STUFFED, _STUFFED + b"\xfd")
    length = len(body) + _CRC_BYTES
    frame = HEADER + bytes((packet.id,)) + length.to_bytes(2, "little") + body
    return frame + crc16(frame).to_bytes(2, "little")


class Decoder(servo_packets.Decoder):
    """Finds DYNAMIXEL's packets; ``damaged`` counts wrong lengths and CRCs."""

    header = HEADER

    def take(self, data: bytes) -> list[tuple[int, bytes]]:
        """Takes bytes; returns the answers complete with them: ID, and error with data."""
        return [
            (packet.id, packet.parameters)
            for packet in self.feed(data)
            if packet.instruction == Instruction.STATUS and packet.parameters
        ]

    def _first(self, buffer: bytearray) -> tuple[int, Packet | None]:
        if len(buffer) < _BEFORE_INSTRUCTION:
            return 0, None
        length = int.from_bytes(buffer[_BEFORE_INSTRUCTION - 2 : _BEFORE_INSTRUCTION], "little")
        end = _BEFORE_INSTRUCTION + length
        if length <= _CRC_BYTES or end > LONGEST or buffer.find(HEADER, len(HEADER), end - 1) > 0:
            return self._damaged()  # its last byte may end a header: the CRC is not stuffed
        if len(buffer) < end:
            return 0, None
        body_end = end - _CRC_BYTES
        if crc16(buffer[:body_end]) != int.from_bytes(buffer[body_end:end], "little"):
            return self._damaged()
        body = bytes(buffer[_BEFORE_INSTRUCTION:body_end]).replace(_STUFFED + b"\xfd", _STUFFED)
        return end, Packet(buffer[len(HEADER)], body[0], body[1:])

    def _damaged(self) -> tuple[int, None]:
        """Goes on behind the damaged packet's header: another may stand in its supposed length."""
        self.damaged += 1
        return len(HEADER), None


def read(servo: int, address: int, size: int) -> Packet:
    """Packet that asks one servo for ``size`` bytes from an address on."""
    return Packet(servo, Instruction.READ, _word(address) + _word(size))


def sync_write(address: int, values: Mapping[int, int], size: int) -> Packet:
    """Packet that writes a number at the same address of several servos; none answers."""
    parts = (
        bytes((servo,)) + value.to_bytes(size, "little", signed=value < 0)
        for servo, value in values.items()
    )
    head = _word(address) + _word(size)
    return Packet(BROADCAST, Instruction.SYNC_WRITE, head + b"".join(parts))


def sync_read(address: int, size: int, servos: Iterable[int]) -> Packet:
    """Packet that asks several servos for the same bytes; each answers, in this order."""
    return Packet(
        BROADCAST, Instruction.SYNC_READ, _word(address) + _word(size) + bytes(tuple(servos))
    )


def _word(value: int) -> bytes:
    return value.to_bytes(2, "little")
