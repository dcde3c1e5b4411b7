"""How well are clips with a known truth tracked?

    python -m benchmarks tracking FOLDER

For every clip and object of FOLDER (NAME.yaml with NAME.truth.json): RMS distance from the
truth in pixels, absolute and after taking out a constant offset; the normalised squared error
(1 is honest, above is too narrow) over all its frames, and over those in which it rests and
moves; the correlation of neighbouring frames' errors while it moves; the share of frames in which
it is visible, and lost (invisible though no hand is near). The followed point is the declared
one, or the centre without it (`--find`).
"""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import tables
from benchmarks.accuracy import clips_with_truth
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.clip import track_clip
from galileo_jax.tracking.track import Track

MOVES_PX = 0.02  # what goes farther than this from frame to frame moves
HAND_FRAMES = 10  # within which a hand that leaves object 1 is gone


class Row(NamedTuple):
    """One object of one clip; px, except `nse...`, the shares, and `seconds` (of the clip)."""

    clip: str
    object: str
    rms: float
    rms_shifted: float
    worst: float
    nse: float
    nse_resting: float
    nse_moving: float
    correlation: float
    visible: float
    lost: int
    seconds: float


def true_points(clip: Clip, truth: Mapping[str, Any], index: int) -> np.ndarray:
    """Where the followed point truly is, `[frame, 2]` px: rigid with the object's centre."""
    path = truth["trajectory"][f"object{index + 1}"]
    world = np.stack([path["y"], path["z"], np.ones(len(path["y"]))])
    image = np.array(truth["world_to_image"]) @ world
    centre = (image[:2] / image[2]).T
    point = clip.objects[index].point_px
    if point is None:
        return centre
    x, y = np.array(point) - centre[0]
    turn = -(np.array(path["pitch"]) - path["pitch"][0])  # the image's y points down
    c, s = np.cos(turn), np.sin(turn)
    return centre + np.stack([c * x - s * y, s * x + c * y], axis=1)


def rows_of(clip: Clip, truth: Mapping[str, Any], track: Track, seconds: float) -> list[Row]:
    rows = []
    for index, name in enumerate(track.names):
        expected = true_points(clip, truth, index)[: len(track.times_s)]
        error = track.position_px[index, : len(expected)] - expected
        seen = track.is_visible[index, : len(expected)]
        covered = HAND_FRAMES + hand["leave"] if (hand := truth.get("hand")) and index == 0 else 0
        error, covariance = error[seen], track.covariance_px2[index, : len(expected)][seen]
        step = np.linalg.norm(np.gradient(expected, axis=0), axis=1)[seen]
        shifted = error - error.mean(axis=0)
        squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) / 2
        moves = step > MOVES_PX
        moving = (error - np.median(error, axis=0))[moves]
        pairs = (moving[1:] * moving[:-1]).sum() / max((moving**2).sum(), 1e-12)
        rows.append(
            Row(
                clip.path.stem,
                name,
                float(np.sqrt((error**2).sum(axis=1).mean())),
                float(np.sqrt((shifted**2).sum(axis=1).mean())),
                float(np.abs(error).max()),
                float(squares.mean()),
                tables.mean(squares[~moves]),
                tables.mean(squares[moves]),
                float(pairs) if len(moving) > 4 else float("nan"),
                float(seen.mean()),
                int((~seen[covered:]).sum()),
                seconds,
            )
        )
    return rows


def main(folder: Path, *, find: bool = False) -> dict[str, Any]:
    rows: list[Row] = []
    failures: dict[str, str] = {}
    tables.row("clip", Row._fields[1:])
    for path, truth in clips_with_truth(folder, "", "all"):
        clip = load_clip(path)
        if find:
            blind = [item.model_copy(update={"point_px": None}) for item in clip.objects]
            clip = clip.model_copy(update={"objects": tuple(blind)})
        began = time.process_time()
        try:
            track = track_clip(clip)
        except InputError as error:
            failures[path.stem] = str(error)
            print(f"{path.stem:<28}  {error}")
            continue
        new = rows_of(clip, truth, track, time.process_time() - began)
        rows += new
        for row in new:
            tables.row(row.clip, row[1:])
    columns = {name: np.array([getattr(r, name) for r in rows]) for name in Row._fields[2:]}
    figures: dict[str, Any] = {}
    for name, values in columns.items():
        figures[f"{name}_mean"] = float(np.nanmean(values))
        figures[f"{name}_median"] = float(np.nanmedian(values))
        figures[f"{name}_worst"] = float(np.nanmax(values))
    figures["nse_within_half_to_two"] = float(np.mean(abs(np.log2(columns["nse"])) <= 1))
    tables.summary(figures)
    return figures | {"failures": failures}
