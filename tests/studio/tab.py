"""The studio as a person starts it, its page in a real browser, and what is done there, counted.

`STUDIO_PICTURES=docs/images` writes the pictures of the tutorial.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

LONG_MS = 1_500_000  # a diagnosis on a busy machine
PATIENCE_MS = 60_000  # nothing here takes long; a busy machine may


@dataclass
class Server:
    """A running studio."""

    process: subprocess.Popen
    address: str

    @property
    def port(self) -> int:
        """Where it listens."""
        return urlsplit(self.address).port or 0

    @property
    def token(self) -> str:
        """Of the address that it printed."""
        return urlsplit(self.address).query.removeprefix("token=")


@contextmanager
def started(folder: Path, **environ: str) -> Iterator[Server]:
    """`galileo studio FOLDER --no-browser`."""
    words = [sys.executable, "-m", "galileo_jax", "studio", str(folder), "--no-browser"]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, **environ},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), "the studio did not start"
        yield Server(process, address)
    finally:
        process.terminate()
        process.wait(20)
        if process.stdout is not None:
            process.stdout.close()


@contextmanager
def opened(
    browser, studio: Server, size: tuple[int, int] = (1280, 720), expected: str = "nothing"
) -> Iterator[Any]:
    """A tab with the page; it must not complain, but of what is expected."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]})
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.goto(studio.address)
    page.wait_for_selector("[data-stage=marks]")
    yield page
    context.close()
    assert all(expected in one for one in complaints), complaints


def wait_until(is_so: Callable[[], bool]) -> None:
    """Waits for what the server writes."""
    end = time.monotonic() + PATIENCE_MS / 1000
    while not is_so():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)


class Hand:
    """Counts what a person does."""

    def __init__(self, page, has_pictures: bool = True):
        self.page, self.clicks, self.began = page, 0, time.monotonic()
        self.has_pictures = has_pictures

    def click(self, selector: str) -> None:
        self.page.locator(selector).first.click()
        self.clicks += 1

    def type(self, selector: str, text: str) -> None:
        self.page.locator(selector).fill(text)
        self.page.keyboard.press("Tab")
        self.clicks += 1

    def drag(self, handle: str, dx: float, dy: float) -> None:
        drag(self.page, handle, dx, dy)
        self.clicks += 1

    def wait(self, stage: str, state: str = "done") -> None:
        selector = f"[data-stage={stage}][data-state={state}]"
        self.page.wait_for_selector(selector, timeout=LONG_MS)

    def wait_for(self, selector: str) -> None:
        self.page.wait_for_selector(selector, timeout=LONG_MS)

    def picture(self, name: str, at_s: float = 0.6) -> None:
        folder = os.environ.get("STUDIO_PICTURES")
        if folder and self.has_pictures:
            self.page.mouse.move(640, 5)
            self.page.evaluate(f"dispatchEvent(new CustomEvent('galileo-go', {{detail: {at_s}}}))")
            self.page.wait_for_timeout(900)
            path = Path(folder) / f"studio_{name}.jpg"
            self.page.screenshot(path=path, type="jpeg", quality=78)

    def said(self) -> str:
        return f"{self.clicks} clicks, {time.monotonic() - self.began:.0f} s"


def drag(page, handle: str, dx: float, dy: float) -> None:
    """Grabs a mark and lets it go elsewhere, as a finger does."""
    box = page.locator(f"[data-handle={handle}] .target").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + dx / 2, y + dy / 2, steps=3)
    page.mouse.move(x + dx, y + dy, steps=3)
    page.mouse.up()


def children_of(pid: int) -> list[int]:
    """Processes that it has started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(path.parent.name))
    return found
