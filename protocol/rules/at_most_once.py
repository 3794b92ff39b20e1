"""The memory of requests, by which each is carried out at most once.

The last outcomes of each client are kept by request id. A request that was seen before is answered
from memory; one that comes after a larger id, or whose outcome is forgotten, is refused.
The memory is bounded twice: outcomes for each client, and clients. A client that is pushed out
loses its session with its outcomes, so that requests of that session are answered ``restarted``.
"""

from __future__ import annotations

import hashlib
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from protocol.errors import RobotError
from protocol.text import printable
from protocol.wire.codec import encode
from protocol.wire.messages import Request

MAX_OUTCOMES: Final = 64
"""Outcomes remembered for each client; also the most requests it may have in flight."""

MAX_CLIENTS: Final = 64


@dataclass(slots=True)
class RememberedRequest:
    """A request and its outcome so far.

    Attributes:
        request: The request, until its end.
        fingerprint: Hash that tells whether another request with the same id is the same request.
        peer: Peer to answer: whoever asked last; ``None``: nobody may hear the answers any more.
        progress: The latest frame sent before the end.
        reply: Frame of the final reply; ``None`` while in flight.
    """

    request: Request | None
    fingerprint: bytes
    peer: bytes | None
    progress: bytes | None = None
    reply: bytes | None = None

    @classmethod
    def of(cls, request: Request, peer: bytes) -> RememberedRequest:
        """The outcome of a request that just arrived: none yet."""
        return cls(request, _fingerprint(request), peer)

    def end(self, reply: bytes) -> None:
        """Notes the final reply; the request itself is no longer needed."""
        self.reply = reply
        self.progress = None
        self.request = None


@dataclass(slots=True)
class Client:
    """What is remembered about one client.

    Attributes:
        name: Id that the client chose.
        session: Session that it was given.
        user: User that it belongs to, where the transport knows.
        software: Software that it says it is.
        highest: The largest request id seen.
        forgotten: The largest request id whose outcome is no longer remembered.
        outcomes: Requests and their outcomes by request id, oldest first.
    """

    name: str
    session: str
    user: str | None
    software: str | None
    highest: int = -1
    forgotten: int = -1
    outcomes: OrderedDict[int, RememberedRequest] = field(default_factory=OrderedDict)

    @property
    def in_flight(self) -> bool:
        """Whether some request has not ended."""
        return any(outcome.reply is None for outcome in self.outcomes.values())

    def recall(self, request: Request) -> RememberedRequest | None:
        """The outcome of the same request, if it was seen before.

        Raises:
            RobotError: ``id_reused`` for another request with this id, ``expired`` for an id that
                may be of a forgotten one, ``out_of_order`` for another smaller than the largest.
        """
        remembered = self.outcomes.get(request.id)
        if remembered is not None:
            if remembered.fingerprint != _fingerprint(request):
                raise RobotError("id_reused", f"Id {request.id} was used for another request.")
            return remembered
        if request.id <= self.forgotten:
            raise RobotError(
                "expired",
                f"Id {request.id} is no longer remembered: whether it was carried out is unknown.",
            )
        if request.id < self.highest:
            raise RobotError(
                "out_of_order",
                f"Id {request.id} comes after {self.highest}: it was never carried out.",
            )
        return None

    def begin(self, request: Request, peer: bytes) -> RememberedRequest:
        """Opens the outcome of a new request, forgetting the oldest that has ended.

        Raises:
            RobotError: ``busy`` when every place is taken by a request in flight.
        """
        if len(self.outcomes) >= MAX_OUTCOMES:
            ended_ids = (key for key, outcome in self.outcomes.items() if outcome.reply is not None)
            oldest_id = next(ended_ids, None)
            if oldest_id is None:
                raise RobotError("busy", f"{MAX_OUTCOMES} requests of this client are in flight.")
            del self.outcomes[oldest_id]
            self.forgotten = max(self.forgotten, oldest_id)
        outcome = RememberedRequest.of(request, peer)
        self.outcomes[request.id] = outcome
        self.highest = request.id
        return outcome


class Clients:
    """The clients that are remembered, the least recently heard of first."""

    def __init__(self, token: Callable[[], str]):
        self._token = token
        self._clients: OrderedDict[str, Client] = OrderedDict()

    def __len__(self) -> int:
        return len(self._clients)

    def __iter__(self) -> Iterator[Client]:
        return iter(tuple(self._clients.values()))

    def welcome(
        self, name: str, *, user: str | None, software: str | None, keep: str | None
    ) -> Client:
        """Returns the client of this name; a new one may push out an idle one.

        Pushed out is, of the users with most clients, the idle client not heard of for longest.

        Args:
            name: The client's id.
            user: User that it belongs to, where the transport knows.
            software: Software that it says it is.
            keep: A client never to be pushed out: the controller.

        Raises:
            RobotError: ``unauthorised`` if another user opened this client's session,
                ``too_many_clients`` if none can be pushed out.
        """
        known_client = self._clients.get(name)
        if known_client is not None:
            self._same_user(known_client, user)
            known_client.software = software
            self._clients.move_to_end(name)
            return known_client
        if len(self._clients) >= MAX_CLIENTS:
            idle = [
                other
                for other in self._clients.values()
                if other.name != keep and not other.in_flight
            ]
            if not idle:
                raise RobotError("too_many_clients", f"All {MAX_CLIENTS} clients are active.")
            places = Counter(other.user for other in self._clients.values())
            most = max(places[other.user] for other in idle)  # nobody can crowd the others out
            evicted = next(other for other in idle if places[other.user] == most)
            del self._clients[evicted.name]
        client = Client(name, self._token(), user, software)
        self._clients[name] = client
        return client

    def find(self, name: str, *, session: str, user: str | None) -> Client:
        """Returns the client in this session.

        Raises:
            RobotError: ``restarted`` if the session is unknown, ``unauthorised`` if it is
                another user's.
        """
        client = self._clients.get(name)
        if client is None or client.session != session:
            raise RobotError(
                "restarted",
                "This session is unknown: the daemon restarted, or forgot this client.",
            )
        self._same_user(client, user)
        self._clients.move_to_end(name)
        return client

    def forget(self, client: Client) -> None:
        """Ends a client's session; nobody hears what becomes of its requests under way."""
        for outcome in client.outcomes.values():
            outcome.peer = None
        del self._clients[client.name]

    def under_way(self, user: str | None) -> int:
        """Returns how many requests of all clients of a user are under way."""
        return sum(
            outcome.reply is None
            for client in self._clients.values()
            if client.user == user
            for outcome in client.outcomes.values()
        )

    def name_of(self, name: str) -> str:
        """Returns how to name a client to another: its software, if it told, and its id."""
        client = self._clients.get(name)
        software = client.software if client is not None else None
        return printable(f"{software} (client {name})" if software else f"client {name}")

    @staticmethod
    def _same_user(client: Client, user: str | None) -> None:
        if client.user != user:
            raise RobotError("unauthorised", f"Client {client.name} belongs to another user.")


def _fingerprint(request: Request) -> bytes:
    values = request.to_map()
    for key, value in values.items():
        if isinstance(value, Mapping):
            values[key] = _sorted(value)
    return hashlib.blake2b(encode(values), digest_size=16).digest()


def _sorted(values: Mapping[str, Any]) -> dict[str, Any]:
    # -0.0 equals 0.0, and only its bytes differ: the sum of both is 0.0.
    return {
        key: value + 0.0 if isinstance(value, float) else value
        for key, value in sorted(values.items())
    }
