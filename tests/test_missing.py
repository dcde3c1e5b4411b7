"""What a set-up installs fails in CI where it is missing; no test depends on the clock."""

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests import missing
from tests.missing import is_ci, is_missing, needed_module
from tests.report import browser

Skipped, Failed = pytest.skip.Exception, pytest.fail.Exception


@pytest.mark.parametrize(
    ("environ", "expected"),
    [
        ({}, False),
        ({"CI": ""}, False),
        ({"CI": "false"}, False),
        ({"CI": "0"}, False),
        ({"CI": "true"}, True),
        ({"CI": "1"}, True),
    ],
)
def test_ci_is_what_is_set_so(environ, expected):
    assert is_ci(environ) is expected


def test_it_ends_the_test(monkeypatch):
    monkeypatch.setenv("CI", "true")
    with pytest.raises(Failed, match="no browser here, and this is CI"):
        is_missing("no browser here")
    monkeypatch.delenv("CI")
    with pytest.raises(Skipped, match=r"^no browser here$"):
        is_missing("no browser here")


def test_modules(monkeypatch):
    assert needed_module("json.decoder").JSONDecoder
    monkeypatch.setenv("CI", "true")
    with pytest.raises(Failed, match="no nonesuch here"):
        needed_module("nonesuch.part")
    monkeypatch.delenv("CI")
    with pytest.raises(Skipped, match="no nonesuch here"):
        needed_module("nonesuch.part")


def test_a_browser_is_missing_by_the_same_rule(monkeypatch):
    monkeypatch.setattr(browser, "CHROMIUM", None)
    monkeypatch.setenv("CI", "true")
    with pytest.raises(Failed, match="no chromium here, and this is CI"), browser.started():
        pass
    monkeypatch.delenv("CI")
    with pytest.raises(Skipped), browser.started():
        pass


@pytest.mark.parametrize("ci", ["", "true"])
def test_without_the_shared_data_a_test_is_skipped_also_in_ci(monkeypatch, tmp_path, ci):
    monkeypatch.setenv("CI", ci)
    monkeypatch.setattr(missing, "SHARED_DATA", tmp_path / "none")
    with pytest.raises(Skipped, match=r"no \.\./shared/data beside this checkout"):
        missing.find_shared_data()
    monkeypatch.setattr(missing, "SHARED_DATA", tmp_path)
    assert missing.find_shared_data() == tmp_path


def test_no_property_has_a_deadline():
    assert settings().deadline is None
    assert HealthCheck.too_slow in settings().suppress_health_check
    elsewhere = re.compile(r"deadline=|too_slow|load_profile")
    assert lines_with(elsewhere, "conftest.py", "test_missing.py") == set()


def test_every_skip_for_what_is_missing_goes_through_the_helper():
    """But for ray, which is in no set-up: it is 240 MB, for one engine of the sweeps."""
    assert (
        lines_with(re.compile(r"pytest\.(skip|importorskip)\("), "missing.py", "test_missing.py")
        == set()
    )


def lines_with(pattern: re.Pattern, *but_in: str) -> set[tuple[str, str]]:
    """Files and lines of the tests in which a pattern is found."""
    tests = Path(__file__).parent
    return {
        (path.relative_to(tests).as_posix(), line.strip())
        for path in tests.rglob("*.py")
        if path.name not in but_in
        for line in path.read_text(encoding="utf-8").splitlines()
        if pattern.search(line)
    }
