"""A sweep's folder and a clip's files."""

from dataclasses import fields, replace

import numpy as np
import pytest
import yaml

from galileo_jax.measurement.path_direction import OtherWay
from galileo_jax.measurement.segments.segments import Segments
from galileo_jax.measurement.segments.track_failure import Astray
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.cell import Cell, ClipFiles, make_cells
from galileo_jax.sweeping.settings import Grad
from galileo_jax.sweeping.store import Store
from galileo_jax.sweeping.task import Failure
from galileo_jax.sweeping.work import CellResult, measure_files
from tests.clip.broken_clips import build_good_track


@pytest.fixture
def clip(tmp_path):
    (tmp_path / "clips").mkdir()
    return build_good_track(tmp_path / "clips")


def test_a_clip_comes_back_to_the_last_digit(clip, tmp_path):
    files = ClipFiles.of(clip)
    tracked = measure_files(files.packed())
    measured = tracked.measurement
    assert measured.clip.path == clip.with_suffix(".yaml")
    assert measured.clip.source == str(clip)
    store = Store(tmp_path / "out")
    assert not store.has_clip(files.key)
    measured = replace(
        measured,
        segments=Segments(astray=(Astray("object1", 0.1 + 0.2, "nothing is there"),)),
        way=OtherWay(20.0, 0.1 + 0.2, 0.7, True),
        remarks=("one", "two"),
        pixels=None,
    )
    turned = np.full(measured.observation.mask.shape, 1 / 3)
    measured = replace(measured, observation=replace(measured.observation, turned_rad=turned))
    store.save_clip(files.key, replace(tracked, measurement=measured, thumbnail=b"picture"))
    assert store.clip(files.key).thumbnail == b"picture"
    again = store.clip(files.key).measurement
    assert again.clip == measured.clip
    for field in fields(measured):
        if field.name not in ("observation", "whole"):
            assert getattr(again, field.name) == getattr(measured, field.name), field.name
    for field in fields(measured.observation):
        kept, was = (getattr(one.observation, field.name) for one in (again, measured))
        np.testing.assert_array_equal(kept, was)
        assert type(kept) is type(was), field.name


def test_a_cell_is_named_by_content(clip):
    files = ClipFiles.of(clip)
    name = Cell((files,), Grad()).name
    assert name.startswith("clip-grad-")
    assert Cell((ClipFiles.of(clip.with_suffix(".csv")),), Grad()).name == name, "the same files"
    assert Cell((files,), Grad(seed=1)).name != name
    assert len(make_cells([(files,), (files,)], [Grad(), Grad()])) == 1
    content = yaml.safe_load(clip.with_suffix(".yaml").read_text())
    clip.with_suffix(".yaml").write_text(yaml.safe_dump(content | {"gravity": 9.8}))
    assert Cell((ClipFiles.of(clip),), Grad()).name != name
    moved = clip.parent.rename(clip.parent.with_name("moved"))
    assert ClipFiles.of(moved / clip.name).digest != files.digest


def test_what_is_wrong_with_a_clip_names_its_own_path(clip):
    clip.with_suffix(".yaml").write_text("track: clip.csv\nscenario: ramp\nfps: 0\nobjects: []")
    with pytest.raises(InputError) as error:
        measure_files(ClipFiles.of(clip).packed())
    assert str(error.value).startswith(f"{clip.with_suffix('.yaml')}: fps")


def test_files_in_another_folder_travel_along(clip):
    yaml_path = clip.with_suffix(".yaml")
    below = clip.parent / "below"
    below.mkdir()
    content = yaml.safe_load(yaml_path.read_text()) | {"track": "../clip.csv"}
    (below / "other.yaml").write_text(yaml.safe_dump(content))
    packed = ClipFiles.of(below / "other.yaml").packed()
    assert set(packed.content) == {"below/other.yaml", "clip.csv"}
    assert measure_files(packed).measurement.name == "other"


def test_a_failure_is_kept_until_there_is_a_result(tmp_path):
    store = Store(tmp_path)
    failure = Failure("bug", "ValueError: no", "Traceback ...")
    store.save_failure("a", failure)
    assert store.failure("a") == failure
    store.save_result("a", CellResult({"k1": float("nan")}))
    assert store.failure("a") is None
    assert store.result("a") == {"k1": None}


def test_two_sweeps_do_not_share_a_folder(tmp_path):
    with (
        Store(tmp_path).locked(),
        pytest.raises(InputError, match="another sweep is running there"),
        Store(tmp_path).locked(),
    ):
        pass
    with Store(tmp_path).locked():
        pass
    write_text(tmp_path / "file", "")
    with pytest.raises(InputError, match="is a file"), Store(tmp_path / "file").locked():
        pass


def test_what_a_kill_left_is_cleared_away(tmp_path):
    left = [tmp_path / "cells" / "a" / ".result.x1.json", tmp_path / "clips" / ".1.x2.npz"]
    for path in (*left, kept := tmp_path / "cells" / "a" / "result.json"):
        write_text(path, "{}")
    with Store(tmp_path).locked():
        assert not any(path.exists() for path in left)
        assert kept.exists()


def test_a_clip_of_physics_101_travels_with_its_folders(tmp_path):
    """Its folders and a table of labels declare it; only its own labels count."""
    video = tmp_path / "scenarios" / "ramp" / "20_01" / "c_block_01" / "03" / "Camera_1.mp4"
    video.parent.mkdir(parents=True)
    video.write_bytes(b"no video")
    labels = tmp_path / "scenarios" / "labels.yaml"
    labels.write_text("clips:\n  ramp/20_01/c_block_01/03: {fps: 30.0}\n")
    files = ClipFiles.of(video)
    assert files.name == "20_01-c_block_01-03"
    assert set(files.packed().content) == {"ramp/20_01/c_block_01/03/Camera_1.mp4", "labels.yaml"}
    with pytest.raises(InputError, match=str(tmp_path)):
        measure_files(files.packed())
    labels.write_text(labels.read_text() + "  ramp/10_01: {fps: 60.0}\n")
    assert ClipFiles.of(video).digest == files.digest
    labels.write_text("clips:\n  ramp/20_01/c_block_01/03: {fps: 60.0}\n")
    assert ClipFiles.of(video).digest != files.digest
