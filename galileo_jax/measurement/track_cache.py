"""Tracks by content: what was tracked once is read again in milliseconds.

A track is found by a hash of the video's bytes, of what the clip's yaml says that tracking looks
at, and of the code that tracks. It lies with JAX's compiled programs (`GALILEO_JAX_CACHE`).
"""

import contextlib
import functools
import hashlib
import json
from importlib.metadata import version
from pathlib import Path

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.jax_setup import cache_folder
from galileo_jax.tracking.track import Track

FOLDER = "tracks"
ROOMS = ("clip", "observation", "tracking", "video")  # whose code decides what a track is
LIBRARIES = ("av", "numpy", "opencv-python-headless", "scipy")
# Of the yaml: what is declared about the picture and the objects in it.
KEYS = {
    *("scenario", "fps", "ramp_angle_deg", "direction"),
    *("pixels_per_metre", "rectangle", "lens", "origin_px"),
}
OBJECT_KEYS = {
    *("name", "shape", "size_m", "point_px"),
    *("rolls", "first_frame", "last_frame", "corrections"),
}


def track_once(clip: Clip) -> Track:
    """The clip's track, read from the cache where it was tracked before.

    Raises:
      InputError: as `tracking.clip.track_clip`.
    """
    from galileo_jax.tracking.clip import track_clip  # and OpenCV: a csv track needs neither

    path = _path(clip)
    if path is None:
        return track_clip(clip)
    if (found := _read(path)) is not None:
        return found
    track = track_clip(clip)
    # A cache that cannot be written is no reason to stop.
    with contextlib.suppress(OSError), replacing(path) as temporary:
        np.savez(temporary, allow_pickle=False, **vars(track))
    return track


def is_tracked(clip: Clip) -> bool:
    """Whether the clip's track is in the cache."""
    path = _path(clip)
    return path is not None and path.is_file()


def _path(clip: Clip) -> Path | None:
    """Where the clip's track is kept; None: nowhere."""
    folder = cache_folder()
    if folder is None or clip.video is None:
        return None
    declared = clip.model_dump(mode="json", include=KEYS)
    declared["objects"] = [
        item.model_dump(mode="json", include=OBJECT_KEYS) for item in clip.objects
    ]
    found = hashlib.sha256(json.dumps([_code(), declared], sort_keys=True).encode())
    with clip.video.open("rb") as file:
        while block := file.read(1 << 20):
            found.update(block)
    return folder / FOLDER / f"{found.hexdigest()[:40]}.npz"


def _read(path: Path) -> Track | None:
    try:
        with np.load(path, allow_pickle=False) as found:
            arrays = {name: found[name] for name in found.files}
        names = tuple(str(name) for name in arrays.pop("names"))
        width, height = (int(side) for side in arrays.pop("frame_size_px"))
        return Track(names=names, frame_size_px=(width, height), **arrays)
    except Exception:  # not there, or damaged, which raises anything: it is made again
        return None


@functools.cache
def _code() -> str:
    """Hash of all code that decides what a track is."""
    package = Path(__file__).parents[1]
    found = hashlib.sha256()
    for name in LIBRARIES:
        found.update(f"{name} {version(name)}".encode())
    for room in ROOMS:
        for path in sorted((package / room).rglob("*.py")):
            found.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()
