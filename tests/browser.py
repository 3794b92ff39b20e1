"""A real browser for the pages that we make: Debian's Chromium without windows, half as dear."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_PROGRAM: Final = Path("/usr/bin/chromium-headless-shell")
_ARGUMENTS: Final = (
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",  # draws WebGL without a graphics card
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_HANGS: Final = 300_000  # ms: a busy machine draws slowly


@contextmanager
def chromium() -> Iterator[Browser]:
    """Starts the browser; a test that needs it fails where it is missing."""
    from playwright.sync_api import sync_playwright  # other tests need not wait for it

    if not _PROGRAM.exists():
        raise RuntimeError(f"{_PROGRAM} is missing: apt-get install chromium-headless-shell")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=_PROGRAM, args=list(_ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def watched_page(browser: Browser, *allowed: str, **options: Any) -> Iterator[Page]:
    """Opens an empty page; afterwards it must have kept to itself and run without an error.

    Args:
        browser: The browser.
        *allowed: What the addresses of its requests may begin with.
        **options: Of the page, as playwright's ``Browser.new_page`` takes them.

    Raises:
        AssertionError: The page asked for another address, or a script in it failed.
    """
    page = browser.new_page(**options)
    page.set_default_timeout(_HANGS)
    requests: list[str] = []
    failures: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("websocket", lambda socket: requests.append(socket.url))
    page.on("pageerror", lambda error: failures.append(str(error)))
    page.on(
        "console",
        lambda message: failures.append(message.text) if message.type == "error" else None,
    )
    try:
        yield page
    finally:
        page.close()
    asked = [url for url in requests if not url.startswith(allowed)]
    if asked or failures:
        raise AssertionError(f"asked for {asked}; failed with {failures}")
