"""`track`: where a clip's objects were, in metres and seconds, with an error for every point."""

import itertools
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from galileo_jax.api.clips import ClipLike, as_clip, as_list
from galileo_jax.api.precompile import Compile, precompiling
from galileo_jax.clip.checks import check_same_objects, check_scale
from galileo_jax.clip.load import with_corrections
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.measurement.track_cache import track_once
from galileo_jax.observation.observation import Observation
from galileo_jax.report.draw import to_plotly
from galileo_jax.report.track_chart import track_chart
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError, one_line_of
from galileo_jax.runtime.lazy import go, pd
from galileo_jax.runtime.precision import in_float64
from galileo_jax.tracking.track import Track as PixelTrack
from galileo_jax.tracking.track import write_pixel_csv


@dataclass(frozen=True, eq=False)
class Track:
    """Where a clip's objects were, frame by frame.

    Attributes:
      clip: with what was inferred filled in (an angle, foot or size that was null).
      pixels: in the video, px; None where the clip is a track already.
      measurement: in metres; None where nobody knows the scale.
    """

    clip: Clip
    pixels: PixelTrack | None
    measurement: Measurement | None

    @property
    def name(self) -> str:
        """The clip's, without folder and suffix."""
        return self.clip.path.stem

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before the track is trusted, one line each."""
        return self.clip.warnings if self.measurement is None else self.measurement.warnings

    @property
    def observation(self) -> Observation:
        """In metres: `times_s [frame]`, `position_m [object, 2, frame]`, `covariance_m2`, `mask`.

        Raises:
          InputError: nobody knows the scale.
        """
        return self._measured().observation

    def to_dataframe(self) -> "pd.DataFrame":
        """One row per object and frame: `object, time_s, x_m, y_m, sd_x_m, sd_y_m, is_visible`.

        x along the travel, y up, origin at the foot of the ramp; NaN where it was not seen. Of a
        video also `x_px, y_px`; without a scale only these.
        """
        parts = []
        for k, item in enumerate(self.clip.objects):
            columns: dict[str, Any] = {"object": item.name}
            if self.measurement is not None:
                seen = self.measurement.whole
                columns |= {"time_s": seen.times_s}
                columns |= {f"{axis}_m": seen.position_m[k, i] for i, axis in enumerate("xy")}
                columns |= {f"sd_{axis}_m": seen.sd_m[k, i] for i, axis in enumerate("xy")}
                columns |= {"is_visible": seen.mask[k]}
            if (px := self.pixels) is not None:
                columns |= {"time_s": px.times_s}
                columns |= {f"{axis}_px": px.position_px[k, :, i] for i, axis in enumerate("xy")}
                columns.setdefault("is_visible", px.is_visible[k])
            parts.append(pd.DataFrame(columns))
        return pd.concat(parts, ignore_index=True)

    def plot(self) -> "go.Figure":
        """Positions and velocities over time, one panel per axis."""
        return to_plotly(track_chart(self.observation, self.name))

    def save(self, path: str | Path) -> Path:
        """Writes a csv that `load` reads again: in metres, or in pixels where no scale is known.

        Raises:
          InputError: the file cannot be written.
        """
        path = Path(path)
        with one_line_of(path):
            if self.measurement is not None:
                write_observation_csv(path, self.measurement.whole)
            else:
                assert self.pixels is not None  # a csv track in px needs its scale to load
                write_pixel_csv(path, self.pixels)
        return path

    def save_tables(self, folder: str | Path) -> tuple[Path, ...]:
        """Writes track_px.csv of a video and, where the scale in metres is known, track_m.csv."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        written: tuple[Path, ...] = ()
        if self.pixels is not None:
            written = (folder / "track_px.csv",)
            write_pixel_csv(written[0], self.pixels)
        if self.clip.pixels_per_metre is not None and not self.clip.is_scale_assumed:
            written += (self.save(folder / "track_m.csv"),)
        return written

    def save_overlay(self, folder: str | Path) -> tuple[Path, ...]:
        """Draws the paths over the video: `overlay.png` and `overlay.mp4` in `folder`.

        Raises:
          InputError: the clip is a track already, or the files cannot be written.
        """
        from galileo_jax.tracking.overlay import write_overlay_picture, write_overlay_video
        from galileo_jax.video import decode

        pixels, video = self.pixels, self.clip.video
        if pixels is None or video is None:
            raise InputError(f"{self.clip.path}: video: missing; a csv track is already tracked")
        picture, film = Path(folder) / "overlay.png", Path(folder) / "overlay.mp4"
        drawn = itertools.count(1)

        def advance() -> None:
            progress.report("drawing the overlay", next(drawn) / len(pixels.times_s))

        write_overlay_picture(picture, decode.frames(video), pixels)
        write_overlay_video(film, decode.frames(video), pixels, advance=advance)
        return picture, film

    def _measured(self) -> Measurement:
        if self.measurement is None:
            check_scale(self.clip)
            raise AssertionError("only a ramp without a scale is not measured")
        return self.measurement

    def __repr__(self) -> str:
        names = ", ".join(item.name for item in self.clip.objects)
        return f"<Track {self.name}: {names}, {self.clip.frame_count} frames>"

    def _repr_html_(self) -> str:
        return self.to_dataframe()._repr_html_()  # pyright: ignore


