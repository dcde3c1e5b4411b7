"""Results put together by hand, once for all tests of pages and figures."""

import pytest

from tests.found import make_trials
from tests.oracle_run import HIT, make_run
from tests.precision import in_64_bit


@pytest.fixture
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="package")
def hit_run(tmp_path_factory):
    with in_64_bit():
        return make_run(tmp_path_factory.mktemp("hit"), HIT, 1.6)


@pytest.fixture(scope="package")
def trials_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("clip")


@pytest.fixture(scope="package")
def trials(trials_folder):
    with in_64_bit():
        return make_trials(trials_folder)
