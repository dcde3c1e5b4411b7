"""Effects are tested in the engines' precision."""

import pytest

from tests.precision import in_64_bit


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield
