"""The packets, against the examples of the manual and against anything that a line may do."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.drivers.servos.dynamixel_packets import (
    HEADER,
    LONGEST,
    Decoder,
    encode,
    read,
    sync_read,
    sync_write,
)
from robot.drivers.servos.servo_packets import BROADCAST, Instruction, Packet

EXAMPLES = [  # e-Manual, DYNAMIXEL Protocol 2.0, Instruction Details
    (Packet(1, Instruction.PING), "FF FF FD 00 01 03 00 01 19 4E"),
    (Packet(BROADCAST, Instruction.PING), "FF FF FD 00 FE 03 00 01 31 42"),
    (Packet(1, 0x55, b"\x00\x06\x04\x26"), "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
    (Packet(2, 0x55, b"\x00\x06\x04\x26"), "FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D"),
    (read(1, 132, 4), "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
    (Packet(1, 0x55, b"\x00\xa6\x00\x00\x00"), "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"),
    (
        Packet(1, 0x03, b"\x74\x00\x00\x02\x00\x00"),
        "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
    ),
    (Packet(1, 0x55, b"\x00"), "FF FF FD 00 01 04 00 55 00 A1 0C"),
    (Packet(1, Instruction.REBOOT), "FF FF FD 00 01 03 00 08 2F 4E"),
    (sync_read(132, 4, (1, 2)), "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"),
    (
        sync_write(116, {1: 150, 2: 170}, 4),
        "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
    ),
]

WILD = st.binary(max_size=60) | st.lists(  # full of headers and of what is stuffed
    st.sampled_from([b"\xff", b"\xfd", b"\x00", HEADER, b"\xff\xff\xfd\xfd", b"\x55"]), max_size=20
).map(b"".join)
PACKETS = st.builds(Packet, st.sampled_from([*range(253), BROADCAST]), st.integers(0, 255), WILD)


@pytest.mark.parametrize(("packet", "line"), EXAMPLES)
def test_the_examples_of_the_manual(packet: Packet, line: str) -> None:
    assert encode(packet) == bytes.fromhex(line)
    assert Decoder().feed(bytes.fromhex(line)) == [packet]


def test_a_header_never_stands_inside_a_packet() -> None:
    line = encode(Packet(1, Instruction.WRITE, b"\xff\xff\xfd\x00"))
    assert line[7:13] == b"\x03\xff\xff\xfd\xfd\x00"
    assert line[5:7] == (8).to_bytes(2, "little")  # the stuffed byte counts


@given(packets=st.lists(PACKETS, max_size=4), cut=st.integers(1, 40))
def test_packets_come_through_however_the_bytes_arrive(packets: list[Packet], cut: int) -> None:
    line = b"".join(map(encode, packets))
    decoder = Decoder()
    found = []
    for start in range(0, len(line), cut):
        found += decoder.feed(line[start : start + cut])
    assert (found, decoder.damaged) == (packets, 0)


@given(noise=st.binary(max_size=200) | WILD, packet=PACKETS)
def test_a_packet_is_found_behind_noise_once_that_cannot_be_one(
    noise: bytes, packet: Packet
) -> None:
    found = Decoder().feed(noise + encode(packet) + HEADER)
    assert packet in found
    assert len(found) == 1 or len(noise) > len(encode(Packet(0, 0)))


@given(
    packet=PACKETS,
    after=PACKETS,
    at=st.integers(0, 10**6),
    change=st.none() | st.integers(1, 255),
)
def test_a_damaged_packet_is_none_and_costs_only_itself(
    packet: Packet, after: Packet, at: int, change: int | None
) -> None:
    line = encode(packet)
    at %= len(line)
    spoilt = bytes(() if change is None else (line[at] ^ change,))
    damaged = line[:at] + spoilt + line[at + 1 :]
    assert Decoder().feed(damaged + encode(after) + HEADER) == [after]


def test_a_length_that_cannot_be_is_not_waited_for() -> None:
    decoder = Decoder()
    assert decoder.feed(HEADER + b"\x01" + (LONGEST + 1).to_bytes(2, "little")) == []
    assert decoder.damaged == 1
    assert decoder.feed(HEADER + b"\x01\x02\x00") == []
    assert decoder.damaged == 2


def test_what_was_begun_can_be_forgotten() -> None:
    decoder = Decoder()
    ping = encode(Packet(1, Instruction.PING))
    decoder.feed(ping[:7])
    decoder.begin()
    assert decoder.feed(ping[7:]) == []
    assert decoder.feed(ping) == [Packet(1, Instruction.PING)]


@pytest.mark.parametrize("value", [-(2**31), -1, 0, 2**31 - 1])
def test_numbers_are_little_endian_and_signed(value: int) -> None:
    packet = sync_write(116, {1: value}, 4)
    assert packet.parameters[5:] == value.to_bytes(4, "little", signed=True)
