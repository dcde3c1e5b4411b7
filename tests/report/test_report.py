"""The page: self-contained, with the numbers, and plain about what is not known."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from galileo_jax.clip.schema import Clip
from galileo_jax.prediction.posterior_predictive import posterior_predictive
from galileo_jax.report.animation import animation
from galileo_jax.report.draw import write_svgs
from galileo_jax.report.fit_charts import failing_interval_of
from galileo_jax.report.fit_page import charts_of_run, write_report
from galileo_jax.report.fit_text import fit_quality, undetermined
from galileo_jax.report.html_page import write_page
from galileo_jax.report.provenance import digest
from galileo_jax.report.video_frames import BUDGET_BYTES, sample_frames
from galileo_jax.results.run import load_run
from galileo_jax.results.shown import shown
from tests.oracle_run import HIT, MISS, PARTS, STILL, make_run
from tests.reference_ramp import solve
from tests.report.browser import opened
from tests.report.references import check_needs_nothing_from_outside

PHONE_PX = 390


@pytest.fixture(scope="module")
def run(hit_run):
    return load_run(hit_run.folder, "c")


@pytest.fixture(scope="module")
def page(run):
    return write_report(run).read_text(encoding="utf-8")


def test_needs_nothing_from_outside(page):
    check_needs_nothing_from_outside(page)


def test_in_a_browser_the_slider_moves_everything_also_on_a_phone(run, page, browser):
    with opened(browser, run.folder / "report.html") as (shown, complaints):
        assert shown.locator(".chart").count() == 12
        first = places(shown)
        slider = shown.get_by_role("slider")
        slider.focus()
        for _ in range(20):
            slider.press("ArrowRight")
        moved = places(shown)
        assert all(one != two for one, two in zip(first[0::2], moved[0::2], strict=True))
        assert shown.locator("output").inner_text() == "0.67 s"
        assert shown.locator(".playhead:not([hidden])").count() == 10, "in every chart of time"
        shown.set_viewport_size({"width": PHONE_PX, "height": 844})
        shown.wait_for_function(
            "[...document.querySelectorAll('.chart .main-svg')]"
            f".every((one) => one.clientWidth <= {PHONE_PX})"
        )
        assert shown.evaluate("document.documentElement.scrollWidth") <= PHONE_PX
        narrow = shown.eval_on_selector_all(".chart", "all => all.map(one => one.clientWidth)")
        assert min(narrow) >= 300
    assert complaints == []


def places(shown) -> list[str]:
    """Where the drawn objects are: object 1 and 2, fitted, then measured."""
    transforms = "all => all.map(one => one.getAttribute('transform'))"
    return shown.eval_on_selector_all("[data-of]", transforms)


def test_shows_the_pictures_of_a_video(run, tmp_path, browser):
    clip = filmed(run.clip, tmp_path / "clip.mp4")
    last = len(run.problem.observation.times_s) - 1
    still = np.zeros((2, 2, last + 1))
    motion = animation(clip, run.problem, {"fit": still})
    path = write_page(tmp_path / "page.html", "fit", "film", "It moves.", [motion])
    brightness = "one => one.getContext('2d').getImageData(10, 10, 1, 1).data[0]"
    with opened(browser, path) as (shown, complaints):
        shown.wait_for_selector("canvas[data-frame='0']")
        shown.get_by_role("slider").press("End")
        canvas = shown.wait_for_selector(f"canvas[data-frame='{last}']")
        assert canvas.evaluate(brightness) == pytest.approx(4 * last, abs=12)
    assert complaints == []


def test_a_figure_saves_itself_as_svg(run, page, browser):
    with opened(browser, run.folder / "report.html") as (shown, complaints):
        chart = shown.locator(".chart").first
        chart.hover()
        with shown.expect_download() as saved:
            chart.locator(".modebar-btn").click()
        assert saved.value.suggested_filename == f"{chart.get_attribute('aria-label')}.svg"
        assert Path(saved.value.path()).read_text(encoding="utf-8").startswith("<svg")
    assert complaints == []


def filmed(clip: Clip, path: Path) -> Clip:
    """The clip as if it had been filmed: frames that grow brighter, by 4 each."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (160, 120))
    for index in range(clip.frame_count):
        writer.write(np.full((120, 160, 3), min(4 * index, 255), np.uint8))
    writer.release()
    seen = {"video": path, "track": None, "frame_size_px": (160, 120), "origin_px": (80.0, 90.0)}
    return clip.model_copy(update=seen | {"pixels_per_metre": 100.0})


def test_a_film_is_small_and_evenly_spaced(tmp_path, run):
    filmed(run.clip.model_copy(update={"frame_count": 250}), tmp_path / "clip.mp4")
    found = sample_frames(tmp_path / "clip.mp4", 245)
    assert found.frames == tuple(range(0, 245, 3)), "at most 120 pictures"
    assert found.size_px == (160, 120), "never larger than it was"
    assert sum(map(len, found.pictures)) < 4 * BUDGET_BYTES / 3


