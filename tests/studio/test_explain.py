"""From somebody's own film or table to its paragraph, in a real browser."""

import os
import re
import shutil
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.results.run import read_result
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio import results, work
from galileo_jax.studio.jobs import Job
from galileo_jax.studio.session import Session
from tests.studio.clips import clip_in, still_film
from tests.studio.tab import LONG_MS, Hand, children_of, opened, started

PHONE = (390, 844)
MOST_CLICKS, MOST_CPU_S = 12, 180.0
SLOPE = "t (s);s\n" + "".join(f"{t:.2f};{0.4 * t**2:.4f}\n" for t in np.arange(30) / 25)
NO_MOTION = "time of day;place\nnoon;here\n"


def is_within(page) -> bool:
    """Whether nothing on the page has to be scrolled to sideways."""
    return page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_the_time_that_is_left_is_said_once_it_can_be_known():
    job = Job("explain", share=0.25, begun=100.0)
    assert job.time_left(101.0) == ""
    assert job.time_left(110.0) == "about 30 s left"
    assert Job("explain", share=0.01, begun=100.0).time_left(110.0) == ""


def test_a_page_that_is_kept_has_no_links_to_pages_beside_it():
    page = (
        '<p>a</p>\n<p><a href="diagnosis/report.html">what is missing</a></p>\n<a href="#b">b</a>'
    )
    assert results.alone(page) == '<p>a</p>\n<a href="#b">b</a>'


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("still.mp4", "No moving thing was found: "),
        ("broken.mp4", "cannot be decoded"),
        ("temperatures.csv", "temperatures.csv: "),
    ],
)
@pytest.mark.video
def test_what_cannot_be_explained_is_one_line(browser, folder, name, line):
    path = still_film(folder / "still.mp4")
    if name == "broken.mp4":
        (folder / name).write_bytes(path.read_bytes()[:900])
    if name == "temperatures.csv":
        (folder / name).write_text(NO_MOTION)
    with started(folder / name) as studio, opened(browser, studio, PHONE) as page:
        page.wait_for_selector("[data-sentence]")
        assert line in page.inner_text("[data-sentence]")
        assert page.locator("[data-sentence]").count() == 1
        assert page.locator("[data-do=explain]").count() == (name == "still.mp4")
        if name == "still.mp4":
            page.click("[data-do=explain]")
            page.wait_for_selector(".trouble")
            assert page.inner_text(".trouble").startswith("points: an answer is needed")
        # The next file is taken as if nothing had been.
        (folder / "other").mkdir()
        good = folder / "other" / "slope.csv"
        good.write_text(SLOPE)
        page.set_input_files("[data-drop] input", good)
        page.wait_for_selector("[data-question=track_units]")
        assert is_within(page)


@pytest.mark.video
def test_a_file_that_is_no_motion_is_refused_when_it_is_dropped(browser, folder):
    (folder / "other").mkdir()
    bad = folder / "other" / "temperatures.csv"
    bad.write_text(NO_MOTION)
    with started(folder) as studio, opened(browser, studio, expected="422") as page:
        page.set_input_files("[data-drop] input", bad)
        page.wait_for_selector(".said.trouble")
        assert page.inner_text(".said").startswith("temperatures.csv: ")
    assert not (folder / "temperatures.csv").exists()


@pytest.mark.video
def test_a_phone_scrolls_nothing_sideways_and_a_finger_shows_the_thing(browser, folder):
    clip_in(folder, is_bare=True)
    with started(folder) as studio, opened(browser, studio, PHONE) as page:
        page.wait_for_selector("[data-question]")
        assert is_within(page)
        page.click("[data-stage=marks]")
        page.wait_for_selector("[data-handle=object1]")
        assert is_within(page)
        page.click("[data-stage=video]")
        page.wait_for_selector("[data-fps]")
        assert is_within(page)


@pytest.mark.video
def test_a_thing_is_shown_in_the_film_and_a_wrong_answer_is_named(browser, folder):
    still_film(folder / "still.mp4")
    with started(folder) as studio, opened(browser, studio) as page:
        page.wait_for_selector("[data-question=points]")
        page.click("[data-do=point]")
        page.locator(".stage svg").click(position={"x": 40, "y": 30})
        page.wait_for_selector("[data-do=point]:has-text('Show it')")
        x, y = map(int, page.input_value("input[data-answer=points]").split())
        scale = 160 / page.locator(".stage").bounding_box()["width"]
        assert (x, y) == pytest.approx((40 * scale, 30 * scale), abs=1)
        page.fill("input[data-answer=points]", "there")
        page.keyboard.press("Tab")
        page.wait_for_selector(".wrong:has-text('x and y expected')")


SLIDE = {"points": "2", "ramp_angle_deg": "23", "pixels_per_metre": "1870"}
PEOPLES = [
    ("real/01_slide/slide.mp4", SLIDE, (0.25, 0.36)),
    ("real/01_slide/slide_tracker_gbk.txt", {"ramp_angle_deg": "23"}, (0.27, 0.31)),
    ("plain_disc/clip.mp4", {}, None),
    ("tables/m16_fast_ball.mp4", {"scenario": "fall"}, None),
]


