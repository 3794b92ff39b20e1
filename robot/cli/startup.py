"""Starts a command: an interrupt or a missing library while it loads ends in one sentence."""

from __future__ import annotations

import argparse
import importlib
import os
import select
import sys
from importlib import metadata

from protocol.system.missing_library import lacking
from protocol.system.process import interrupts_deferred


def start(command: str, module: str, *, extra: str = "") -> int:
    """Loads a command and runs its ``main``.

    Ctrl-C waits while libraries load, because extension modules turn it into errors of their own.

    Args:
        command: Name of the command that the person typed.
        module: Module with its ``main``.
        extra: Group of optional dependencies that the command needs.

    Returns:
        The exit code: that of ``main``, or 1: after a sentence on standard error, or where nobody
        reads what the command prints, as in ``robotd doctor | head -1``.
    """
    try:
        with interrupts_deferred():
            loaded = importlib.import_module(module)
        code = int(loaded.main())
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        if not _reader_left():
            raise
        return 1
    except KeyboardInterrupt:
        print(f"{command}: interrupted", file=sys.stderr)
        return 1
    except ModuleNotFoundError as error:
        return lacking(command, extra, error)


def _reader_left() -> bool:
    """Whether nobody reads standard output any more; if so, the rest of the output is dropped."""
    poller = select.poll()
    poller.register(sys.stdout, 0)  # of a pipe without a reader, poll(2) tells POLLERR unasked
    if not any(event & select.POLLERR for _, event in poller.poll(0)):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return True


def add_version(parser: argparse.ArgumentParser) -> None:
    """Declares ``--version``, which prints the command's name and version and exits."""
    parser.add_argument(
        "--version", action=_PrintVersion, nargs=0, help="show the version and exit"
    )


class _PrintVersion(argparse.Action):
    """Asks for the version only when it is wanted, so that the rest needs no installation."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"{parser.prog} (bodyschema) {metadata.version('bodyschema')}")
        parser.exit()
