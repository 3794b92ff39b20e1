"""The command ``estimator``, also ``python -m estimator``: what a person sees who stops it.

Loading the libraries takes a second, in which Ctrl-C is as likely as later.
"""

from __future__ import annotations

import importlib
import sys

from protocol.system.missing_library import lacking
from protocol.system.process import interrupts_deferred

_INTERRUPTED = 130  # typer's, for an interrupt that meets none of our sentences


def main() -> None:
    """Runs a subcommand; exits with 1 and a sentence when it is interrupted."""
    try:
        with interrupts_deferred():
            cli = importlib.import_module("estimator.cli.command_line")
        cli.app(prog_name="estimator")
    except ModuleNotFoundError as error:
        sys.exit(lacking("estimator", "estimator", error))
    except (KeyboardInterrupt, SystemExit) as end:
        if isinstance(end, SystemExit) and end.code != _INTERRUPTED:
            raise
        print("estimator: interrupted", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