@pytest.mark.slow
@pytest.mark.video
@pytest.mark.parametrize(("name", "typed", "k1"), PEOPLES)
def test_from_peoples_files_to_a_report(
    browser, folder, shared_data, capsys, monkeypatch, name, typed, k1
):
    file = folder / Path(name).name
    shutil.copyfile(shared_data / "people" / name, file)
    with started(file) as studio, opened(browser, studio) as page:
        hand = Hand(page, has_pictures=file.name == "slide.mp4")
        hand.wait_for("[data-do=explain]")
        sentence, asked = page.inner_text("[data-sentence]"), hand.said()
        for key, text in typed.items():
            hand.wait_for(f"[data-answer={key}]")
            if key == "scenario":
                hand.click(f"[data-question={key}] .q-field__control")
                hand.click(f".q-menu .q-item:has-text('{text}')")
            else:
                hand.type(f"[data-answer={key}]", text)
        hand.picture("explain", 0.0)
        hand.click("[data-do=explain]")
        hand.wait_for("[data-do=save-report]")
        paragraph = page.inner_text("[data-paragraph]")
        with page.expect_download() as download:
            hand.click("[data-do=save-report]")
        report = Path(download.value.path()).read_text(encoding="utf-8")
        hand.picture("explained", 1.5)
        spent = cpu_s(studio.process.pid)
        done = hand.said()
    with capsys.disabled():
        print(
            f"\n{name}: {sentence}\n{asked} to the sentence; {done}, {spent:.0f} CPU s\n{paragraph}"
        )
    assert hand.clicks <= MOST_CLICKS and spent <= MOST_CPU_S
    assert paragraph in re.sub(r"\s+", " ", unescape(report))
    assert not re.search(r'(src|href)="[^#d]', report), "it needs no network"
    monkeypatch.chdir(folder)
    same = gx.explain(file.name)  # of the yaml that the answers were written to
    assert same.paragraph == paragraph
    if k1 is not None:
        found = read_result(folder / "runs" / file.stem)["parameters"]["k1"]["mean"]
        assert k1[0] < found < k1[1]


@pytest.mark.slow
@pytest.mark.video
def test_the_fit_is_told_before_the_diagnosis_ends_and_can_be_cancelled(browser, folder):
    gx.simulate(folder / "drag.csv", seed=3, effects={"air_drag": {}}, strength=1, track_only=True)
    with started(folder / "drag.csv") as studio, opened(browser, studio, PHONE) as page:
        hand = Hand(page)
        hand.click("[data-do=explain]")
        hand.wait_for("[data-paragraph]:has-text('The data contradict the model')")
        page.wait_for_selector("[role=status]:has-text('s left')")
        page.click("[role=status] button")
        page.wait_for_selector("[role=status]", state="detached", timeout=LONG_MS)
        assert page.locator("[data-paragraph]").count() == 0, "nothing of it is on disk"
        hand.click("[data-do=explain]")
        hand.wait_for("[data-do=save-report]")
        assert "Air drag explains the data" in page.inner_text("[data-paragraph]")
        page.reload()
        hand.wait_for("[data-do=save-report]")
        for stage, state in {"fit": "done", "compare": "stale", "diagnose": "done"}.items():
            page.click(f"[data-stage={stage}][data-state={state}]")
            page.wait_for_selector(f"[data-stage={stage}][aria-current=step]")
            assert is_within(page)
        page.click("[data-stage=predict]")
        assert "galileo explain drag.csv" in page.inner_text("[data-commands]")


def test_a_table_whose_yaml_leads_out_of_the_folder_is_not_opened(tmp_path, monkeypatch):
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "slope.csv"
    for one in (path, tmp_path / "slope.csv"):
        one.write_text(SLOPE)
    path.with_suffix(".yaml").write_text("track: ../slope.csv\nscenario: incline\n")
    session = Session(path.parent, path.name)
    assert session.sheets == {} and "leads out of" in session.broken["slope"]
    monkeypatch.chdir(path.parent)
    with pytest.raises(InputError, match="leads out of"):
        work.understand(clip=path.name, typed={})


def test_answers_are_given_anew(tmp_path):
    path = tmp_path / "slope.csv"
    path.write_text(SLOPE)
    yaml = path.with_suffix(".yaml")
    session = Session(tmp_path, path.name)
    assert session.names == ("slope",) and session.sheet is None
    yaml.write_text("track: slope.csv\n")
    session.store.put("clips", "slope", {"answered": yaml.read_text()})
    assert [one.name for one in session.answered] == ["slope"]
    session.typed["ramp_angle_deg"] = "20"
    yaml.write_text("track: slope.csv  # mine\n")
    session.answer_anew()
    assert yaml.is_file(), "what a person has written stays"
    yaml.write_text("track: slope.csv\n")
    session.answer_anew()
    assert not yaml.is_file() and session.typed == {"ramp_angle_deg": "20"}


def cpu_s(pid: int) -> float:
    """Processor time of a process and of those that it has started, s."""
    ticks = 0
    for one in (pid, *children_of(pid)):
        fields = Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split()
        ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")