TrackLike = Track | ClipLike


def tracks_of(measured: Iterable[Measurement]) -> list[Track]:
    """The tracks of clips that were measured, for another call."""
    return [Track(one.clip, one.pixels, one) for one in measured]


@in_float64
def track(
    clip: ClipLike,
    *,
    pixels_per_metre: float | None = None,
    correct: Mapping[str, Sequence[Sequence[float]]] | None = None,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Track:
    """Follows the objects of a clip through its video, or reads its csv track.

    A video that was tracked before is not tracked again: tracks are cached by the content of the
    video and its yaml (`GALILEO_JAX_CACHE=off` switches that off).

    Args:
      clip: a clip, or what `load` takes.
      pixels_per_metre: overrides the clip's scale; None: the yaml's.
      correct: object name to (frame, x, y): where it is, px, in frames in which it was lost; it is
        followed on from there. Besides the yaml's `corrections`; (frame,) leaves one out.
      on_progress: called with the stage, the share done (0 to 1) and, while a video is followed,
        `{"frame": {"index": i, "places_px": {name: (x, y) or None}}}`.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: an object cannot be found or followed; the clip is wrong.
      Cancelled: `cancel` was set.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=1, track_only=True)
      >>> list(gx.track("slide.csv").to_dataframe().columns)
      ['object', 'time_s', 'x_m', 'y_m', 'sd_x_m', 'sd_y_m', 'is_visible']
    """
    with progress.scope(on_progress, cancel):
        clip = with_corrections(as_clip(clip, pixels_per_metre), correct or {})
        has_table = SCENARIOS[clip.scenario].has_table
        if has_table and not clip.is_scale_known and clip.video is not None:
            found = Track(clip, track_once(clip), None)
        else:
            (found,) = tracks_of([measure(clip)])
        progress.report("tracked", 1.0)
        return found


def as_measurements(
    tracks: TrackLike | Sequence[TrackLike],
    pixels_per_metre: float | None,
    compile_for: Compile | None = None,
) -> tuple[list[Measurement], float]:
    """The measurements of trials of the same objects, and how long tracking took, s.

    Args:
      tracks: one or several, or the clips, or their files, which are tracked.
      pixels_per_metre: overrides the clips' scale; None: the yaml's.
      compile_for: see `precompiling`, which goes on beside what is to be tracked.
    """
    given = as_list(tracks)
    clips = [
        as_clip(one.clip if isinstance(one, Track) else one, pixels_per_metre) for one in given
    ]
    for clip in clips:
        check_scale(clip)
    check_same_objects(clips)
    is_tracked = [isinstance(one, Track) and pixels_per_metre is None for one in given]
    if all(is_tracked):
        return [one._measured() for one in given], 0.0
    began = time.perf_counter()
    measured = []
    with precompiling(clips, compile_for):
        for i, clip in enumerate(clips):
            with progress.part(i / len(clips), (i + 1) / len(clips)):
                measured.append(given[i]._measured() if is_tracked[i] else measure(clip))
    return measured, time.perf_counter() - began
