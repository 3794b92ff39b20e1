"""Counting the frames of a ZMTP 3 stream without looking into them."""

from __future__ import annotations

from typing import Final

_GREETING: Final = 64  # bytes
_SIGNATURE: Final = 10  # bytes, then comes the major version
_VERSION: Final = 3
_WIDE: Final = 2  # flag: the size takes 8 bytes instead of 1


class FrameCounter:
    """Counts frames as their bytes come: messages and commands, encrypted ones, too.

    The framing is that of ZMTP 3, RFC 23: a greeting; then frames of flags, size and body. CURVE
    encrypts bodies only.
    """

    def __init__(self) -> None:
        self._greeted = False
        self._rest = b""  # what is too short yet
        self._skip = 0  # bytes of a body that are still to come

    def count(self, data: bytes) -> int:
        """How many frames begin in the next bytes of the stream.

        Raises:
            ValueError: The peer does not speak ZMTP 3.
        """
        data = self._rest + data
        at = self._skip
        if not self._greeted:
            _check_greeting(data)
            if len(data) < _GREETING:
                self._rest = data
                return 0
            self._greeted = True
            at = _GREETING
        frames = 0
        end = len(data)
        while at < end:
            body = at + (9 if data[at] & _WIDE else 2)
            if body > end:
                break
            at = body + int.from_bytes(data[at + 1 : body], "big")
            frames += 1
        self._rest = data[at:]
        self._skip = max(0, at - end)
        return frames


def _check_greeting(begun: bytes) -> None:
    if begun and begun[0] != 0xFF:
        raise ValueError("no ZMTP signature")
    if len(begun) >= _SIGNATURE and begun[_SIGNATURE - 1] != 0x7F:
        raise ValueError("no ZMTP signature")
    if len(begun) > _SIGNATURE and begun[_SIGNATURE] < _VERSION:
        raise ValueError(f"ZMTP {begun[_SIGNATURE]} instead of 3")
