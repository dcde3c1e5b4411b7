"""Tracking by clicks: drawn while it runs, an object put right, and the frames that count."""

import base64
import csv
from pathlib import Path

import pytest

import galileo_jax as gx
from tests.studio.clips import clip_in
from tests.studio.tab import opened, started, wait_until

pytestmark = pytest.mark.video
FRAME = 20


@pytest.fixture(autouse=True)
def clip(folder) -> Path:
    return clip_in(folder)


def go(page, frame: int) -> None:
    page.evaluate(f"dispatchEvent(new CustomEvent('galileo-go', {{detail: {frame} / 30}}))")
    page.wait_for_function(f"document.querySelector('.frame').src.endsWith('/{frame}')")
    page.wait_for_timeout(300)  # until the page has said so


def places(folder: Path) -> list[tuple[float, float]]:
    with (folder / "slide_track" / "track_px.csv").open() as file:
        return [(float(r["object1_x_px"]), float(r["object1_y_px"])) for r in csv.DictReader(file)]


@pytest.mark.slow
def test_a_track_is_drawn_while_it_runs_and_an_object_put_right_by_a_click(browser, folder):
    # Without the cache, in which the track may lie already.
    with started(folder, GALILEO_JAX_CACHE="off") as studio, opened(browser, studio) as page:
        page.click("[data-stage=track]")
        page.click("[data-do=track]")
        page.wait_for_function("+document.querySelector('svg').dataset.follow > 5")
        running = page.locator("[data-stage=track]").get_attribute("data-state")
        assert running == "running", "the video goes along with the track"
        assert "L" in page.locator(".trail").first.get_attribute("d")
        page.wait_for_selector("[data-stage=track][data-state=done]")
        before = places(folder)
        go(page, FRAME)
        page.click("[data-do=right-object1]")
        page.wait_for_selector("svg.placing")
        box = page.locator(".stage").bounding_box()
        scale = box["width"] / 320
        x, y = before[FRAME]
        page.mouse.click(box["x"] + (x + 1.5) * scale, box["y"] + (y - 1.0) * scale)
        corrections = lambda: gx.load(folder / "slide.mp4").objects[0].corrections  # noqa: E731
        wait_until(lambda: bool(corrections()))
        ((frame, said_x, said_y),) = corrections()
        assert frame == FRAME and (said_x, said_y) == pytest.approx((x + 1.5, y - 1.0), abs=0.3)
        page.wait_for_selector("[data-stage=track][data-state=running]")
        page.wait_for_selector("[data-stage=track][data-state=done]")
        assert page.get_by_text(f"object1 was corrected in frame {FRAME}").is_visible()
        after = places(folder)
        assert after[FRAME + 5] == pytest.approx(before[FRAME + 5], abs=0.2)
        assert page.locator(".slide u").count() == 1, "the scrubber shows where"
        page.click(f"[aria-label='Take back frame {FRAME} of object1']")
        wait_until(lambda: not corrections())
        page.wait_for_selector("[data-stage=track][data-state=stale]")


def test_the_frames_that_count_are_those_one_says(browser, folder):
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=video]")
        go(page, 30)
        page.click("[data-do=to-here]")
        wait_until(lambda: gx.load(folder / "slide.mp4").objects[1].last_frame == 30)
        page.wait_for_selector(".slide b")
        page.wait_for_function("document.querySelector('[data-last]').value === '30'")
        page.click("[aria-label=Undo]")
        wait_until(lambda: gx.load(folder / "slide.mp4").objects[1].last_frame is None)


def test_a_file_is_dropped_on_the_page(browser, folder):
    content = base64.b64encode((folder / "slide.mp4").read_bytes()).decode()
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=video]")
        held = page.evaluate_handle(
            """(text) => {
              const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
              const held = new DataTransfer();
              held.items.add(new File([bytes], "dropped.mp4", { type: "video/mp4" }));
              return held;
            }""",
            content,
        )
        page.dispatch_event("body", "drop", {"dataTransfer": held})
        page.wait_for_selector("[data-stage=explain][aria-current=step]")
        page.wait_for_selector("[data-do=explain]")
        page.click("[data-stage=video]")
        page.wait_for_selector("[data-clip=dropped].main")
    assert (folder / "dropped.mp4").read_bytes() == (folder / "slide.mp4").read_bytes()
