"""``estimator watch``: a page with the body while it is being found."""

from __future__ import annotations

import importlib
import signal

import typer

from estimator.cli.console import errors_as_sentences, out
from estimator.cli.live_view import LIVE_BIND, check_viser, parse_bind
from estimator.cli.options import Directory, LiveBind


def command(directory: Directory, bind: LiveBind = LIVE_BIND) -> None:
    """Show a run on a page in the browser, also while another process works on it."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with errors_as_sentences(None):
        host, port = parse_bind(bind)
        check_viser()
        watch = importlib.import_module("estimator.report.live.live_page").watch
        try:
            watch(directory, host, port, _print_line)
        except KeyboardInterrupt:
            raise typer.Exit from None


def _print_line(sentence: str) -> None:
    out.print(sentence, highlight=False, soft_wrap=True)
    out.file.flush()
