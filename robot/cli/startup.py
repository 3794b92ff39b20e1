"""How a command starts: what a person sees who stops it before it got to its work."""

from __future__ import annotations

import importlib
import sys

from protocol.system.interrupts import interrupts_deferred


def start(command: str, module: str, *, extra: str = "") -> int:
    """Loads a command and runs its ``main``.

    Ctrl-C waits while libraries load, because extension modules turn it into errors of their own.

    Args:
        command: What the person typed.
        module: Where its ``main`` is.
        extra: What of our optional dependencies it needs.

    Returns:
        The exit code: that of ``main``, or 1 after a sentence on standard error.
    """
    try:
        with interrupts_deferred():
            loaded = importlib.import_module(module)
        return int(loaded.main())
    except KeyboardInterrupt:
        print(f"{command}: interrupted", file=sys.stderr)
        return 1
    except ModuleNotFoundError as error:
        package = f"bodyschema[{extra}]" if extra else "bodyschema"
        print(
            f"{command}: needs {error.name}, which is not installed: pip install '{package}'",
            file=sys.stderr,
        )
        return 1
