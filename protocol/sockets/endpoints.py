"""Addresses: ``tcp://host:port``, and which of them need keys."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from typing import Final

from protocol.errors import EndpointError

DEFAULT_PORT: Final = 5750
DEFAULT_BIND: Final = f"tcp://127.0.0.1:{DEFAULT_PORT}"

_PATTERN: Final = re.compile(
    r"tcp://(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[^\[\]/:\s]+)(:(?P<port>[^/\s]+))?"
)
_WILDCARDS: Final = ("*", "0.0.0.0", "::")


@dataclass(frozen=True)
class Endpoint:
    """A host and a port; port 0 means any free one."""

    host: str
    port: int

    @classmethod
    def parse(cls, uri: str) -> Endpoint:
        """Reads ``tcp://host[:port]``; without a port it is 5750, and ``*`` means any free one.

        Raises:
            EndpointError: It is no such address.
        """
        match = _PATTERN.fullmatch(uri)
        if match is None:
            raise EndpointError(
                f"{uri!r} is no address: write tcp://HOST:PORT, like {DEFAULT_BIND}."
            )
        port = match["port"] or str(DEFAULT_PORT)
        if port == "*":
            port = "0"
        if not (port.isascii() and port.isdigit() and int(port) <= 65_535):
            raise EndpointError(f"{uri!r} has the port {port!r}: write a number up to 65535.")
        return cls(match["host"].strip("[]"), int(port))

    @property
    def is_wildcard(self) -> bool:
        """Whether it stands for every address of the computer."""
        return self.host in _WILDCARDS

    @property
    def is_ipv6(self) -> bool:
        """Whether the host is a numerical IPv6 address."""
        return ":" in self.host

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def next_port(self) -> Endpoint:
        """The default place of the publications: port + 1, or any free one for any free one.

        Raises:
            EndpointError: There is no port above this one.
        """
        if self.port == 65_535:
            raise EndpointError("Port 65535 leaves none for telemetry: name its address as well.")
        return Endpoint(self.host, self.port + 1 if self.port else 0)

    def seen_from(self, uri: str) -> Endpoint:
        """This endpoint for a client that reached the robot at ``uri``: no wildcard host."""
        return Endpoint(Endpoint.parse(uri).host, self.port) if self.is_wildcard else self

    def __str__(self) -> str:
        host = f"[{self.host}]" if self.is_ipv6 else self.host
        return f"tcp://{host}:{self.port or '*'}"
