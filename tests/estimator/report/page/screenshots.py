"""Pictures of a run's page; ``make screenshots`` makes those of the documentation."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

from bench.daemons import simulator
from tests.browser import chromium, watched_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser

_DRAWN: Final = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
LOOKS: Final[dict[str, dict[str, Any]]] = {
    "light": {"viewport": {"width": 1000, "height": 1080}, "color_scheme": "light"},
    "dark": {"viewport": {"width": 1000, "height": 1080}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "has_touch": True},
    "paper": {"viewport": {"width": 720, "height": 1018}},
}
"""Width and height of a page in CSS pixels, and how its reader looks at it."""


def take_screenshots(browser: Browser, page_file: Path, folder: Path) -> None:
    """Writes ``report-LOOK.png`` for each look; fails where a page is wider than its window."""
    for look, options in LOOKS.items():
        with watched_page(browser, "file:", "data:", **options) as page:
            page.goto(page_file.as_uri())
            if look == "paper":
                page.emulate_media(media="print")
            page.evaluate(_DRAWN)
            widths = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
            assert widths[0] <= widths[1], (look, widths)
            page.screenshot(path=folder / f"report-{look}.png")


def main(folder: Path) -> None:
    """Identifies a simulated robot, scores it, and takes pictures of its page."""
    with TemporaryDirectory() as name, simulator("--seed", "1") as robot:
        place = Path(name)
        run, truth = place / "first", place / "truth.urdf"
        with truth.open("w") as file:
            subprocess.run(["sim-robotd", "--print-body"], stdout=file, check=True)
        asked = ("--problem", "topological", "--interactions", "4", "--seed", "1", "--out", run)
        for command in (
            ("identify", "--robot", robot.uri, *asked),
            ("score", run, "--truth", truth),
        ):
            subprocess.run(["estimator", *map(str, command)], check=True)
        with chromium() as browser:
            take_screenshots(browser, run / "report.html", folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
