"""Machine code: made once per machine, kept on disk, announced where it takes seconds."""

from __future__ import annotations

import fcntl
import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar

import numba
from numba.core import event
from numba.core.caching import FunctionCache

_Function = TypeVar("_Function", bound=Callable[..., Any])

_PAUSE: Final = (
    "Compiling the statics kernel for this machine: half a minute, once; later runs load it.\n"
)


_njit: Final[Callable[..., Any]] = numba.njit  # its type hints lack some of its options
_function_cache: Final[Callable[..., Any]] = FunctionCache
_INNER: Final[dict[str, Any]] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,  # called by the kernel alone
    "no_cfunc_wrapper": True,
}
_LENT: Final[dict[str, Any]] = {**_INNER, "_nrt": False}
"""Options without reference counts of arrays: atomic counters were a third of the time."""


def compiled(function: _Function) -> _Function:
    """Compiles a function for the kernel that works on arrays that it is given.

    Arithmetic is IEEE's to the letter, in the order written.
    """
    machine_code: _Function = _njit(**_LENT)(function)
    return machine_code


def inlined(function: _Function) -> _Function:
    """Compiles as ``compiled`` does, inlined in callers: for functions given a whole work space.

    Arguments are passed by value, and to copy some hundred words would take longer than the work.
    """
    machine_code: _Function = _njit(**_LENT, forceinline=True)(function)
    return machine_code


def compiled_for_vectors(function: _Function) -> _Function:
    """Compiles a function for the kernel that may compare several numbers at once for a maximum.

    Of finite numbers the largest is the largest in any order, and the sign of a zero is not looked
    at. Nothing may be computed in another order or precision than written, so results are the same
    to the bit wherever the mathematical library is the same.
    """
    machine_code: _Function = _njit(**_LENT, fastmath={"nnan", "nsz"})(function)
    return machine_code


def allocating(function: _Function) -> _Function:
    """Compiles a function for the kernel that makes arrays."""
    machine_code: _Function = _njit(**_INNER)(function)
    return machine_code


def entrance(function: _Function) -> _Function:
    """Compiles a function called from Python that releases the interpreter; its code is kept.

    Where there is no folder to keep machine code in, it is compiled without being kept.
    """
    machine_code = _njit(error_model="numpy", nogil=True)(function)
    with suppress(RuntimeError):  # no directory that can be written
        machine_code._cache = _Cache(function)
    entered: _Function = machine_code
    return entered


class _Cache:
    """Numba's cache, which alone would end a run if its disk is full or its files are damaged."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._files = _function_cache(function)
        self.cache_path: str = self._files.cache_path
        self.flush: Callable[[], None] = self._files.flush

    def load_overload(self, signature: object, target: object) -> object:
        """Returns machine code that was kept, or ``None`` where there is none that can be used."""
        try:
            return self._files.load_overload(signature, target)
        except Exception:  # bytes that are not numba's may raise anything
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, signature: object, code: object) -> None:
        """Keeps machine code, or says why not."""
        try:
            self._files.save_overload(signature, code)
        except OSError as error:
            _say(
                f"Compiled code cannot be kept in {self.cache_path} ({error.strerror}), so it is "
                "compiled again each time: make room, or set NUMBA_CACHE_DIR to another folder.\n"
            )


def stamp(folder: Path, *others: Path) -> int:
    """Number that changes with the kernel's sources: those in a folder, and other files.

    The cache looks only at the file of the function that is called from Python. That function
    closes over this number, which makes it part of the key.
    """
    digest = hashlib.sha256()
    for path in (*sorted(folder.glob("*.py")), *others):
        digest.update(path.read_bytes())
    return int.from_bytes(digest.digest()[:6], "big")


class _Announcement(event.Listener):
    def on_start(self, event: object) -> None:
        _say(_PAUSE)

    def on_end(self, event: object) -> None:
        pass


@cache
def _say(sentence: str) -> None:
    sys.stderr.write(sentence)
    sys.stderr.flush()


@contextmanager
def announced() -> Iterator[None]:
    """Says on stderr, once, why it takes so long, if anything has to be compiled within.

    One process does so at a time; the others wait, and load what it has kept.
    """
    with Path(__file__).open("rb") as lock:
        with suppress(OSError):  # a file system that locks nothing: each compiles for itself
            fcntl.flock(lock, fcntl.LOCK_EX)
        with event.install_listener("numba:compile", _Announcement()):
            yield
