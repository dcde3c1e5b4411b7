"""A page in a real browser without a screen: Debian's Chromium, driven by playwright."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.missing import is_missing, needed_module

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
DRAW_ALL = "dispatchEvent(new Event('beforeprint'))"  # also the charts that are out of sight
ALL_DRAWN = (
    "[...document.querySelectorAll('.chart')].every((box) => box.querySelector('.main-svg'))"
)


@contextmanager
def started() -> Iterator:
    """The browser; see `missing` for where there is none."""
    playwright = needed_module("playwright.sync_api")
    if CHROMIUM is None:
        is_missing("no chromium here")
    with playwright.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        yield browser
        browser.close()


@contextmanager
def opened(browser, path: Path) -> Iterator[tuple]:
    """The page with all its charts drawn, and a list of what it complains of or asks for."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "request",
        lambda request: (
            None if request.url.startswith(("file:", "data:", "blob:"))
            else complaints.append(request.url)
        ),
    )  # fmt: skip
    page.goto(path.as_uri())
    page.wait_for_function("document.querySelector('#plotly') === null")
    page.evaluate(DRAW_ALL)
    page.wait_for_function(ALL_DRAWN)
    yield page, complaints
    context.close()
