"""``robotd keys``: makes keys, and says whom this computer knows.

It serves both sides: on a robot the list holds its clients, on a workstation the robot.
"""

from __future__ import annotations

import argparse
import re
import socket
from pathlib import Path

from protocol.rules.control import Role
from protocol.security.keys import ROLES, KeyDirectory, KnownPeer, read_public

HELP = "make keys, and say whom this computer knows"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the actions and their options."""
    actions = parser.add_subparsers(dest="action", required=True)
    new = _action(actions, "new", "make this computer's pair of keys, on a robot or a workstation")
    new.add_argument(
        "--name", default=_host_name(), help="how others will call it (default %(default)s)"
    )
    add = _action(actions, "add", "let a client in; or, on a workstation, trust a robot")
    add.add_argument("key", metavar="FILE", help="the .public file it was given away in")
    add.add_argument(
        "--role",
        required=True,
        choices=ROLES,
        help="viewer: may look and stop; controller: may do everything; robot: is to be controlled",
    )
    add.add_argument("--name", help="how to call it here (default: as it calls itself)")
    _action(actions, "list", "show whom this computer knows")
    remove = _action(actions, "remove", "shut somebody out; a running robot does so at once")
    remove.add_argument("name", metavar="NAME", help="the name that keys list shows")


def run(options: argparse.Namespace) -> int:
    """Carries out one action."""
    keys = KeyDirectory(options.keys, tended=True)
    {"new": _new, "add": _add, "list": _list, "remove": _remove}[options.action](keys, options)
    return 0


def _action(
    actions: argparse._SubParsersAction[argparse.ArgumentParser], name: str, text: str
) -> argparse.ArgumentParser:
    parser = actions.add_parser(name, help=text, description=text)
    parser.add_argument("--keys", type=Path, required=True, metavar="DIR", help="the key directory")
    return parser


def _new(keys: KeyDirectory, options: argparse.Namespace) -> None:
    public = keys.create(options.name)
    print(f"Made the keys of {options.name} in {keys.path}.")
    print(f"Give {public} to whoever is to know {options.name}; it holds no secret.")


def _add(keys: KeyDirectory, options: argparse.Namespace) -> None:
    name, public = read_public(Path(options.key))
    peer = KnownPeer(name=options.name or name, public=public, role=options.role)
    keys.add(peer)
    print(f"{peer.name} is known as {peer.role} now.")


def _list(keys: KeyDirectory, options: argparse.Namespace) -> None:
    del options
    print(f"this computer  {keys.pair().public}")
    peers = keys.known()
    width = max((len(peer.name) for peer in peers), default=0)
    for peer in peers:
        print(f"{peer.role:<{len(Role.CONTROLLER)}}  {peer.name:<{width}}  {peer.public}")


def _remove(keys: KeyDirectory, options: argparse.Namespace) -> None:
    keys.remove(options.name)
    print(f"{options.name} is not known any more.")


def _host_name() -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "-", socket.gethostname())[:64].strip("-") or "computer"
