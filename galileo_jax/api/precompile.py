"""Imports JAX and compiles programs on one core while another core measures the clips.

Programs are compiled for a clip with the expected number of frames, objects and laws. If what is
measured differs (for example because sizes were null), they are compiled again and only time is
lost.
"""

import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module

import jax
import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_file import read_track
from galileo_jax.observation.observation import Observation

START_M, APART_M, SD_M = -0.3, 0.3, 1e-4  # on the ramp; between objects; of the track
NEEDED_LATER = ("galileo_jax.report.fit_page", "h5netcdf")

Compile = Callable[[Sequence[Clip], Sequence[Observation]], object]


@contextlib.contextmanager
def precompiling(clips: Sequence[Clip], compile_for: Compile | None) -> Iterator[None]:
    """Imports and compiles in a thread, which is waited for at the end.

    `compile_for` compiles what will fit clips and observations of these shapes; None: nothing is.
    """

    def work() -> None:
        # The real calls report what is wrong.
        with contextlib.suppress(Exception), jax.enable_x64(True):
            has_shapes = all(SCENARIOS[clip.scenario].has_table for clip in clips)
            if compile_for is not None and has_shapes:
                compile_for(clips, [_likely(clip) for clip in clips])
            for name in NEEDED_LATER:
                import_module(name)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    yield
    thread.join()


def _likely(clip: Clip) -> Observation:
    """The track, where it is one; else object 1 on the ramp and the others on the table at rest."""
    if clip.track is not None:
        return read_track(clip.path, clip.track, clip, clip.fps).observation
    count, frames = len(clip.objects), clip.frame_count
    number = np.arange(count)
    position = np.zeros((count, 2, frames))
    position[:, 0] = (START_M + APART_M * (number + (number > 0)))[:, None]
    return Observation(
        names=tuple(item.name for item in clip.objects),
        times_s=np.arange(frames) / clip.fps,
        position_m=position,
        covariance_m2=np.tile(SD_M**2 * np.eye(2)[:, :, None], (count, 1, 1, frames)),
        mask=np.ones((count, frames), bool),
    )
