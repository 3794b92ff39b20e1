"""What a command says where a library that it needs is not installed."""

from __future__ import annotations

import sys
from importlib import metadata


def lacking(command: str, extra: str, error: ModuleNotFoundError) -> int:
    """Says in one sentence what to install; the version is known without any library.

    Args:
        command: What the person typed.
        extra: What of our optional dependencies the command needs; may be empty.
        error: Names what is missing.

    Returns:
        The exit code.
    """
    if sys.argv[1:] == ["--version"]:
        print(f"{command} (bodyschema) {metadata.version('bodyschema')}")
        return 0
    package = f"bodyschema[{extra}]" if extra else "bodyschema"
    print(
        f"{command}: needs {error.name}, which is not installed: pip install '{package}'",
        file=sys.stderr,
    )
    return 1
