"""What to type where a library that is needed is not installed."""

from __future__ import annotations

import json
import shlex
import sys
from importlib import metadata
from urllib.parse import unquote, urlsplit


def install_command(extra: str = "") -> str:
    """The command that installs bodyschema again with what is missing, from where it came.

    It is on no package index: it came from a checkout or a wheel, which pip has written down (PEP
    610).

    Args:
        extra: Of our optional dependencies; empty: none.
    """
    installed = metadata.distributions(name="bodyschema")  # a checkout in the way has a record, too
    noted = next(filter(None, (one.read_text("direct_url.json") for one in installed)), "{}")
    source = json.loads(noted)
    url = urlsplit(source.get("url", ""))
    place = unquote(url.path) if url.scheme == "file" else source.get("url", "bodyschema")
    editable = ["--editable"] if source.get("dir_info", {}).get("editable") else []
    what = f"{place}[{extra}]" if extra else place
    return shlex.join(["pip", "install", *editable, what])


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
    print(
        f"{command}: needs {error.name}, which is not installed: {install_command(extra)}",
        file=sys.stderr,
    )
    return 1
