"""Key directories: a computer's own keys, and those of the computers that it knows.

A key directory looks the same on a robot and on a workstation::

    secret.toml    this computer's own pair of keys; only its owner may read it (0600)
    NAME.public    the public half, to be given away
    known.toml     whom this computer knows, by name: clients of this robot with their roles
                   (viewer, controller), and the robot that this computer controls (robot)

Keys are CURVE25519 keys in Z85, 40 characters, as ZeroMQ takes them. ``robotd keys`` makes and
changes all three files.
"""

from __future__ import annotations

import fcntl
import os
import re
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import zmq
from zmq.utils import z85

from protocol.errors import KeysError
from protocol.rules.control import Role
from protocol.security.key_files import check_private, read_toml
from protocol.system.files import may_exist, replace_file
from protocol.text import command_line

ROBOT: Final = "robot"
"""The role in ``known.toml`` of the robot that a computer controls."""

ROLES: Final = (*(role.value for role in Role), ROBOT)

_SECRET: Final = "secret.toml"
_KNOWN: Final = "known.toml"
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")
_PRIME: Final = 2**255 - 19
_SHARED_BY_ALL: Final = (  # the points of small order, as RFC 7748 and the curve's author list them
    0,
    1,
    _PRIME - 1,
    325606250916557431795983626356110631294008115727848805560023387167927233504,
    39382357235489614581723060781553021112529911719440698176882885853963445705823,
)

_SECRET_HEAD: Final = "# Who this computer is. Never give this file away: whoever has it, is it.\n"
_PUBLIC_HEAD: Final = "# A public key, no secret; whoever is to know it says: robotd keys add.\n"
_KNOWN_HEAD: Final = (
    "# Whom this computer knows. `robotd keys add` and `robotd keys remove` change this file; a\n"
    "# running robot takes changes up at once.\n"
)


class KeyPair(NamedTuple):
    """A public and a secret key, in Z85."""

    public: str
    secret: str


@dataclass(frozen=True, kw_only=True)
class ClientKeys:
    """What a client needs: its own keys, and the public key of its robot."""

    own: KeyPair
    robot: str


@dataclass(frozen=True, kw_only=True)
class KnownPeer:
    """Somebody who is known; ``role`` is one of ``ROLES``."""

    name: str
    public: str
    role: str


