"""A track in pixels as csv, one row per frame."""

import csv
import io
from pathlib import Path

import numpy as np

from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.tracking.track import Track


def write_pixel_csv(path: Path, track: Track) -> None:
    """Writes `time_s`, then per object place, its error and angle; empty cell = not visible.

    Columns of `NAME`: `NAME_x_px, NAME_y_px` (x right, y down), `NAME_sd_x_px, NAME_sd_y_px`,
    `NAME_correlation` (of the two errors) and `NAME_angle_deg` (since the first frame,
    clockwise).
    """
    header, columns = ["time_s"], [track.times_s]
    for k, name in enumerate(track.names):
        variance = np.einsum("fii->fi", track.covariance_px2[k])
        sd = np.sqrt(variance)
        correlation = track.covariance_px2[k, :, 0, 1] / sd.prod(axis=1)
        fields = {
            "x_px": track.position_px[k, :, 0],
            "y_px": track.position_px[k, :, 1],
            "sd_x_px": sd[:, 0],
            "sd_y_px": sd[:, 1],
            "correlation": correlation,
            "angle_deg": np.degrees(track.angle_rad[k]),
        }
        for field, values in fields.items():
            header.append(f"{name}_{field}")
            columns.append(np.where(track.is_visible[k], values, np.nan))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in zip(*columns, strict=True):
        writer.writerow([f"{v:.8g}" if np.isfinite(v) else "" for v in row])
    write_text(path, text.getvalue())
