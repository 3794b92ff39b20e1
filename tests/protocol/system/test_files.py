"""A file is replaced as a whole or not at all."""

from __future__ import annotations

import errno
import os
import resource
import stat
from pathlib import Path

import pytest

from protocol.system.files import replace_file, replace_text


def put(path: Path, text: str, mode: int | None = None) -> None:
    replace_file(path, lambda fresh: fresh.write_text(text), mode=mode)


def mode_of(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_the_content_comes_and_nothing_else_stays(tmp_path: Path) -> None:
    place = tmp_path / "made" / "on the way" / "file.csv"
    for text in ("one", "two"):
        put(place, text)
        assert place.read_text() == text
    assert list(place.parent.iterdir()) == [place]


def test_text_is_written_in_utf_8(tmp_path: Path) -> None:
    replace_text(tmp_path / "file.txt", "Größe\n")
    assert (tmp_path / "file.txt").read_bytes() == "Größe\n".encode()


def test_the_writer_is_given_an_empty_file_with_the_same_suffix(tmp_path: Path) -> None:
    place = tmp_path / "plot.png"
    place.write_text("old")

    def write(fresh: Path) -> None:
        assert (fresh.parent, fresh.suffix) == (tmp_path, ".png")
        assert fresh.read_text() == ""
        assert place.read_text() == "old"

    replace_file(place, write)
    assert place.read_text() == ""


def test_permissions_are_set_before_anything_is_written(tmp_path: Path) -> None:
    seen: list[int] = []
    for mode in (0o600, 0o644):
        replace_file(tmp_path / "file", lambda fresh: seen.append(mode_of(fresh)), mode=mode)
        assert mode_of(tmp_path / "file") == mode
    assert seen == [0o600, 0o644]
    before = os.umask(0o027)
    try:
        put(tmp_path / "other", "")
    finally:
        os.umask(before)
    assert mode_of(tmp_path / "other") == 0o640


def test_file_and_folder_are_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[tuple[int, bool]] = []
    real = os.fsync

    def fsync(handle: int) -> None:
        state = os.fstat(handle)
        synced.append((state.st_ino, (tmp_path / "file").exists()))
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    put(tmp_path / "file", "text")
    inode = (tmp_path / "file").stat().st_ino
    assert synced == [(inode, False), (tmp_path.stat().st_ino, True)]


def test_a_folder_that_cannot_be_synced_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(handle: int) -> None:
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(code, "no")

    monkeypatch.setattr(os, "fsync", fsync)
    code = errno.EINVAL
    put(tmp_path / "file", "text")
    assert (tmp_path / "file").read_text() == "text"
    code = errno.EIO
    with pytest.raises(OSError, match="no"):
        put(tmp_path / "file", "text")


@pytest.mark.parametrize("failing", ["fsync", "replace", "fchmod"])
def test_what_fails_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    put(tmp_path / "file", "old")

    def fail(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, failing, fail)
    with pytest.raises(KeyboardInterrupt):
        put(tmp_path / "file", "new", mode=0o600)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2, before[1]))
    try:
        with pytest.raises(OSError, match="File too large") as full:
            put(tmp_path / "file", "text")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert full.value.filename == str(tmp_path / "file")


@pytest.mark.parametrize("folder", [False, True])
def test_what_cannot_be_synced_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: bool
) -> None:
    def fsync(handle: int) -> None:
        if stat.S_ISDIR(os.fstat(handle).st_mode) is folder:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(OSError, match="No space left") as full:
        put(tmp_path / "file", "text")
    assert full.value.filename == str(tmp_path if folder else tmp_path / "file")
