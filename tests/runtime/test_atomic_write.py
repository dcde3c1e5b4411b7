"""Whether a folder can be written to is asked before anything is computed."""

import pytest

from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError


def test_a_check_leaves_nothing_behind(tmp_path):
    check_folder(tmp_path)
    check_folder(tmp_path / "not yet" / "there")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("below", ["", "runs", "runs/clip"])
def test_a_file_in_the_place_of_a_folder_is_one_line(below, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"^--out: .*(is a file|nothing can be written to .* \(N)"):
        check_folder(tmp_path / "file" / below)


def test_a_read_only_folder_is_one_line(nobody_can_write):
    expected = rf"--out: nothing can be written to {nobody_can_write}/runs \(.+\)"
    with pytest.raises(InputError, match=expected):
        check_folder(nobody_can_write / "runs")


def test_a_working_folder_that_has_gone_is_one_line(tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(InputError, match=r"nothing can be written to runs \(.+\)"):
        check_folder(type(gone)("runs"))
