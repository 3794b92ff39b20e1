"""The command ``estimator``, also ``python -m estimator``, and what it prints when interrupted.

Loading the libraries takes a second, so Ctrl-C is handled while they are loaded, too.
"""

from __future__ import annotations

import importlib
import sys

from protocol.system.missing_library import lacking
from protocol.system.process import interrupts_deferred

_INTERRUPTED = 130  # typer's exit status after an interrupt for which we have printed nothing


def main() -> None:
    """Runs a subcommand; prints a sentence and exits with 1 when it is interrupted."""
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