class KeyDirectory:
    """A key directory; nothing is read before it is asked for.

    All methods raise ``KeysError`` where a file is missing, wrong, another user's, or open to
    others; the constructor, where ``~`` or ``~user`` has no home directory.

    Args:
        path: The directory.
        tended: Whether root may look after the directory of another user, for ``robotd keys``;
            otherwise it has to belong to whoever uses it, or to root.
    """

    def __init__(self, path: str | os.PathLike[str], *, tended: bool = False):
        try:
            self.path = Path(path).expanduser()
        except RuntimeError:
            raise KeysError(
                f"{os.fspath(path)!r} begins with a home directory that is not known: write the "
                "whole path."
            ) from None
        self._tended = tended

    def create(self, name: str) -> Path:
        """Makes this computer's pair of keys.

        Args:
            name: Name under which others will know this computer.

        Returns:
            The file with the public key, to be given away.
        """
        check_name(name)
        try:
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise KeysError(f"{self.path} cannot be made: {error.strerror}.") from None
        with self._locked():
            if self._file(_SECRET).exists():
                raise KeysError(
                    f"{self._file(_SECRET)} exists: with a new key, nobody would know this "
                    "computer any more. Delete it first, if that is meant."
                )
            pair = KeyPair(*(key.decode() for key in zmq.curve_keypair()))
            shared = self._file(f"{name}.public")
            self._write(_SECRET, _SECRET_HEAD + _lines(public=pair.public, secret=pair.secret))
            self._write(shared.name, _PUBLIC_HEAD + _lines(name=name, public=pair.public), 0o644)
        return shared

    def pair(self) -> KeyPair:
        """This computer's own keys."""
        place = self._file(_SECRET)
        command = command_line("robotd", "keys", "new", "--keys", self.path)
        entries = self._read(place, closed=0o077, advice=f"make it with: {command}")
        pair = KeyPair(*(_key_of(entries, name, place) for name in KeyPair._fields))
        if zmq.curve_public(pair.secret.encode()) != pair.public.encode():
            raise KeysError(f"{place}: the two keys do not belong together.")
        return pair

    def known(self, *, must_exist: bool = False) -> tuple[KnownPeer, ...]:
        """The peers that this computer knows; none where there is no list, unless it must exist."""
        place = self._file(_KNOWN)
        if not must_exist and not may_exist(place):
            return ()
        entries = self._read(place, closed=0o022)
        peers = tuple(_known_of(name, entry, place) for name, entry in entries.items())
        if len({peer.public for peer in peers}) != len(peers):
            raise KeysError(f"{place}: two names have the same key; remove one of them.")
        return peers

    def client_keys(self) -> ClientKeys:
        """The keys for a client of the one robot that is known here."""
        robots = [peer for peer in self.known() if peer.role == ROBOT]
        if not robots:
            command = ("robotd", "keys", "add", "FILE", "--role", ROBOT, "--keys", self.path)
            raise KeysError(
                f"{self.path} knows no robot: get the robot's .public file from its owner, then "
                f"say {command_line(*command)}"
            )
        if len(robots) > 1:
            names = ", ".join(peer.name for peer in robots)
            raise KeysError(
                f"{self.path} knows more than one robot ({names}): keep a directory for each."
            )
        return ClientKeys(own=self.pair(), robot=robots[0].public)

    def add(self, peer: KnownPeer) -> None:
        """Adds a peer to ``known.toml``."""
        check_name(peer.name)
        check_key(peer.public, "the key")
        if peer.role not in ROLES:
            raise KeysError(f"There is no role {peer.role!r}: choose {', '.join(ROLES)}.")
        own_public = ""
        with self._locked():
            with suppress(KeysError):  # other calls complain of a pair that is missing or spoilt
                own_public = self.pair().public
            if peer.public == own_public:
                raise KeysError(
                    "This key is this computer's own: add the .public file of the other one."
                )
            peers = self.known()
            for known_peer in peers:
                if known_peer.name == peer.name:
                    raise KeysError(f"{peer.name} is known here already: remove it first.")
                if known_peer.public == peer.public:
                    raise KeysError(f"This key is known here already, as {known_peer.name}.")
            self._write_known((*peers, peer))

    def remove(self, name: str) -> None:
        """Removes a peer from ``known.toml``; a running robot disconnects it at once."""
        with self._locked():
            peers = self.known()
            remaining = tuple(peer for peer in peers if peer.name != name)
            if len(remaining) == len(peers):
                names = ", ".join(peer.name for peer in peers) or "nobody"
                raise KeysError(f"{name!r} is not known in {self.path}; known: {names}.")
            self._write_known(remaining)

    def stamp(self) -> tuple[int, ...]:
        """Numbers that change whenever ``known.toml`` does; cheap, raises nothing."""
        try:
            file, directory = os.stat(self._file(_KNOWN)), os.stat(self.path)
        except OSError:
            return ()
        changes = file.st_ino, file.st_mtime_ns, file.st_ctime_ns, file.st_size
        return *changes, directory.st_mode, directory.st_uid

    # --- files ------------------------------------------------------------------------------------

    def _file(self, name: str) -> Path:
        return self.path / name

    def _read(self, place: Path, *, closed: int, advice: str = "") -> dict[str, Any]:
        """Reads a file of this directory, if nobody else can have changed file or directory."""
        try:
            directory = os.stat(self.path)
        except OSError:
            return read_toml(place, advice=advice)  # which says what is missing
        owners = self._check_directory(directory)
        return read_toml(place, owners=owners, closed=closed, advice=advice)

    def _check_directory(self, state: os.stat_result) -> frozenset[int]:
        """The ids of users whose files are trusted here."""
        owners = frozenset({os.geteuid(), 0})
        if self._tended and os.geteuid() == 0:
            owners |= {state.st_uid}
        check_private(self.path, state, owners=owners, closed=0o022)
        return owners

    def _write_known(self, peers: tuple[KnownPeer, ...]) -> None:
        entries = (
            f"\n[{peer.name}]\n" + _lines(public=peer.public, role=peer.role) for peer in peers
        )
        self._write(_KNOWN, _KNOWN_HEAD + "".join(entries))

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Lets one change of the directory happen at a time."""
        try:
            handle = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise KeysError(f"{self.path} cannot be opened: {error.strerror}.") from None
        try:
            self._check_directory(os.fstat(handle))
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)

    def _write(self, name: str, text: str, mode: int = 0o600) -> None:
        """Replaces a file in one step; root gives it to the owner of the directory."""
        place = self._file(name)
        try:
            directory = os.stat(self.path)
            # root writes for the daemon's user, who has to read it
            owner = (directory.st_uid, directory.st_gid) if os.geteuid() == 0 else None
            replace_file(
                place, lambda fresh: fresh.write_text(text, "utf-8"), mode=mode, owner=owner
            )
        except OSError as error:
            raise KeysError(f"{place} cannot be written: {error.strerror}.") from None


def read_public(place: Path) -> tuple[str, str]:
    """Name and key in a ``.public`` file.

    Raises:
        KeysError: It is no ``.public`` file.
    """
    entries = read_toml(place)
    name = entries.get("name")
    if not isinstance(name, str):
        raise KeysError(f"{place}: 'name' is missing; is it the .public file of `robotd keys new`?")
    check_name(name)
    return name, _key_of(entries, "public", place)


def check_name(name: str) -> None:
    """Raises ``KeysError`` for what cannot be a name."""
    if not _NAME.fullmatch(name):
        raise KeysError(
            f"{name!r:.80} cannot be a name: take 1 to 64 letters, digits, hyphens and "
            "underscores, no hyphen first."
        )


def check_key(key: str, what: str) -> None:
    """Raises ``KeysError`` for what is no public or secret key; ``what`` names it in the sentence.

    Points of small order, 0 among them, are refused as well: with those, every secret gives the
    same shared key, so that they shut nobody out.
    """
    point = b""
    with suppress(ValueError, KeyError, struct.error):  # all that the decoder's arithmetic raises
        point = z85.decode(key.encode("ascii")) if len(key) == 40 else b""
    if not point:
        raise KeysError(f"{what} is no key: a key has 40 characters of the alphabet Z85.")
    if int.from_bytes(point, "little") % 2**255 % _PRIME in _SHARED_BY_ALL:
        raise KeysError(f"{what} is no key: it is the same for everybody who has any.")


def _lines(**entries: str) -> str:
    # Neither Z85 nor a name holds a quotation mark or a backslash.
    return "".join(f'{key} = "{value}"\n' for key, value in entries.items())


def _key_of(entries: Mapping[str, Any], name: str, place: Path) -> str:
    key = entries.get(name)
    if not isinstance(key, str):
        raise KeysError(f"{place}: '{name}' is missing.")
    check_key(key, f"{place}: '{name}'")
    return key


def _known_of(name: str, entry: Any, place: Path) -> KnownPeer:
    check_name(name)
    if not isinstance(entry, dict):
        raise KeysError(f"{place}: [{name}] must be a table with public and role.")
    role = entry.get("role")
    if role not in ROLES:
        raise KeysError(f"{place}: [{name}] has the role {role!r:.60}; write {', '.join(ROLES)}.")
    return KnownPeer(name=name, public=_key_of(entry, "public", place), role=role)
