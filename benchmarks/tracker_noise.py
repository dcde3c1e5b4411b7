"""Do the tracker's errors follow each other in time? `python benchmarks/tracker_noise.py --num 12`.

Renders random clips (`rendered_clips.py`), every second one with faults, tracks them, and takes the
errors apart by what the object does: in units of what the fit is told, less their mean in each
stretch, at rest without what the fit is told that they have in common; two frames about the foot
and the hit are left out. Mean square, and correlation from one frame to the next five. The last
line is JSON.
"""

import argparse
import json
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import rendered_clips
import tables
from tracking import true_points

from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.measurement.noise_at_rest import with_noise_at_rest
from galileo_jax.measurement.track_cache import track_once
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.to_metres import observe

LAGS = range(1, 6)
MOVES_PX = 0.02  # a frame
NEAR_FRAMES, SETTLES_FRAMES, FEWEST = 2, 4, 8
SORTS = (rendered_clips.IDEAL, rendered_clips.FAULTY)


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    stretches: dict[str, list[np.ndarray]] = defaultdict(list)
    for seed in range(call.seed, call.seed + call.num):
        with tempfile.TemporaryDirectory() as folder:
            made = rendered_clips.render(Path(folder), SORTS[seed % 2], seed)
            for name, errors in errors_of(made.clips[0]):
                stretches[name].append(errors)
    tables.row("errors", ("values", "square", *(f"lag {lag}" for lag in LAGS)))
    figures = {}
    for name, parts in sorted(stretches.items()):
        parts = [part - part.mean() for part in parts if len(part) >= FEWEST]
        if parts:
            figures[name] = scatter(parts)
            tables.row(name, list(figures[name].values()))
    tables.finish("tracker_noise", figures | {"num": call.num, "seed": call.seed})
    return None


def errors_of(path: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Errors over stated errors of one clip, by what the object does meanwhile."""
    clip, record = load_clip(path), json.loads(path.with_suffix(".truth.json").read_text())
    pixels = track_once(clip)
    seen = observe(clip, pixels)
    quiet = with_noise_at_rest(seen)
    events = [record["events_s"][name] for name in ("foot", "hit")]
    events = [time * clip.fps for time in events if time]
    for i in range(len(pixels.names)):
        true = true_points(clip, record, i)[: len(pixels.times_s)]
        frames = np.arange(len(true))
        stated = np.sqrt(np.einsum("fii->fi", pixels.covariance_px2[i, : len(true)]))
        z = (pixels.position_px[i, : len(true)] - true) / stated
        visible = pixels.is_visible[i, : len(true)]
        moves = np.hypot(*np.gradient(true, axis=0).T) > MOVES_PX
        near = np.any([abs(frames - event) < NEAR_FRAMES for event in events], axis=0)
        part = np.searchsorted(events, frames)
        first, last = frames[moves][[0, -1]] if moves.any() else (len(true), len(true))
        for axis, name in enumerate("xy"):
            for number in range(len(events) + 1):
                own = moves & visible & ~near & (part == number)
                where = "ramp" if number == 0 else "table"
                yield f"moving {name}, object {i + 1}, {where}", z[own, axis]
            still = ~moves & visible
            error_m = z[:, axis] * np.sqrt(seen.covariance_m2[i, axis, axis, : len(true)])
            for name, own in (
                ("rest before", still & (frames < first)),
                ("rest after", still & (frames > last + SETTLES_FRAMES)),
            ):
                yield f"{name}, object {i + 1}", _independent(error_m, quiet, i, axis, own)


def _independent(
    error_m: np.ndarray, seen: Observation, index: int, axis: int, own: np.ndarray
) -> np.ndarray:
    """Errors of a rest, `[frame]`, as independent ones of unit size, if they are as stated."""
    where = np.flatnonzero(own)
    if len(where) < FEWEST:
        return np.empty(0)
    cover = np.diag(seen.covariance_m2[index, axis, axis, where])
    if seen.num_errors and seen.modes_m is not None:
        modes = seen.modes_m[-seen.num_errors :, index, axis][:, where]
        cover = cover + modes.T @ modes
    return np.linalg.solve(np.linalg.cholesky(cover), error_m[where] - error_m[where].mean())


def scatter(parts: Sequence[np.ndarray]) -> dict[str, float]:
    """Number of values, mean square and correlations of stretches without their means."""
    square = sum(float((part**2).sum()) for part in parts)
    count = sum(len(part) for part in parts)
    found: dict[str, float] = {"values": count, "square": square / (count - len(parts))}
    for lag in LAGS:
        products = (
            float(part[lag:] @ part[:-lag]) * len(part) / (len(part) - lag) for part in parts
        )
        found[f"lag {lag}"] = sum(products) / square
    return found


def _parser() -> command.Parser:
    parser = command.Parser(prog="tracker_noise.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=command.whole_number(1), default=12, help="clips")
    parser.add_argument("--seed", type=command.whole_number(0), default=0, help="of the first")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
