"""Key directories: what is in their files, who may read them, and what is wrong with them."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import pytest
import zmq
from zmq.utils import z85

from protocol.errors import KeysError
from protocol.security.keys import (
    ROBOT,
    ClientKeys,
    KeyDirectory,
    KnownPeer,
    check_key,
    read_public,
)
from robot.cli import keys as command


def fresh_key() -> str:
    return zmq.curve_keypair()[0].decode()


def person(name: str, role: str = "viewer") -> KnownPeer:
    return KnownPeer(name=name, public=fresh_key(), role=role)


@pytest.fixture
def keys(tmp_path: Path) -> KeyDirectory:
    directory = KeyDirectory(tmp_path / "keys")
    directory.create("me")
    return directory


def mode(place: Path) -> int:
    return stat.S_IMODE(place.stat().st_mode)


def test_what_new_makes(keys: KeyDirectory) -> None:
    pair = keys.pair()
    assert zmq.curve_public(pair.secret.encode()).decode() == pair.public
    assert read_public(keys.path / "me.public") == ("me", pair.public)
    assert pair.secret not in (keys.path / "me.public").read_text()
    assert mode(keys.path) == 0o700
    assert mode(keys.path / "secret.toml") == 0o600
    assert keys.known() == ()
    keys.add(person("ann"))
    assert mode(keys.path / "known.toml") == 0o600


def test_new_never_replaces_a_key(keys: KeyDirectory) -> None:
    before = keys.pair()
    with pytest.raises(KeysError, match=r"secret\.toml exists: .* Delete it first"):
        keys.create("me")
    assert keys.pair() == before


def test_each_pair_is_another(tmp_path: Path) -> None:
    public_files = {KeyDirectory(tmp_path / str(number)).create("x") for number in range(3)}
    assert len({read_public(place)[1] for place in public_files}) == 3


def test_adding_listing_removing(keys: KeyDirectory) -> None:
    people = (person("ann", "controller"), person("bob"), person("crawler-2", ROBOT))
    for each in people:
        keys.add(each)
    assert keys.known() == people
    keys.remove("bob")
    assert keys.known() == (people[0], people[2])
    with pytest.raises(KeysError, match=r"'bob' is not known in .*; known: ann, crawler-2\."):
        keys.remove("bob")
    assert keys.client_keys() == ClientKeys(own=keys.pair(), robot=people[2].public)


def test_who_is_known_already_is_not_added_twice(keys: KeyDirectory) -> None:
    ann = person("ann")
    keys.add(ann)
    with pytest.raises(KeysError, match="ann is known here already: remove it first"):
        keys.add(person("ann", "controller"))
    with pytest.raises(KeysError, match="This key is known here already, as ann"):
        keys.add(KnownPeer(name="eve", public=ann.public, role="controller"))
    assert keys.known() == (ann,)


def test_a_client_has_exactly_one_robot(keys: KeyDirectory) -> None:
    with pytest.raises(KeysError, match=r"knows no robot: .* --role robot"):
        keys.client_keys()
    keys.add(person("one", ROBOT))
    keys.add(person("two", ROBOT))
    with pytest.raises(KeysError, match=r"more than one robot \(one, two\)"):
        keys.client_keys()


def test_what_it_advises_can_be_typed_whatever_the_directory_is_called(tmp_path: Path) -> None:
    place = tmp_path / "my keys"
    keys = KeyDirectory(place)
    with pytest.raises(KeysError) as no_pair:
        keys.pair()
    with pytest.raises(KeysError) as no_robot:
        keys.client_keys()
    for caught in (no_pair, no_robot):
        command = shlex.split(re.split(r"with: |say ", str(caught.value))[1].rstrip("."))
        assert command[:2] == ["robotd", "keys"]
        assert command[-2:] == ["--keys", str(place)]


@pytest.mark.parametrize("name", ["", "a b", "../x", "ä", "x" * 65, 'a"b', "a\n", "-x", "-"])
def test_what_cannot_be_a_name(keys: KeyDirectory, name: str) -> None:
    for action in (lambda: keys.add(person(name)), lambda: keys.create(name)):
        with pytest.raises(KeysError, match="cannot be a name"):
            action()


@pytest.mark.parametrize("key", ["", "x" * 39, "x" * 41, '"' * 40, "é" * 40, "~" * 40, "#" * 40])
def test_what_is_no_key(keys: KeyDirectory, key: str) -> None:
    with pytest.raises(KeysError, match="the key is no key: a key has 40 characters"):
        keys.add(KnownPeer(name="ann", public=key, role="viewer"))
    check_key(fresh_key(), "this one")


def weak_keys() -> list[str]:
    """All encodings of the points of small order, in Z85."""
    prime = 2**255 - 19
    points = [
        0,
        1,
        prime - 1,
        0x00B8495F16056286FDB1329CEB8D09DA6AC49FF1FAE35616AEB8413B7C7AEBE0,
        0x57119FD0DD4E22D8868E1C58C45C44045BEF839C55B1D0B1248C50A3BC959C5F,
    ]
    same = [*points, prime, prime + 1]
    values = [*same, *(value + 2**255 for value in same)]
    return [z85.encode(value.to_bytes(32, "little")).decode() for value in values]


@pytest.mark.parametrize("key", weak_keys())
def test_a_key_that_keeps_nobody_out(keys: KeyDirectory, key: str) -> None:
    with pytest.raises(KeysError, match="the key is no key: it is the same for everybody"):
        keys.add(KnownPeer(name="ann", public=key, role="controller"))
    place = keys.path / "known.toml"
    place.write_text(f'[ann]\npublic = "{key}"\nrole = "controller"\n')
    place.chmod(0o600)
    with pytest.raises(KeysError, match=r"known\.toml: 'public' is no key: it is the same"):
        keys.known()


def test_nobody_knows_themselves(keys: KeyDirectory) -> None:
    with pytest.raises(KeysError, match=r"is this computer's own: add the \.public file of"):
        keys.add(KnownPeer(name="ann", public=keys.pair().public, role="controller"))
    assert keys.known() == ()


def test_an_unknown_role(keys: KeyDirectory) -> None:
    with pytest.raises(KeysError, match="no role 'king': choose viewer, controller, robot"):
        keys.add(person("ann", "king"))


def test_a_list_that_is_no_file_is_not_waited_for(keys: KeyDirectory) -> None:
    place = keys.path / "known.toml"
    os.mkfifo(place, 0o600)
    with pytest.raises(KeysError, match=r"known\.toml is no regular file"):
        keys.known()
    place.unlink()
    place.mkdir()
    with pytest.raises(KeysError, match=r"known\.toml cannot be read: Is a directory"):
        keys.known()


def test_a_directory_that_others_can_change(keys: KeyDirectory) -> None:
    keys.add(person("ann"))
    for open_to in (0o777, 0o770, 0o702):
        keys.path.chmod(open_to)
        for action in (keys.pair, keys.known, lambda: keys.add(person("bob"))):
            with pytest.raises(KeysError, match=r"Others can change .*keys: say chmod 700"):
                action()
    keys.path.chmod(0o755)  # what is secret has a mode of its own
    assert keys.pair()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_what_belongs_to_somebody_else(keys: KeyDirectory) -> None:
    keys.add(person("ann"))
    for name in ("secret.toml", "known.toml"):
        os.chown(keys.path / name, 12_345, -1)
    for action in (keys.pair, keys.known):
        with pytest.raises(KeysError, match=r"toml belongs to user 12345, .* say chown 0 "):
            action()
    os.chown(keys.path, 12_345, -1)
    with pytest.raises(KeysError, match="keys belongs to user 12345, "):
        keys.known()
    tended = KeyDirectory(keys.path, tended=True)  # as root does, with robotd keys
    tended.add(person("bob"))
    assert [known.name for known in tended.known()] == ["ann", "bob"]
    assert tended.pair()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is empty"),
        ("[ann", "is no TOML"),
        ("\udcff", "is no TOML"),
        ("a = " + "[\n" * 5000, "is no TOML: it is nested too deeply"),
        ("a = " + "[" * 5000, "has a line of more than 1024 bytes"),
        ("a" + ".a" * 30_000 + " = 1", "has a line of more than 1024 bytes"),
        ("a = 1" + "0" * 1000, "is no TOML: an integer has more than 64 bits"),
        ("# long\n" * 10_000, "has more than 65536 bytes"),
        ("ann = 1", r"\[ann\] must be a table"),
        ('[ann]\npublic = "x"\nrole = "viewer"', r"'public' is no key"),
        ('[ann]\nrole = "viewer"', "'public' is missing"),
        ('[ann]\npublic = "{key}"\nrole = "king"', r"\[ann\] has the role 'king'; write viewer"),
        ('[ann]\npublic = "{key}"', r"\[ann\] has the role None"),
        ('["a b"]\npublic = "{key}"\nrole = "viewer"', "'a b' cannot be a name"),
        (
            '[a]\npublic = "{key}"\nrole = "viewer"\n[b]\npublic = "{key}"\nrole = "viewer"',
            "two names have the same key",
        ),
    ],
)
def test_a_list_that_somebody_spoiled(keys: KeyDirectory, text: str, sentence: str) -> None:
    place = keys.path / "known.toml"
    place.write_text(text.replace("{key}", fresh_key()), errors="surrogateescape")
    place.chmod(0o600)
    with pytest.raises(KeysError, match=sentence):
        keys.known()


def test_files_that_are_open_to_others(keys: KeyDirectory) -> None:
    secret, known = keys.path / "secret.toml", keys.path / "known.toml"
    secret.chmod(0o640)
    with pytest.raises(KeysError, match=r"Others can read .*secret\.toml: say chmod 600"):
        keys.pair()
    keys.add(person("ann"))
    known.chmod(0o660)
    with pytest.raises(KeysError, match=r"Others can change .*known\.toml: say chmod 600"):
        keys.known()
    known.chmod(0o644)
    assert len(keys.known()) == 1


def test_a_pair_that_does_not_fit_together(keys: KeyDirectory) -> None:
    place = keys.path / "secret.toml"
    place.write_text(place.read_text().replace(keys.pair().public, fresh_key()))
    with pytest.raises(KeysError, match="do not belong together"):
        keys.pair()


def test_what_is_missing_is_named_with_what_to_do(tmp_path: Path) -> None:
    keys = KeyDirectory(tmp_path / "nowhere")
    with pytest.raises(KeysError, match=r"secret\.toml does not exist: .* robotd keys new --keys"):
        keys.pair()
    with pytest.raises(KeysError, match="nowhere cannot be opened: No such file"):
        keys.add(person("ann"))
    with pytest.raises(KeysError, match=r"x\.public does not exist"):
        read_public(tmp_path / "x.public")
    (tmp_path / "x.public").write_text('public = "x"')
    with pytest.raises(KeysError, match=r"'name' is missing; is it the \.public file"):
        read_public(tmp_path / "x.public")
    (tmp_path / "file").write_text("")
    with pytest.raises(KeysError, match=r"file/keys cannot be made: Not a directory"):
        KeyDirectory(tmp_path / "file" / "keys").create("x")


def test_a_directory_that_cannot_be_looked_into_is_named(tmp_path: Path) -> None:
    with pytest.raises(KeysError, match=r"known\.toml cannot be read: File name too long"):
        KeyDirectory(tmp_path / (256 * "n")).known()
    with pytest.raises(KeysError, match=r"'~nosuch/keys' begins with .*: write the whole path"):
        KeyDirectory("~nosuch/keys")


def test_changes_at_the_same_time_are_all_kept(keys: KeyDirectory) -> None:
    people = [person(f"p{number}") for number in range(24)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(keys.add, people))
    assert {each.name for each in keys.known()} == {each.name for each in people}
    assert not [place for place in keys.path.iterdir() if place.name.startswith(".")]


def test_the_stamp_tells_of_every_change(keys: KeyDirectory) -> None:
    stamps = [keys.stamp()]
    for number in range(5):
        keys.add(person(f"p{number}"))
        stamps.append(keys.stamp())
        keys.remove(f"p{number}")
        stamps.append(keys.stamp())
    assert all(before != after for before, after in pairwise(stamps))


# --- the command ----------------------------------------------------------------------------------


def robotd_keys(*arguments: object) -> int:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args([str(argument) for argument in arguments]))


def test_a_robot_and_a_researcher_get_to_know_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, ann = tmp_path / "robot", tmp_path / "ann"
    robotd_keys("new", "--keys", robot, "--name", "crawler")
    robotd_keys("new", "--keys", ann, "--name", "ann")
    robotd_keys("add", ann / "ann.public", "--role", "controller", "--keys", robot)
    robotd_keys("add", robot / "crawler.public", "--role", "robot", "--keys", ann)
    assert KeyDirectory(ann).client_keys().robot == KeyDirectory(robot).pair().public
    capsys.readouterr()
    assert robotd_keys("list", "--keys", robot) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"this computer  {KeyDirectory(robot).pair().public}",
        f"controller  ann  {KeyDirectory(ann).pair().public}",
    ]
    robotd_keys("remove", "ann", "--keys", robot)
    assert KeyDirectory(robot).known() == ()


def test_robotd_fails_with_a_sentence(keys: KeyDirectory) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "robot", "keys", "remove", "ann", "--keys", str(keys.path)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.startswith("robotd: 'ann' is not known in")
