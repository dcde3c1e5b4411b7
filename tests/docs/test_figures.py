"""Figures in the docs: a command makes them; the gallery is of its cases."""

import re
from pathlib import Path

import pytest
import yaml

from benchmarks import gallery, people
from benchmarks.__main__ import summaries
from tests.docs.figures import GALLERY, is_alike
from tests.docs.pages import PAGES, ROOT

COMMAND = re.compile(
    r"python -m\s+benchmarks\s+(\w+)|python -m tests[.]\w+|861ea27:benchmarks/|"
    r"python (?:benchmarks|examples)/\w+|^ +galileo \w+|`galileo \w+",
    re.MULTILINE,
)
FIGURE = re.compile(r"\d\.\d|\d %|\d of \d")
FEW = 3  # a table with fewer figures explains something
LARGEST_BYTES = 15_000
# What is declared or assumed, not measured; and, at a glance, what the linked pages measure.
NOT_MEASURED = {
    ("benchmarks.md", "At a glance"), ("posterior.md", "What bodies do and points do not"),
    ("rough_reality.md", "The model"), ("clip_yaml.md", "The clip"), ("effects.md", "The library"),
}  # fmt: skip
CASES = [one for one in yaml.safe_load(people.CASES.read_text()) if "by" in one]
PAGE = (ROOT / GALLERY).read_text()


def measured_tables() -> list[tuple[Path, str, str]]:
    """Page, heading and section of each table with figures; the notebook's pages are records."""
    found = []
    for page in (one for one in PAGES if one.parent.name != "history"):
        for section in re.split(r"(?m)^(?=## )", page.read_text()):
            heading = section.partition("\n")[0].strip("# ")
            rows = re.findall(r"^\|.*\|$", section, re.MULTILINE)
            figures = [cell for row in rows for cell in row.split("|")[2:] if FIGURE.search(cell)]
            if len(figures) >= FEW and (page.name, heading) not in NOT_MEASURED:
                found.append((page, heading, section))
    return found


@pytest.mark.parametrize(
    ("page", "section"),
    [pytest.param(page, text, id=f"{page.stem}-{name}") for page, name, text in measured_tables()],
)
def test_a_table_with_figures_names_the_command_that_makes_them(page, section):
    calls = list(COMMAND.finditer(section))
    assert calls, page
    assert {call[1] for call in calls} - {None} <= set(summaries())


def test_the_tables_that_measure_nothing_exist():
    headings = {(page.name, one) for page in PAGES for one in _headings(page)}
    assert headings >= NOT_MEASURED


def _headings(page: Path) -> list[str]:
    return re.findall(r"(?m)^## (.+)$", page.read_text())


class TestGallery:
    def test_every_case_has_its_row_in_order(self):
        rows = re.findall(r"^\| (?:!\[.*?\]\(.*?\))? \| .* \|$", PAGE, re.MULTILINE)
        assert len(rows) == len(CASES)
        for case, row in zip(CASES, rows, strict=True):
            assert f"| {case['tells']}. {case['by']} | {case['known']} |" in row

    def test_the_count_is_that_of_the_rows(self):
        verdicts = re.findall(r"\| ([^|]*) \| \d+ \|$", PAGE, re.MULTILINE)
        said = {text: word for word, text in gallery.VERDICTS.items()}
        rows = [{"judged": said.get(one, one)} for one in verdicts]
        assert gallery.counted(rows) in PAGE

    def test_the_pictures_are_those_of_the_page_and_small(self):
        shown = set(re.findall(r"images/gallery/(\w+\.svg)", PAGE))
        files = {one.name: one for one in (ROOT / "docs/images/gallery").iterdir()}
        assert shown == set(files)
        assert all(one.stat().st_size < LARGEST_BYTES for one in files.values())

    def test_a_picture_is_the_same_text_for_the_same_motion(self):
        motion = [{"object": "a", "axis": "y", "dots": [[0, 1], [0, 2]], "line": [[0, 1], [0, 2]]}]
        once, twice = (gallery.drawn("ball", motion, "m") for _ in range(2))
        assert once == twice
        motion[0]["line"] = [[0, 1], [1, 2]]
        assert not is_alike(once, gallery.drawn("ball", motion, "m"))


def test_what_readme_says_beside_the_loop_is_in_the_tutorial():
    readme = (ROOT / "README.md").read_text()
    tutorial = (ROOT / "docs/tutorial/find_what_is_missing.md").read_text()
    (line,) = re.findall(r"# (chi2 falls .*)", readme)
    for number in re.findall(r"\d+(?:\.\d+)?", line.replace("chi2", "")):
        assert re.search(rf"(?<![\d.]){re.escape(number)}", tutorial), number
