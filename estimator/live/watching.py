"""Keeps a live page up to date until somebody ends it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Final, NoReturn

from estimator.errors import RunDirectoryError
from estimator.live.live_page import LivePage
from estimator.live.run_follower import RunFollower
from estimator.live.run_view import RunState

_FLICKER: Final = 0.3  # s

_SAID: Final = {
    RunState.GOES_ON: "The run goes on.",
    RunState.INTERRUPTED: "The run is not finished, and nobody works on it.",
    RunState.FINISHED: "The run is finished.",
}


def watch(directory: Path, host: str, port: int, say: Callable[[str], None]) -> NoReturn:
    """Shows a run on a page, and goes on doing so.

    Args:
        directory: The run directory.
        host: Interface that the page is served on.
        port: Its port; 0: any.
        say: Told where the page is, and what becomes of the run.

    Raises:
        EstimatorError: There is no run, it is damaged from the beginning, or the address cannot be
            had.
        KeyboardInterrupt: Somebody ended it.
    """
    follower = RunFollower(directory)
    view = follower.news()
    with closing(LivePage(directory, host, port)) as page:
        say(f"The live page is at {page.uri}")
        said = ""
        while True:
            try:
                if view is not None:
                    page.show(view)
                    said = _once(say, _SAID[view.state], said)
                else:
                    page.flicker()
                time.sleep(_FLICKER)
                view = follower.news()
            except RunDirectoryError as error:
                page.say(str(error))
                said = _once(say, str(error), said)
                view = None


def _once(say: Callable[[str], None], sentence: str, said: str) -> str:
    if sentence != said:
        say(sentence)
    return sentence
