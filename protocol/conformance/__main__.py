"""``python -m protocol.conformance URI``: does a robot speak the protocol?"""

from __future__ import annotations

import argparse
import shlex
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

from protocol.conformance.raw_connection import SuiteSettings
from protocol.conformance.suite import NOT_CHECKED, CheckResult, CheckStatus, run
from protocol.errors import BodyschemaError
from protocol.security.keys import ClientKeys, KeyDirectory
from protocol.text import printable


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints a table; returns 0 when everything that was tried holds, else 1."""
    options = _parser().parse_args(arguments)
    try:
        settings = SuiteSettings(
            uri=options.uri,
            keys=_keys(options.keys),
            move=options.move,
            slow=options.slow,
            far=options.far,
            other_keys=_keys(options.other_keys),
            shut_down=_command(options.shutdown),
            trace=print if options.verbose else None,
        )
        results = run(settings, only=options.only, on_result=_print)
    except (BodyschemaError, ValueError) as error:
        print(f"conformance: {printable(str(error))}", file=sys.stderr)
        return 1
    counts = Counter(result.status for result in results)
    print(
        f"\n{counts[CheckStatus.PASSED]} checks passed, {counts[CheckStatus.FAILED]} failed, "
        f"{counts[CheckStatus.SKIPPED]} were skipped. Clauses that no check can try: "
        f"{', '.join(NOT_CHECKED)}."
    )
    return 1 if counts[CheckStatus.FAILED] else 0


def _keys(place: str | None) -> ClientKeys | None:
    return KeyDirectory(place).client_keys() if place else None


def _command(text: str | None) -> Callable[[], object] | None:
    if text is None:
        return None
    words = shlex.split(text)
    if not words or shutil.which(words[0]) is None:
        raise ValueError(
            f"--shutdown: {text!r} begins with no command that is found here: write its full path."
        )
    return partial(subprocess.Popen, words)


def _print(result: CheckResult) -> None:
    clauses = ", ".join(result.check.clauses)
    print(f"{clauses:<12}{result.status.value:<11}{result.check.title}", flush=True)
    if result.sentence:
        print(f"{'':<23}{printable(result.sentence)}", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m protocol.conformance",
        description="Tries a robot against SPEC.md, clause by clause, and prints what holds. "
        "By default it takes control of a robot at rest for moments, stops it and clears the stop, "
        "and never moves it.",
    )
    parser.add_argument("uri", metavar="URI", help="where the robot is, tcp://host:port")
    parser.add_argument("--keys", metavar="DIR", help="key directory, where the robot asks for one")
    parser.add_argument(
        "--move",
        action="store_true",
        help="also what moves the robot (by at most 0.5 rad), lets it go limp in its zero pose, or "
        "makes it forget other clients",
    )
    parser.add_argument(
        "--far",
        action="store_true",
        help="with --move, also what moves joints to the ends of their ranges",
    )
    parser.add_argument(
        "--other-keys", metavar="DIR", help="key directory of another client, for what needs two"
    )
    parser.add_argument(
        "--shutdown",
        metavar="COMMAND",
        help="at the end, run this command, which shuts the daemon down, and see what it says",
    )
    parser.add_argument(
        "--slow", action="store_true", help="also what takes some minutes of silence"
    )
    parser.add_argument(
        "--verbose",
        action="store_true",
        help="also each message that is sent or received: its bytes in hex, and what they say",
    )
    parser.add_argument(
        "--only",
        default=(),
        type=lambda text: text.split(","),
        metavar="CLAUSE,…",
        help="only the checks of these clauses",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
