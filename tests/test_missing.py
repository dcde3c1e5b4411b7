"""What is missing fails in CI and is skipped elsewhere; and no test depends on the clock."""

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests import missing
from tests.missing import NO_SHARED_DATA, is_missing, is_required, needed_module
from tests.report import browser

Skipped, Failed = pytest.skip.Exception, pytest.fail.Exception


@pytest.mark.parametrize(
    ("environ", "waiver", "is_failure"),
    [
        ({}, None, False),
        ({"CI": ""}, None, False),
        ({"CI": "false"}, None, False),
        ({"CI": "0"}, None, False),
        ({"CI": "true"}, None, True),
        ({"CI": "1"}, None, True),
        ({"CI": "true"}, NO_SHARED_DATA, True),
        ({"CI": "true", NO_SHARED_DATA: "0"}, NO_SHARED_DATA, True),
        ({"CI": "true", NO_SHARED_DATA: "1"}, NO_SHARED_DATA, False),
        ({"CI": "true", NO_SHARED_DATA: "1"}, None, True),  # a browser is no data
        ({NO_SHARED_DATA: "1"}, NO_SHARED_DATA, False),
    ],
)
def test_what_is_missing_is_required_in_ci_alone(environ, waiver, is_failure):
    assert is_required(environ, waiver) is is_failure


def test_it_ends_the_test(monkeypatch):
    monkeypatch.setenv("CI", "true")
    monkeypatch.delenv(NO_SHARED_DATA, raising=False)
    with pytest.raises(Failed, match=rf"no data here, and this is CI .*{NO_SHARED_DATA}=1"):
        is_missing("no data here", NO_SHARED_DATA)
    monkeypatch.setenv(NO_SHARED_DATA, "1")
    with pytest.raises(Skipped, match=r"^no data here$"):
        is_missing("no data here", NO_SHARED_DATA)
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


def test_the_data_and_the_browser_are_missing_by_the_same_rule(monkeypatch, tmp_path):
    monkeypatch.setattr(missing, "SHARED_DATA", tmp_path / "none")
    monkeypatch.setattr(browser, "CHROMIUM", None)
    monkeypatch.setenv("CI", "true")
    monkeypatch.delenv(NO_SHARED_DATA, raising=False)
    with pytest.raises(Failed, match=r"no \.\./shared/data beside this checkout, and this is CI"):
        missing.find_shared_data()
    with pytest.raises(Failed, match="no chromium here, and this is CI"), browser.started():
        pass
    monkeypatch.delenv("CI")
    with pytest.raises(Skipped):
        missing.find_shared_data()
    with pytest.raises(Skipped), browser.started():
        pass
    monkeypatch.setattr(missing, "SHARED_DATA", tmp_path)
    assert missing.find_shared_data() == tmp_path


def test_no_property_has_a_deadline():
    assert settings().deadline is None
    assert HealthCheck.too_slow in settings().suppress_health_check
    elsewhere = re.compile(r"deadline=|too_slow|load_profile")
    assert lines_with(elsewhere, "conftest.py", "test_missing.py") == set()


def test_every_skip_for_what_is_missing_goes_through_the_helper():
    """But for ray, which is in no set-up: it is 240 MB, for one engine of the sweeps."""
    assert lines_with(
        re.compile(r"pytest\.(skip|importorskip)\("), "missing.py", "test_missing.py"
    ) == {("sweeping/test_real_sweeps.py", 'pytest.importorskip("ray")')}


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
