"""A track: where each object was in every frame, in pixels, with an error."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.clip.track_csv import write_columns


@dataclass(frozen=True)
class Track:
    """Pixel positions of the objects in every frame: the only thing that tracking hands on."""

    names: tuple[str, ...]  # the objects' names, in the clip's order
    times_s: Float[np.ndarray, " frame"]  # seconds since the first frame
    # x right and y down; the point followed is the one the clip declares (`point_px`), or the
    # object's centre when it declares none; NaN where not visible
    position_px: Float[np.ndarray, "object frame 2"]
    covariance_px2: Float[np.ndarray, "object frame 2 2"]  # the error's of each point
    # how much of that is one error of the object's first frame, which all its points have in common
    # and which turns with it; 0 where pieces follow each other; if only some have it, a shift of
    # these against the others
    common_px2: Float[np.ndarray, "object frame 2 2"]
    # errors that follow each other: by how much a coder may shift what moves beside what was taken
    # off; each pattern has a size of its own, about standard normal, that wanders
    # (`motion_compensation.LASTS_FRAMES`)
    shifts_px: Float[np.ndarray, "object frame pattern 2"]
    # rotation in the image since the first frame, clockwise positive (x right, y down)
    angle_rad: Float[np.ndarray, "object frame"]
    is_visible: Bool[np.ndarray, "object frame"]  # False where it is hidden or was lost
    frame_size_px: tuple[int, int]  # (width, height)


def write_pixel_csv(path: Path, track: Track) -> None:
    """Writes `time_s`, then per object place, its error and angle; empty cell = not visible.

    Columns of `NAME`: `NAME_x_px, NAME_y_px` (x right, y down), `NAME_sd_x_px, NAME_sd_y_px`,
    `NAME_correlation` (of the two errors) and `NAME_angle_deg` (since the first frame,
    clockwise).
    """
    columns = {"time_s": track.times_s}
    for k, name in enumerate(track.names):
        sd = np.sqrt(np.einsum("fii->fi", track.covariance_px2[k]))
        fields = {
            "x_px": track.position_px[k, :, 0],
            "y_px": track.position_px[k, :, 1],
            "sd_x_px": sd[:, 0],
            "sd_y_px": sd[:, 1],
            "correlation": track.covariance_px2[k, :, 0, 1] / sd.prod(axis=1),
            "angle_deg": np.degrees(track.angle_rad[k]),
        }
        for field, values in fields.items():
            columns[f"{name}_{field}"] = np.where(track.is_visible[k], values, np.nan)
    write_columns(path, columns, "{:.8g}".format)