def test_the_failing_interval_is_found_and_noise_has_none(run):
    fitted = posterior_predictive(run, seed=0)
    quiet = np.random.default_rng(0).standard_normal(fitted.residuals.shape)
    assert failing_interval_of(replace(fitted, residuals=quiet)) is None
    quiet[0, 0, 10:16] += 6.0
    found = failing_interval_of(replace(fitted, residuals=quiet))
    assert found is not None and found[:2] == ("object1", "x")
    worst = found[2]
    assert (worst.start_s, worst.end_s) == pytest.approx((10 / 30, 15 / 30), abs=1 / 30)


def test_states_the_numbers(run, page):
    for name in ("k1", "k2"):
        entry = run.result["parameters"][name]
        assert f"<b>{shown(entry)}</b>" in page
        assert shown(entry, "q975") in page
    for name in run.result["nuisances"]:
        assert f"<code>{name}</code>" in page
    assert f"{run.result['error']['chi2_per_dof']:.2f}" in page
    assert "--method mh" in page and "--seed 3" in page and run.result["version"] in page
    assert "only the ratio of the masses can be determined" in page
    assert digest(run.clip.track) in page and "mujoco" in page, "inputs and versions"


def test_has_every_figure_and_writes_them_as_files_when_asked(run, page, tmp_path):
    assert not list(run.folder.rglob("*.svg")), "they take as long as a fit"
    written = write_svgs(tmp_path / "plots", charts_of_run(run))
    names = {path.stem for path in written}
    assert set(written) == set((tmp_path / "plots").glob("*.svg"))
    objects = run.problem.observation.names
    assert names == {
        *(f"{kind}_{o}_{a}" for kind in ("velocity", "position") for o in objects for a in "xy"),
        *(f"residuals_{o}" for o in objects),
        "pairs",
        "trace",
    }
    assert page.count('class="chart"') == len(names) and page.count("<svg") == 1, "and the motion"


def test_the_same_run_gives_the_same_page(run, page):
    assert write_report(run).read_text(encoding="utf-8") == page


def test_names_from_outside_are_escaped(run):
    hostile = replace(run, result=run.result | {"clips": ["<b>&.mp4"]})
    assert "<h1>&lt;b&gt;&amp;.mp4</h1>" in write_report(hostile).read_text(encoding="utf-8")


def test_the_thesis_is_no_posterior(run):
    thesis = {"method": "grad", "preset": "thesis", "best": {"k1": 0.123}}
    page = write_report(replace(run, result=run.result | thesis)).read_text(encoding="utf-8")
    assert "not a posterior" in page and "k1 = 0.123" in page and "--preset thesis" in page


def test_residuals_are_whitened_and_the_hit_is_found(run):
    fitted = posterior_predictive(run, seed=0)
    assert fitted.residuals.std() == pytest.approx(1.0, abs=0.6)
    assert fitted.hits_s[0] == pytest.approx(solve(HIT, np.zeros(1)).hit_s, abs=0.02)
    found = [phase.name for phase in fitted.phases[0]]
    assert found == ["at rest", "ramp", "foot", "table", "collision", "after"]


def test_the_hit_of_objects_that_part_is_where_the_closed_form_has_it(tmp_path):
    fitted = posterior_predictive(make_run(tmp_path, PARTS, 1.8), seed=0)
    assert fitted.hits_s[0] == pytest.approx(solve(PARTS, np.zeros(1)).hit_s, abs=0.02)


def not_identified(run, *names):
    """The run as if the clip had not told `names`."""
    result = json.loads(json.dumps(run.result))
    for room in ("parameters", "derived"):
        for name in names:
            if name in result[room]:
                result[room][name]["identified"] = False
    return replace(run, result=result)


def test_says_why_a_parameter_is_not_told(tmp_path):
    cases = (
        (MISS, "k2", "never hits"),
        (MISS, "mass_ratio", "never hits"),
        (STILL, "k1", "k1 is at least tan(angle) = 0.364"),
        (STILL, "k2", "nothing moves"),
    )
    made = {case: make_run(tmp_path / str(i), case, 1.0) for i, case in enumerate((MISS, STILL))}
    for case, name, why in cases:
        run = not_identified(made[case], name)
        assert why in undetermined(run, posterior_predictive(run, seed=0))[name]


@pytest.mark.parametrize(
    ("chi2", "is_noise", "said"),
    [
        (0.3, True, "smaller than noise"),
        (1.1, True, "has the size of noise, 1 times"),
        (50, False, "find what is missing: galileo diagnose clip.mp4"),
        (None, True, "cannot be computed"),
    ],
)
def test_chi2_is_put_in_words(chi2, is_noise, said):
    error = {"chi2_per_dof": chi2, "explained_by_noise": is_noise}
    result = {"error": error, "clips": ["clip.mp4"]}
    assert said in " ".join(fit_quality(result))
    assert "galileo" not in " ".join(fit_quality(result, is_asked=True)).replace(
        "galileo compare tests", ""
    )


def test_a_misfit_of_a_nuisance_alone_is_put_in_words():
    pull = {"parameter": "impact_restitution", "value": 0.452, "unit": "1", "z": 5.2}
    said = fit_quality({"error": {"chi2_per_dof": 1.1}, "pulls": [pull]})
    assert "The objects bounce, with a restitution of 0.45" in said[-1]
