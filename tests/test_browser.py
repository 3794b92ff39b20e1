"""The browser of the tests sees when a page does not keep to itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.browser import watched_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def test_opens_a_page_from_disk(browser: Browser, tmp_path: Path) -> None:
    page_file = tmp_path / "page.html"
    page_file.write_text("<title>Six legs</title><script>document.title += '?'</script>")
    with watched_page(browser, "file:") as page:
        page.goto(page_file.as_uri())
        assert page.title() == "Six legs?"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("<img src='http://127.0.0.1:9/picture.png'>", "picture.png"),
        ("<script>unheard.of()</script>", "unheard"),
    ],
)
def test_a_page_that_asks_elsewhere_or_fails_is_noticed(
    browser: Browser, tmp_path: Path, content: str, told: str
) -> None:
    page_file = tmp_path / "page.html"
    page_file.write_text(content)
    with pytest.raises(AssertionError, match=told), watched_page(browser, "file:") as page:
        page.goto(page_file.as_uri())
