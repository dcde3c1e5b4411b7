"""A class of twenty clips without truths: one call, one page, a row and a link for each."""

import re
import shutil
from urllib.parse import unquote

import pytest

from galileo_jax.commands import command, simulate
from galileo_jax.sweeping.sweep import sweep
from tests.precision import in_64_bit
from tests.report.browser import opened

NUM_CLIPS = 20
WRONG = "clip7"  # one of them has a mistake in its yaml


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The sweep of twenty short tracks."""
    folder = tmp_path_factory.mktemp("class")
    for seed in range(1, NUM_CLIPS + 1):
        words = ["--track-only", "--seconds", "1.0", "--seed", str(seed)]
        assert command.run(simulate.main, [*words, "--out", f"{folder}/clip{seed}.csv"]) == 0
        (folder / f"clip{seed}.truth.json").unlink()
    wrong = folder / f"{WRONG}.yaml"
    wrong.write_text(wrong.read_text() + "gravitation: 9.81\n")
    with in_64_bit():
        return sweep({"clips": [f"{folder}/*.csv"]}, out=folder / "out")


@pytest.mark.slow
def test_a_row_and_a_link_for_each(swept, tmp_path):
    moved = tmp_path / "elsewhere"
    shutil.copytree(swept.folder, moved)
    page = (moved / "report.html").read_text()
    rows = re.findall(r"<tr>.*?</tr>", page[page.index("<tbody>") : page.index("</tbody>")], re.S)
    names = re.findall(r'<th scope="row">(.*?)</th>', "".join(rows))
    assert names == [f"clip{i}" for i in range(1, NUM_CLIPS + 1)], "2 stands before 10"
    assert re.findall(r"<h2.*?>(.*?)</h2>", page)[0] == "Clip by clip"
    for name, row in zip(names, rows, strict=True):
        assert "<svg" in row or name == WRONG
        links = re.findall(r'href="(.*?)"', row)
        if name == WRONG:
            assert "gravitation: unknown key" in row and not links
            continue
        (link,) = links
        own = (moved / unquote(link)).read_text()
        assert name in own and "<h1>" in own
        assert "not determined" in row or "±" in row
        assert "fits" in row


@pytest.mark.slow
def test_it_fits_on_a_phone(swept, browser):
    with opened(browser, swept.report_path) as (page, complaints):
        for width_px in (1280, 390):
            page.set_viewport_size({"width": width_px, "height": 900})
            page.wait_for_function(f"document.documentElement.scrollWidth <= {width_px}")
        assert page.locator("table.clips tbody tr").count() == NUM_CLIPS
        with page.expect_navigation():
            page.locator("table.clips a").first.click()
        assert "clip1" in page.inner_text("h1")
        assert not complaints
