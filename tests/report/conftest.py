"""One browser for all pages."""

import pytest

from tests.report.browser import started


@pytest.fixture(scope="session")
def browser():
    with started() as found:
        yield found
