"""`fit_tosses`: friction, restitution and size of a cube from how it falls, bounces and slides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax import __version__
from galileo_jax.api.clips import as_clip, as_list
from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.clip.schema import Clip
from galileo_jax.inference.toss.fit import TossSolution, fit_poses
from galileo_jax.inference.toss.predict import Ahead, predict_rest
from galileo_jax.inference.toss.residuals import COMMON, UNITS
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.precision import in_float64

NORMAL_95 = 1.959964
DOCUMENT = "tosses.json"
FITTED = 0.8  # share of the work, for progress
CUBE_WITHIN = 0.01  # edges that differ by more are no cube's


@dataclass(frozen=True, eq=False)
class TossFit:
    """What tosses of a cube say of it and of the table.

    Attributes:
      solution: parameters and their covariance, starts, residuals.
      ahead: how well the second half of each toss follows from its first; None: not asked for.
      document: tosses.json.
    """

    solution: TossSolution
    ahead: Ahead | None
    document: Mapping[str, Any]

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Any]]:
        """Name to `mean, sd, q025, q975, unit`."""
        return self.document["parameters"]

    def save(self, folder: str | Path) -> Path:
        """Writes tosses.json into `folder`."""
        folder = Path(folder)
        write_json(folder / DOCUMENT, self.document)
        return folder

    def __repr__(self) -> str:
        told = (f"{name} {one['mean']:.4g}" for name, one in self.parameters.items())
        return f"<TossFit of {len(self.solution.names)} tosses: {', '.join(told)}>"


@in_float64
def fit_tosses(
    clips: str | Path | Clip | Sequence[str | Path | Clip],
    *,
    window: float = 0.1,
    ahead: bool = False,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> TossFit:
    """Fits tosses of one cube together: scenario `toss`, poses beside a yaml.

    friction, restitution: of corners on the table. edge, gravity: in the track's own metres and
    seconds; that they differ from what a ruler says is news of the track. floor: how high the table
    is. rounding: radius of the cube's edges. inertia: over mass times edge squared (solid 1/6, thin
    shell 5/18).

    Each toss has a start of its own. Intervals come from how the tosses differ.

    Args:
      clips: each a csv of poses with its yaml, the yaml, or what `load` returned.
      window: how long after its first impact a toss is looked at, s, 0.02 to 0.2. Errors grow
        with every impact, and so does the time that a fit takes.
      ahead: predict the second half of each toss from its first, too.
      on_progress: called with the stage, the share done (0 to 1) and None.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: a clip is no toss of a cube of declared size, poses are no rotations, times go
        back, or nothing flies.
      Cancelled: `cancel` was set.
    """
    if not 0.02 <= window <= 0.2:
        raise InputError(f"window: {window:g} s is outside [0.02, 0.2]")
    given = as_list(clips, "clips: none given; one toss or more expected")
    loaded = [as_clip(one) for one in given]
    edges = [_edge_m(clip) for clip in loaded]
    for clip, edge in zip(loaded, edges, strict=True):
        if edge != edges[0]:
            raise InputError(
                f"{clip.path}: objects[0].size_m: {edge:g}, but {loaded[0].path}: {edges[0]:g}; "
                "tosses of the same cube expected"
            )
    tosses = []
    for clip in loaded:
        assert clip.track is not None  # a toss
        tosses.append(read_poses_csv(clip.track, clip.track_up, edges[0]))
    with progress.scope(on_progress, cancel):
        with progress.part(0.0, FITTED if ahead else 1.0):
            found = fit_poses(tosses, edges[0], loaded[0].gravity, window)
        with progress.part(FITTED, 1.0):
            rest = predict_rest(tosses, found.solution.common, edges[0]) if ahead else None
    return TossFit(found, rest, _document(found, rest, loaded, window))


def _edge_m(clip: Clip) -> float:
    thing = clip.objects[0]
    if clip.scenario != "toss" or clip.track is None:
        raise InputError(
            f"{clip.path}: scenario: {clip.scenario}; toss, with a csv track, expected"
        )
    key = f"{clip.path}: objects[0].size_m"
    if thing.shape != "box" or thing.size_m is None:
        raise InputError(f"{key}: a box of known size expected, [edge, edge, edge] in metres")
    if max(thing.size_m) > (1 + CUBE_WITHIN) * min(thing.size_m):
        raise InputError(f"{key}: {list(thing.size_m)}: three equal edges expected")
    return float(np.mean(thing.size_m))


def _document(
    found: TossSolution, rest: Ahead | None, clips: Sequence[Clip], window: float
) -> dict[str, Any]:
    sds = np.sqrt(np.diag(found.covariance))
    parameters = {
        name: {
            "mean": float(mean),
            "sd": float(sd),
            "q025": float(mean - NORMAL_95 * sd),
            "q975": float(mean + NORMAL_95 * sd),
            "unit": UNITS.get(name, "1"),
        }
        for name, mean, sd in zip(COMMON, found.mean, sds, strict=True)
    }
    document: dict[str, Any] = {
        "clips": [str(clip.path) for clip in clips],
        "used": list(found.names),
        "window_s": window,
        "converged": found.solution.has_converged,
        "parameters": parameters,
        "rms": dict(zip(found.names, map(float, found.rms), strict=True)),
        "version": __version__,
    }
    if rest is not None:
        document["second_half"] = {
            "place_over_edge": dict(zip(rest.names, map(float, rest.place), strict=True)),
            "turn_deg": dict(zip(rest.names, map(float, np.degrees(rest.turn_rad)), strict=True)),
            "median_place_over_edge": float(np.median(rest.place)),
            "median_turn_deg": float(np.degrees(np.median(rest.turn_rad))),
        }
    return document
