"""The page in a real browser, on a small rendered clip."""

import os
import signal
from pathlib import Path

import pytest

import galileo_jax as gx
from galileo_jax.clip.yaml_file import read_mapping
from tests.studio.clips import clip_in
from tests.studio.tab import children_of, drag, opened, started, wait_until

pytestmark = pytest.mark.video


def point(video: Path, index: int = 0) -> tuple[float, float]:
    return gx.load(video).objects[index].point_px or (0.0, 0.0)


@pytest.fixture(autouse=True)
def clip(folder) -> Path:
    return clip_in(folder)


def test_marks_are_dragged_undone_and_found_again_after_a_reload(browser, folder):
    video = folder / "slide.mp4"
    before, text = point(video), video.with_suffix(".yaml").read_text()
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=marks]")
        page.wait_for_function("document.querySelector('.frame').naturalWidth === 320")
        drag(page, "object1", 12, -6)
        wait_until(lambda: point(video) != before)
        after = point(video)
        scale = page.locator(".stage").bounding_box()["width"] / 320
        assert after == pytest.approx((before[0] + 12 / scale, before[1] - 6 / scale), abs=0.02)
        page.reload()
        page.click("[data-stage=marks]")
        shown = page.locator("[data-handle=object1]").get_attribute("transform")
        assert shown == f"translate({after[0]:g} {after[1]:g})"
        page.click("[aria-label=Undo]")
        wait_until(lambda: point(video) == before)
        assert video.with_suffix(".yaml").read_text() == text
        page.click("[aria-label=Redo]")
        wait_until(lambda: point(video) == after)


def test_a_rectangle_of_known_sides_is_laid_in_place_of_the_stick(browser, folder):
    yaml = folder / "slide.yaml"
    text = yaml.read_text()
    scale = read_mapping(yaml)["pixels_per_metre"]
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=marks]")
        page.click("[data-do=rectangle]")
        page.wait_for_selector("[data-handle=corner4]")
        assert page.locator("[data-handle=stick1]").count() == 0
        page.wait_for_selector("[data-remark=missing]")
        assert "rectangle's width and height" in page.inner_text("[data-remark=missing]")
        drag(page, "corner3", 6, 2)
        for side, pixels in enumerate((128, 72)):
            page.locator(f"[data-side='{side}']").fill(f"{pixels / scale:.4f}")
            page.keyboard.press("Tab")
        wait_until(lambda: read_mapping(yaml).get("rectangle") is not None)
        said = read_mapping(yaml)["rectangle"]
        assert said["sides_m"] == pytest.approx([128 / scale, 72 / scale], rel=1e-3)
        assert said["corners_px"][:2] == [[96.0, 126.0], [224.0, 126.0]]
        assert said["corners_px"][2][0] > 224.0, "dragged"
        page.wait_for_selector("[data-remark=fine]")
        page.wait_for_selector("polygon.side")
        for _ in range(4):
            page.click("[aria-label=Undo]")
        wait_until(lambda: yaml.read_text() == text)
        page.wait_for_selector("[data-handle=stick1]")


def test_what_is_being_typed_stays_while_another_field_is_taken(browser, folder):
    yaml = folder / "slide.yaml"
    scale = read_mapping(yaml)["pixels_per_metre"]
    width, height = (f"{pixels / scale:.4f}" for pixels in (128, 72))
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=marks]")
        page.click("[data-do=rectangle]")
        page.wait_for_selector("[data-handle=corner4]")
        page.locator("[data-side='0']").fill(width)
        page.keyboard.press("Tab")
        page.locator("[data-side='1']").fill(height)
        page.wait_for_timeout(1500)
        assert page.input_value("[data-side='1']") == height
        page.keyboard.press("Tab")
        wait_until(lambda: read_mapping(yaml).get("rectangle") is not None)
        assert read_mapping(yaml)["rectangle"]["sides_m"] == [float(width), float(height)]


def test_the_keyboard_steps_through_frames_and_moves_marks(browser, folder):
    video = folder / "slide.mp4"
    before = point(video)
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=marks]")
        page.focus(".viewer")
        page.keyboard.press("Home")  # where it is already
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowLeft")
        assert page.inner_text(".scrub output").endswith("· 1")
        page.wait_for_selector('.frame[src="/frame/slide/1"]')  # once it has come
        page.focus("[data-handle=object2]")
        page.focus("[data-handle=object1]")
        page.keyboard.press("ArrowDown")
        wait_until(lambda: point(video) == (before[0], before[1] + 1))


def test_a_second_tab_sees_what_the_first_one_draws(browser, folder):
    video = folder / "slide.mp4"
    before = point(video)
    with started(folder) as studio, opened(browser, studio) as one, opened(browser, studio) as two:
        for page in (one, two):
            page.click("[data-stage=marks]")
        drag(one, "object1", 10, 0)
        wait_until(lambda: point(video) != before)
        x, y = point(video)
        two.wait_for_selector(f'[data-handle=object1][transform="translate({x:g} {y:g})"]')
        two.click("[aria-label=Undo]")
        place = f"translate({before[0]:g} {before[1]:g})"
        one.wait_for_selector(f'[data-handle=object1][transform="{place}"]')


def test_killing_the_server_loses_no_mark_and_leaves_no_process(browser, folder):
    video = folder / "slide.mp4"
    before = point(video)
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=marks]")
        drag(page, "object1", 10, 0)
        wait_until(lambda: point(video) != before)
        after = point(video)
        page.click("[data-do=track]")
        page.wait_for_selector("[role=status]")
        children = children_of(studio.process.pid)
        assert children, "the job has a process"
        os.kill(studio.process.pid, signal.SIGKILL)
        studio.process.wait(20)
        wait_until(lambda: not any(map(is_alive, children)))
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=marks]")
        shown = page.locator("[data-handle=object1]").get_attribute("transform")
        assert shown == f"translate({after[0]:g} {after[1]:g})"
        page.click("[aria-label=Undo]")
        wait_until(lambda: point(video) == before)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_broken_video_is_explained_and_the_others_work(browser, folder):
    content = (folder / "slide.mp4").read_bytes()
    (folder / "broken.mp4").write_bytes(content[: len(content) // 2])
    with started(folder) as studio, opened(browser, studio) as page:
        page.click("[data-stage=video]")
        assert page.locator(".trouble").inner_text().startswith("broken: ")
        page.click("[data-stage=marks]")
        page.wait_for_selector("[data-handle=object1]")


def test_fingers_find_their_targets_on_a_tablet(browser, folder):
    with started(folder) as studio, opened(browser, studio, (1024, 768)) as page:
        for stage in ("marks", "video"):
            page.click(f"[data-stage={stage}]")
            page.wait_for_selector(f"[data-stage={stage}][aria-current=step]")
            small = page.evaluate(
                "[...document.querySelectorAll('button:not(:disabled), .target')]"
                ".map((e) => [e.textContent, e.getBoundingClientRect()])"
                ".filter(([, box]) => box.width && Math.min(box.width, box.height) < 43.5)"
                ".map(([text]) => text)"
            )
            assert small == []
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= 1024, "nothing to scroll sideways"
