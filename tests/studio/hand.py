"""What a person does with the page, counted.

`STUDIO_PICTURES=docs/images` writes the pictures of the tutorial.
"""

import os
import time
from pathlib import Path

LONG_MS = 1_500_000  # a diagnosis on a busy machine


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
