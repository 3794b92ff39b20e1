from __future__ import annotations

import pytest

from protocol.errors import EndpointError
from protocol.sockets.zmq_sockets import Endpoint


@pytest.mark.parametrize(
    ("uri", "host", "port", "text"),
    [
        ("tcp://127.0.0.1:5750", "127.0.0.1", 5750, "tcp://127.0.0.1:5750"),
        ("tcp://robot.local", "robot.local", 5750, "tcp://robot.local:5750"),
        ("tcp://127.0.0.1:0", "127.0.0.1", 0, "tcp://127.0.0.1:*"),
        ("tcp://127.0.0.1:*", "127.0.0.1", 0, "tcp://127.0.0.1:*"),
        ("tcp://[::1]:9", "::1", 9, "tcp://[::1]:9"),
        ("tcp://*:5750", "*", 5750, "tcp://*:5750"),
    ],
)
def test_addresses(uri: str, host: str, port: int, text: str) -> None:
    place = Endpoint.parse(uri)
    assert (place.host, place.port, str(place)) == (host, port, text)


@pytest.mark.parametrize(
    "uri",
    ["", "5750", "localhost:5750", "udp://a:1", "tcp://", "tcp://a:b", "tcp://a:65536",
     "tcp://a:-1", "tcp://a:1/x", "tcp://a b:1", "tcp://a:٣", "tcp://robot..local:1",
     f"tcp://{64 * 'r'}:1"],
)  # fmt: skip
def test_what_is_no_address_is_refused_in_a_sentence(uri: str) -> None:
    with pytest.raises(EndpointError, match=r"write .*\.$"):
        Endpoint.parse(uri)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.10", "localhost", "[::1]"])
def test_this_computer(host: str) -> None:
    assert Endpoint.parse(f"tcp://{host}:1").is_loopback


@pytest.mark.parametrize("host", ["*", "0.0.0.0", "[::]", "192.168.1.5", "robot.local", "eth0"])
def test_other_computers(host: str) -> None:
    assert not Endpoint.parse(f"tcp://{host}:1").is_loopback


def test_publications_are_made_at_the_next_port() -> None:
    assert Endpoint("a", 5750).next_port() == Endpoint("a", 5751)
    assert Endpoint("a", 0).next_port() == Endpoint("a", 0)
    with pytest.raises(EndpointError, match="65535"):
        Endpoint("a", 65535).next_port()


@pytest.mark.parametrize("wildcard", ["*", "0.0.0.0", "[::]"])
def test_a_wildcard_means_the_host_that_was_reached(wildcard: str) -> None:
    published = Endpoint.parse(f"tcp://{wildcard}:5751")
    assert str(published.seen_from("tcp://robot:5750")) == "tcp://robot:5751"
    assert str(Endpoint("other", 5751).seen_from("tcp://robot:5750")) == "tcp://other:5751"
