import pytest

from tests.missing import needed_module


@pytest.fixture
def folder(tmp_path):
    """An empty one, where the studio can be opened."""
    needed_module("nicegui")
    return tmp_path
