"""The README is short, and its figures are what its commands print."""

import re

import pytest

from tests.docs.console import differences, run
from tests.docs.figures import DEMO, FIT, FITTED
from tests.docs.pages import ROOT

README = (ROOT / "README.md").read_text()
MOST_LINES = 130


def test_the_readme_fits_on_two_screens():
    assert len(README.splitlines()) <= MOST_LINES


def test_the_readme_names_the_commands_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text()
    targets = re.findall(r"^    make (\w+)", README, re.MULTILINE)
    assert sorted(set(targets)) == ["demo", "test"]
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)


def test_the_demo_is_what_the_makefile_runs():
    makefile = (ROOT / "Makefile").read_text()
    assert f"$(BIN)/{DEMO}\n" in makefile
    assert f"$(BIN)/{FIT}\n" in makefile


@pytest.mark.slow
@pytest.mark.video
def test_the_demo_prints_what_the_readme_shows(tmp_path):
    run(DEMO, tmp_path)
    shown = FITTED.search(README)
    assert shown
    lines = [line.removeprefix("    ") for line in shown[1].splitlines()]
    assert not differences("\n".join(lines), run(FIT, tmp_path))
