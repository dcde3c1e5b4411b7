"""Verdicts other than a name, by clicks in a real browser, on runs that the commands have left.

The clips are short, 320 pixels wide, with one object; what hides in them was chosen so that the
verdict is the one that is wanted. Each diagnosis is made once, by its command.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.results.run import read_result
from tests.missing import needed_module
from tests.studio.tab import LONG_MS, Hand, opened, started, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.video]

BOARD = "--scenario incline --size 320x180 --m1 0.15"
CUBIC = "--effects-from my_effect.py --effect cubic_drag:cubic_drag"
TAPPED = "--effects-from my_effect.py --effect taps:taps=9"
CLIPS = {  # a drag with the cube of the speed is a law; no formula says three taps down the slope
    "unknown": f"{BOARD} {TAPPED} --seed 9 --angle 30 --k1 0.2 --fps 60",
    "law": f"{BOARD} {CUBIC}=0.1 --seed 4 --angle 35 --k1 0.15",
    "ambiguous": f"{BOARD} --effect air_drag --strength 0.1 --seed 7 --angle 25 --k1 0.2"
    " --noise 10",
}
TAPS = '''import jax.numpy as jnp

from galileo_jax import Effect, Normal, Parameter, register_effect


@register_effect
class Taps(Effect):
    """Three taps on the board: each pushes for some hundredths of a second."""

    name = "taps"

    def parameters(self, scene):
        return (Parameter("taps", "m/s^2", Normal(0.0, 3.0), 0.0, "effect", 0.1),)

    def force(self, theta, scene):
        m, taps = theta["m1"][..., None], theta["taps"][..., None]

        def law(state):
            shapes = [jnp.exp(-(((state.time_s - at) / 0.03) ** 2)) for at in (0.2, 0.35, 0.6)]
            return m * taps * sum(shapes)

        return law
'''
SECONDS = {"unknown": 1.2, "law": 1.2, "ambiguous": 0.7}


def galileo(folder: Path, *words: str) -> None:
    """In a process of its own: the effects of a file stay in the library of the one that ran it."""
    subprocess.run(
        [sys.executable, "-m", "galileo_jax", *words], cwd=folder, check=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}, capture_output=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Makes a folder with a clip and what `fit` and `diagnose` leave of it."""
    needed_module("nicegui")
    from galileo_jax.studio.panels.diagnose import TEMPLATE

    made: dict[str, Path] = {}

    def make(name: str) -> Path:
        if name not in made:
            made[name] = folder = tmp_path_factory.mktemp(name)
            own = folder / "my_effect.py"
            own.write_text(TAPS if name == "unknown" else TEMPLATE)
            seconds = str(SECONDS[name])
            words = ["--out", "clip.mp4", "--seconds", seconds, *CLIPS[name].split()]
            galileo(folder, "simulate", *words)
            own.unlink()
            galileo(folder, "fit", "clip.mp4")
            galileo(folder, "diagnose", "clip.mp4", "--add", "none", "--out", "runs/clip/diagnosis")
        return made[name]

    return make


def verdict(folder: Path) -> dict:
    path = folder / "runs" / "clip" / "diagnosis" / "diagnosis.json"
    return json.loads(path.read_text())["verdict"]


def at_the_verdict(page, hand: Hand) -> None:
    hand.click("[data-stage=diagnose]")
    page.wait_for_selector("[data-stage=diagnose][data-state=done]", timeout=LONG_MS)
    page.wait_for_selector("[data-candidate]")


def test_unknown_shows_the_missing_acceleration_and_takes_an_effect_of_ones_own(browser, left):
    folder = left("unknown")
    assert verdict(folder)["status"] == "unknown"
    with started(folder) as studio, opened(browser, studio) as page:
        hand = Hand(page)
        at_the_verdict(page, hand)
        assert "No known effect explains" in page.inner_text("[data-verdict]")
        page.wait_for_selector(".right .js-plotly-plot")
        panels = page.locator(".right .js-plotly-plot .subplot").count()
        assert panels == 3, "against time, place and speed"
        titles = page.locator(".right .js-plotly-plot [class*=xtitle], .right .x2title, .x3title")
        said = " ".join(titles.all_text_contents())
        assert "time" in said and "path" in said and "speed" in said
        assert "ormula explains the missing force" in page.inner_text(".right")
        own = folder / "my_effect.py"
        hand.click("[data-own] .own")
        page.wait_for_selector("[data-effect]")
        page.fill("[data-effect]", TAPS)
        hand.picture("unknown")
        assert not own.exists(), "nothing is written or run before the press"
        hand.click("[data-do=run-effect]")
        hand.wait("diagnose", "running")
        assert "class Taps" in own.read_text()
        hand.wait("diagnose")
        first = page.locator("[data-candidate]").first.get_attribute("data-candidate")
        assert first == "taps" and verdict(folder)["status"] == "named"
        hand.click("[data-add=taps]")
        hand.wait_for("[data-do=remove]")
        hand.wait("compare")
    assert read_result(folder / "runs" / "clip")["effects"] == ["taps"]


def test_ambiguous_says_what_to_film_next(browser, left):
    folder = left("ambiguous")
    found = verdict(folder)
    assert found["status"] == "ambiguous" and found["advice"]
    with started(folder) as studio, opened(browser, studio) as page:
        hand = Hand(page)
        at_the_verdict(page, hand)
        hand.picture("ambiguous")
        assert "cannot distinguish" in page.inner_text("[data-verdict]")
        said = page.inner_text(".right")
        shown = [line for line in found["advice"] if "--effects-from" not in line]
        assert shown
        for line in shown:
            assert line[1:] in said
        for effect in set(found["effects"]) - set(FORM_NAMES):  # a form has no name to be added by
            assert page.locator(f"[data-add={effect}]").is_enabled(), "either can be tried"


def test_a_law_is_added_and_removed_again(browser, left):
    folder = left("law")
    text = verdict(folder)["law"]
    assert text
    run = folder / "runs" / "clip"
    before = read_result(run)["error"]["rmse"]
    with started(folder) as studio, opened(browser, studio) as page:
        hand = Hand(page)
        at_the_verdict(page, hand)
        law = page.locator("[data-candidate^=law_]", has_text=text).first
        assert law.is_visible()
        hand.picture("law")
        law.locator("button").click()
        hand.wait_for("[data-do=remove]")
        hand.wait("compare")
        result = read_result(run)
        assert [name[:4] for name in result["effects"]] == ["law_"]
        assert result["error"]["rmse"] < before
        page.wait_for_selector("[data-stairs] >> text=m/s >> nth=1")
        hand.click("[data-do=remove]")
        page.wait_for_selector("[data-do=remove]", state="detached", timeout=LONG_MS)
        wait_until(lambda: read_result(run)["effects"] == [])
        hand.wait("compare")
    assert read_result(run)["error"]["rmse"] == pytest.approx(before, rel=1e-3)
