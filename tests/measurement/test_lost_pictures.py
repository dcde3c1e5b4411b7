"""A film whose lost pictures nobody counted, and one that is whole."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from tests.tracking.moving_box import Box, film
from tests.video.make_video import write_film

pytestmark = pytest.mark.video

T = np.arange(40) / 60
YAML = (
    "video: a.mp4\nscenario: flight\nfps: 60\npixels_per_metre: 100\n"
    "objects: [{name: object1, shape: box, point_px: [30, 100]}]\n"
)


@pytest.mark.parametrize("lost", [(), (9, 10, 22)])
def test_the_time_of_lost_pictures_is_put_back_and_said(lost, tmp_path: Path) -> None:
    kept = np.delete(np.arange(40), lost)
    path = np.stack([30 + 250 * T, 100 - 250 * T + 381.5 * T**2, 0 * T], axis=1)[kept]
    write_film(tmp_path / "a.mp4", film([(Box((16, 16)), path)]), fps=60, options={"crf": "10"})
    (tmp_path / "a.yaml").write_text(YAML)
    found = measure(load_clip(tmp_path / "a.yaml"))
    np.testing.assert_allclose(found.observation.times_s, T[kept], atol=1e-4)
    said = [line for line in found.remarks if "missing after" in line]
    assert bool(said) == bool(lost)
    assert not lost or "missing after rows 8 (2), 19," in said[0]
