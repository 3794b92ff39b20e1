"""Bad networks do what they say."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator

import pytest
import zmq

from bench.network_proxy import MessageProxy, TcpProxy, Weather


@pytest.fixture
def echo() -> Iterator[str]:
    """A ROUTER that answers everything."""
    with zmq.Context() as context:
        router = context.socket(zmq.ROUTER)
        router.bind("tcp://127.0.0.1:*")
        uri = router.getsockopt_string(zmq.LAST_ENDPOINT)
        stop = context.socket(zmq.PAIR)
        stop.bind("inproc://stop")

        def run() -> None:
            poller = zmq.Poller()
            poller.register(router, zmq.POLLIN)
            poller.register(stop, zmq.POLLIN)
            while stop not in (ready := dict(poller.poll())):
                if router in ready:
                    router.send_multipart(router.recv_multipart())

        thread = threading.Thread(target=run)
        thread.start()
        yield uri
        with context.socket(zmq.PAIR) as end:
            end.connect("inproc://stop")
            end.send(b"")
            thread.join()
        router.close(0)
        stop.close(0)


SILENCE = 1.0  # s; a busy machine may stand still for some tenths


def exchange(uri: str, count: int) -> list[int]:
    """Sends numbers and returns what came back until there is silence."""
    found = []
    with zmq.Context() as context, context.socket(zmq.DEALER) as wire:
        wire.setsockopt(zmq.LINGER, 0)
        wire.connect(uri)
        for number in range(count):
            wire.send(str(number).encode())
        while wire.poll(round(SILENCE * 1000)):
            found.append(int(wire.recv()))
    return found


def test_good_weather_changes_nothing(echo: str) -> None:
    with MessageProxy(echo) as proxy:
        assert exchange(proxy.endpoint, 50) == list(range(50))


def test_every_kind_of_weather_is_felt(echo: str) -> None:
    with MessageProxy(echo, Weather(loss=0.3), seed=1) as proxy:
        found = exchange(proxy.endpoint, 100)
        assert sorted(found) == found
        assert len(found) == 100 - proxy.fates.lost
        assert 20 < proxy.fates.lost < 80
        proxy.weather = Weather(duplication=0.5)
        found = exchange(proxy.endpoint, 100)
        assert set(found) == set(range(100))
        assert len(found) > 150
        proxy.weather = Weather(delay=0.1, jitter=0.1)
        start = time.monotonic()
        found = exchange(proxy.endpoint, 20)
        assert time.monotonic() - start > 0.2 + SILENCE  # both ways, and the silence
        assert sorted(found) == list(range(20))
        assert found != sorted(found)
        assert proxy.fates.overtaken


def test_a_cable_is_pulled_and_a_router_cut(echo: str) -> None:
    with TcpProxy(echo) as proxy, zmq.Context() as context, context.socket(zmq.DEALER) as wire:
        wire.setsockopt(zmq.LINGER, 0)
        wire.connect(proxy.endpoint)
        wire.send(b"1")
        assert wire.recv() == b"1"
        proxy.pull()
        wire.send(b"2")
        assert not wire.poll(200)
        proxy.mend()
        assert wire.recv() == b"2"
        proxy.cut()
        with pytest.raises(OSError, match="refused"):
            socket.create_connection(("127.0.0.1", int(proxy.endpoint.rpartition(":")[2])))
        proxy.mend()
        wire.send(b"3")
        assert wire.poll(10_000)
        assert wire.recv() == b"3"
