"""How quickly the studio's page answers while a diagnosis runs, and while nothing does.

    python benchmarks/studio_response.py

Clicks on a stage until the page shows it (server and back), and loads of a frame of the video,
measured in the browser. Prints the median and the 95th percentile in ms, and the processor time
that a fixed calculation took meanwhile over what it took before: how busy the machine was.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

import galileo_jax as gx

CHROMIUM = "/usr/bin/chromium"
PATIENCE_MS = 900_000
SAMPLES = 120
PAUSE_S = 0.25

CLICK = """async () => {
  const target = document.querySelector("[data-stage=track]").ariaCurrent ? "compare" : "track";
  const began = performance.now();
  document.querySelector(`[data-stage=${target}]`).click();
  while (!document.querySelector(`[data-stage=${target}][aria-current]`))
    await new Promise((next) => setTimeout(next, 1));
  return performance.now() - began;
}"""
FRAME = """async () => {
  const began = performance.now();
  await (await fetch("/frame/clip/7", { cache: "no-store" })).blob();
  return performance.now() - began;
}"""


def wall_s() -> float:
    """Of a fixed calculation: grows with what else the machine does."""
    began = time.perf_counter()
    np.linalg.svd(np.random.default_rng(0).normal(size=(220, 220)))
    return time.perf_counter() - began


def sample(page, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Times of clicks and of frames, ms, and how slow the fixed calculation was, s."""
    clicks, frames, busy = [], [], []
    for _ in range(count):
        clicks.append(page.evaluate(CLICK))
        frames.append(page.evaluate(FRAME))
        busy.append(wall_s())
        time.sleep(PAUSE_S)
    return np.array(clicks), np.array(frames), float(np.median(busy))


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        gx.simulate(Path(folder) / "clip.mp4", seed=5, effects={"air_drag": {}}, strength=0.5)
        words = [sys.executable, "-m", "galileo_jax", "studio", folder, "--no-browser"]
        server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            address = server.stdout.readline().strip()
            browser = tools.chromium.launch(
                executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"]
            )
            page = browser.new_page(viewport={"width": 1280, "height": 720})
            page.set_default_timeout(PATIENCE_MS)
            page.goto(address)
            for button, stage in (("track", "track"), ("fit", "compare")):
                page.click(f"[data-do={button}]")
                page.wait_for_selector(f"[data-stage={stage}][data-state=done]")
            show("nothing runs", *sample(page, SAMPLES // 2))
            page.click("[data-stage=compare]")
            page.click("[data-do=diagnose]")
            page.wait_for_selector("[data-stage=diagnose][data-state=running]")
            show("a diagnosis runs", *sample(page, SAMPLES))
            still = page.locator("[data-stage=diagnose][data-state=running]").count()
            print(f"the diagnosis was {'still running' if still else 'over'} at the end")
            browser.close()
        finally:
            server.terminate()
            server.wait(30)


def show(title: str, clicks: np.ndarray, frames: np.ndarray, busy_s: float) -> None:
    """One line."""
    parts = [
        f"{name} {np.median(times):.0f} / {np.quantile(times, 0.95):.0f}"
        for name, times in (("click", clicks), ("frame", frames))
    ]
    print(
        f"{title}: {', '.join(parts)} ms (median / 95th percentile, n = {len(clicks)}); "
        f"fixed calculation {1000 * busy_s:.0f} ms",
        flush=True,
    )


if __name__ == "__main__":
    main()
