"""What to type where a library that is needed is not installed."""

from __future__ import annotations

import json
import sys
from importlib import metadata
from urllib.parse import unquote, urlsplit

from protocol.text import command_line


def install_command(extra: str = "") -> str:
    """The command that installs bodyschema again with what is missing, from where it came.

    bodyschema is on no package index: it came from a checkout or a wheel, which pip recorded (PEP
    610).

    Args:
        extra: Group of optional dependencies that is missing; empty: none.
    """
    installed = metadata.distributions(name="bodyschema")  # a checkout on the path is one, too
    direct_url = next(filter(None, (dist.read_text("direct_url.json") for dist in installed)), "{}")
    source = json.loads(direct_url)
    url, version_control = source.get("url", ""), source.get("vcs_info")
    wanted = f"[{extra}]" if extra else ""
    if version_control:
        url = f"{version_control['vcs']}+{url}@{version_control['commit_id']}"
        package = f"bodyschema{wanted} @ {url}"
    elif url.startswith("file:"):
        package = unquote(urlsplit(url).path) + wanted
    else:
        package = f"bodyschema{wanted}" + (f" @ {url}" if url else "")
    editable = ["--editable"] if source.get("dir_info", {}).get("editable") else []
    return command_line("pip", "install", *editable, package)


def lacking(command: str, extra: str, error: ModuleNotFoundError) -> int:
    """Says in one sentence what to install; ``--version`` is answered without the library.

    Args:
        command: Name of the command that the person typed.
        extra: Group of optional dependencies that the command needs; may be empty.
        error: Error that names the missing library.

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
