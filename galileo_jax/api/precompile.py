"""What one core can do while another tracks the video: import, and build the programs.

Programs are built for a clip that looks as the tracked one will: as many frames, as many objects,
the same laws. Where it turns out otherwise (sizes that were null), only time is lost.
"""

import contextlib
import threading
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.jax_setup import set_up

if TYPE_CHECKING:
    from galileo_jax.inference.fits.gradient import GradientFitter

START_M, APART_M, SD_M = -0.3, 0.3, 1e-4  # on the ramp; between objects; of the track

Build = Callable[[Sequence[Clip], Sequence[Observation]], "GradientFitter"]


def work_ahead(clips: Sequence[Clip], build: Build | None) -> threading.Thread:
    """Starts to import and to compile; to be joined before anything is fitted.

    Args:
      clips: of the call.
      build: makes what will fit them, of clips and observations; None: nothing is compiled.
    """

    def work() -> None:
        set_up()
        for name in ("galileo_jax.inference.fits.gradient", "galileo_jax.results.run"):
            import_module(name)
        # What is wrong is told when it is done in earnest.
        with contextlib.suppress(Exception):
            if build is not None:
                _compile(clips, build)
            for name in ("galileo_jax.report.fit_page", "matplotlib.figure", "xarray"):
                import_module(name)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def _compile(clips: Sequence[Clip], build: Build) -> None:
    filmed = [clip for clip in clips if clip.video is not None]
    if filmed and all(SCENARIOS[clip.scenario].has_table for clip in filmed):
        build(filmed, [_likely(clip) for clip in filmed]).compile()


def _likely(clip: Clip) -> Observation:
    """Object 1 on the ramp and the others on the table, all at rest."""
    count, frames = len(clip.objects), clip.frame_count
    position = np.zeros((count, 2, frames))
    position[:, 0] = (START_M + APART_M * np.arange(count) + APART_M * (np.arange(count) > 0))[
        :, None
    ]
    return Observation(
        names=tuple(item.name for item in clip.objects),
        times_s=np.arange(frames) / clip.fps,
        position_m=position,
        covariance_m2=np.tile(SD_M**2 * np.eye(2)[:, :, None], (count, 1, 1, frames)),
        mask=np.ones((count, frames), bool),
    )
