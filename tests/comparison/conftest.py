"""All of it in 64 bit, what the modules' fixtures make as well."""

import pytest

from tests.precision import in_64_bit


@pytest.fixture(autouse=True, scope="module")
def precision():
    with in_64_bit():
        yield
