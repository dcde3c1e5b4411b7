"""From a video to a named effect by clicks alone, in a real browser; each takes minutes.

`STUDIO_PICTURES=docs/images` writes the pictures of the tutorial.
"""

import shutil
from pathlib import Path

import pytest

import galileo_jax as gx
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.results.run import read_result
from galileo_jax.studio.session import Session
from tests.studio.tab import LONG_MS, Hand, opened, started, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.video]


def stick(folder: Path) -> float:
    """Length of the stick as it is drawn, px."""
    sheet = Session(folder).sheet
    assert sheet is not None and sheet.marks.stick is not None
    (x1, _), (x2, _) = sheet.marks.stick
    return x2 - x1


@pytest.mark.parametrize(
    ("effect", "seed", "strength"), [("air_drag", 11, 0.5), ("stribeck", 47, 0.8)]
)
def test_from_a_bare_video_to_a_named_effect(browser, folder, capsys, effect, seed, strength):
    video = folder / "clip.mp4"
    gx.simulate(video, seed=seed, effects={effect: {}}, strength=strength)
    scale = read_mapping(video.with_suffix(".yaml"))["pixels_per_metre"]
    size = {one["name"]: one["size_m"] for one in read_mapping(folder / "clip.yaml")["objects"]}
    video.with_suffix(".yaml").unlink()
    with started(folder) as studio, opened(browser, studio) as page:
        hand = Hand(page, has_pictures=effect == "air_drag")
        # What moves is found; the stick is laid on a length, and it is typed.
        hand.click("[data-stage=marks]")
        hand.wait_for("[data-handle=object1]")
        hand.drag("stick2", 60, 0)
        wait_until(lambda: stick(folder) > 0.3 * 640 + 30)
        length = stick(folder)
        page.locator("[data-stick]").fill(f"{length / scale:.5f}")
        page.keyboard.press("Tab")
        hand.clicks += 1
        wait_until(lambda: "pixels_per_metre" in read_mapping(folder / "clip.yaml"))
        for name in ("object1", "object2"):
            place = page.locator(f"[data-size={name}]")
            place.fill(" ".join(f"{side:g}" for side in size[name]))
            page.keyboard.press("Tab")
            hand.clicks += 1
            wait_until(lambda name=name: str(size[name]) in (folder / "clip.yaml").read_text())
        hand.wait_for("[data-remark=fine]")
        hand.picture("marks", 0.0)
        hand.click("[data-do=track]")
        hand.wait("track")
        hand.picture("track")
        hand.click("[data-do=fit]")
        hand.wait("compare")
        hand.picture("fit")
        hand.click("[data-do=to-compare]")
        hand.picture("fails")
        hand.click("[data-do=diagnose]")
        hand.wait_for("[data-candidate]")
        first = page.locator("[data-candidate]").first.get_attribute("data-candidate")
        page.hover(f"[data-candidate={first}]")
        hand.wait_for(f".strip .legendtext[data-unformatted*='{first}']")
        assert page.locator("[data-stage=diagnose][data-state=running]").count(), "not yet over"
        hand.wait("diagnose")
        named = hand.said()
        hand.click(f"[data-add={effect}]")
        hand.wait_for("[data-do=remove]")
        hand.wait("compare")
        hand.picture("missing")
        added = hand.said()
        page.reload()  # everything that was computed is on disk
        hand.wait_for("[data-do=remove]")
        hand.click("[data-do=to-predict]")
        hand.click("[data-do=predict]")
        hand.wait("predict")
        hand.picture("predict")
        page.click("[data-stage=diagnose]")
        page.click("[data-do=remove]")
        hand.wait("compare", "stale")
        hand.wait("compare")
    with capsys.disabled():
        print(f"\nbare video to a verdict: {named}; to the effect in the model: {added}")
    assert hand.clicks <= 14
    assert read_result(folder / "runs" / "clip")["effects"] == []
    found = gx.load_run(folder / "runs" / "clip" / "diagnosis" / "model")
    assert found.names == ("clip",)


def test_a_diagnosis_is_cancelled_and_nothing_is_lost(browser, folder):
    gx.simulate(folder / "clip.mp4", seed=5, seconds=1.5, size=(320, 180))
    with started(folder) as studio, opened(browser, studio) as page:
        hand = Hand(page)
        hand.click("[data-stage=track]")
        hand.click("[data-do=track]")
        hand.wait("track")
        hand.click("[data-do=fit]")
        hand.wait("compare")
        hand.click("[data-do=to-compare]")
        hand.click("[data-do=diagnose]")
        page.wait_for_selector("[data-stage=diagnose][data-state=running]")
        page.locator("[role=status] button").click()
        page.wait_for_selector("[role=status]", state="detached", timeout=LONG_MS)
        assert page.get_by_text("Cancelled").is_visible()
        assert page.locator("[data-stage=fit]").get_attribute("data-state") == "done"
        hand.click("[data-stage=fit]")
        page.wait_for_selector("[data-slider=k1]")
        before = page.locator(".say").inner_text()
        box = page.locator("[data-slider=k1]").bounding_box()
        page.mouse.click(box["x"] + 0.9 * box["width"], box["y"] + box["height"] / 2)
        wait_until(lambda: page.locator(".say").inner_text() != before)
    assert not (folder / "runs" / "clip" / "diagnosis").exists()


def test_two_real_trials_without_a_scale(browser, folder, shared_data, capsys):
    for name in ("slide_r1", "slide_r2"):
        for suffix in (".mp4", ".yaml"):
            shutil.copyfile(shared_data / "real" / f"{name}{suffix}", folder / f"{name}{suffix}")
    with started(folder) as studio, opened(browser, studio) as page:
        hand = Hand(page)
        hand.click("[data-stage=video]")
        hand.click("[data-trial=slide_r2]")
        hand.wait_for("text=slide_r2 >> nth=0")
        hand.click("[data-stage=track]")
        hand.click("[data-do=track]")
        hand.wait("track")
        hand.click("[data-do=fit]")
        hand.wait("compare")
        hand.picture("trials")
        result = read_result(folder / "runs" / "slide_r1+slide_r2")
    same = gx.fit([folder / "slide_r1.mp4", folder / "slide_r2.mp4"])  # what the command does
    assert result["parameters"]["k1"]["mean"] == pytest.approx(same.parameters["k1"]["mean"])
    with capsys.disabled():
        print(f"\ntwo trials to a fit: {hand.said()}")
