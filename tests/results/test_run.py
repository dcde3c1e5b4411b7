"""What a run takes for granted of its clip."""

from dataclasses import replace
from math import radians
from pathlib import Path

import pytest

from galileo_jax.assembly.build_problem import noise_of
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.runtime.errors import InputError
from tests.oracle_run import HIT as HIT_RUN
from tests.oracle_run import make_run
from tests.ramp_model import HIT, make_surroundings

SCENE = make_surroundings(HIT)
TRACK = Clip(
    path=Path("a.yaml"),
    track=Path("a.csv"),
    scenario="ramp",
    fps=30.0,
    ramp_angle_deg=20.0,
    objects=(ClipObject(name="object1", shape="box", size_m=(0.06, 0.06, 0.06)),),
    frame_count=30,
)
FALL = replace(SCENE, has_surface=False, angle_rad=radians(90))


@pytest.mark.parametrize(
    ("change", "scene", "noise"),
    [
        ({}, SCENE, "bodies"),
        ({"pixels_per_metre": 900.0}, SCENE, "camera"),
        ({"track": None, "video": Path("a.mp4")}, SCENE, "camera"),
        ({}, replace(SCENE, is_scale_known=False), "camera"),
        ({}, FALL, "camera"),
    ],
)
def test_metres_without_pixels_were_seen_by_no_camera(change, scene, noise):
    assert noise_of(TRACK.model_copy(update=change), scene) == noise


def test_a_run_of_an_earlier_version_is_refused_where_its_best_fit_is_asked_for(tmp_path):
    run = make_run(tmp_path, HIT_RUN, 1.0)
    assert run.best.shape == (len(run.posterior.names),)
    old = replace(run, posterior=replace(run.posterior, provenance={}))
    with pytest.raises(InputError, match=r"run: an earlier version wrote this run; fit"):
        _ = old.best
