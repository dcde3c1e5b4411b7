"""How honest k1 is where the ramp was drawn by eye: `python benchmarks/marks.py [--clips 40]`.

Simulated tracks of ramps at random angles. Of each the ramp, a known length and the foot are
drawn with `label`, every click off by a normal error of half a pixel per coordinate, and the
track is as this scale and foot make it. The errors of k1 in units of its standard deviation must
have rms 1: z, and beside it z of the same fit with angle and scale taken as exact. The last line
is JSON.
"""

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import tables

import galileo_jax as gx
from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.clip.track_csv import read_observation_csv, write_observation_csv
from galileo_jax.commands import command

ANGLES_DEG, BASES_PX = (10.0, 30.0), (100.0, 400.0)
BAR = (0.8, 1.2)


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    tables.row("seed", ("angle", "k1", "error", "z", "z if exact"))
    errors, zs, exact = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(call.seed, call.seed + call.clips):
            track, truth = drawn_clip(Path(folder), seed)
            found = gx.fit(track, seed=seed).parameters["k1"]
            take_as_exact(track)
            taken = gx.fit(track, seed=seed).parameters["k1"]
            errors.append(found["mean"] - truth["k1"])
            zs.append(errors[-1] / found["sd"])
            exact.append((taken["mean"] - truth["k1"]) / taken["sd"])
            row = (truth["ramp_angle_deg_true"], truth["k1"], errors[-1], zs[-1], exact[-1])
            tables.row(str(seed), row)
    rms = {name: float(np.sqrt(np.mean(np.square(z)))) for name, z in (("z", zs), ("exact", exact))}
    inside = float(np.mean(np.abs(zs) < 1.96))
    print(f"rms of z {rms['z']:.2f} (as exact: {rms['exact']:.2f}); {inside:.0%} in 95 %")
    is_missed = not BAR[0] <= rms["z"] <= BAR[1]
    tables.finish("marks", {"clips": call.clips, "rms": rms, "inside": inside, "missed": is_missed})
    return None


def drawn_clip(folder: Path, seed: int) -> tuple[Path, dict]:
    """A track as a drawn scale and foot make it, its yaml as `label` writes it; and the truth."""
    random = np.random.default_rng([seed, 16])
    path = folder / f"drawn{seed}.csv"
    made = gx.simulate(path, seed=seed, track_only=True, angle=float(random.uniform(*ANGLES_DEG)))
    (truth,) = made.truths
    angle, scale = math.radians(truth["ramp_angle_deg_true"]), truth["pixels_per_metre_true"]
    foot = np.array(truth["world_to_image"])[:2, 2]

    def clicked(*points: np.ndarray) -> list[float]:
        return [float(v) for v in np.ravel(points) + random.normal(0, CLICK_SD_PX, 2 * len(points))]

    uphill = np.array([-math.cos(angle), -math.sin(angle)])
    ramp = clicked(foot + random.uniform(*BASES_PX) * uphill, foot)
    base_px = random.uniform(*BASES_PX)
    ends = clicked(foot, foot + np.array([base_px, 0.0]))
    origin = clicked(foot)
    clip = gx.label(path, ramp=ramp, scale=[*ends, base_px / scale], origin=origin).clip
    assert clip.pixels_per_metre is not None
    seen = read_observation_csv(path)
    ratio = scale / clip.pixels_per_metre
    shift = (np.array(origin) - foot) * [-1, 1] / clip.pixels_per_metre
    position = seen.position_m * ratio + shift[:, None]
    write_observation_csv(path, replace(seen, position_m=position))
    return path, truth


def take_as_exact(track: Path) -> None:
    """Declares angle, scale and foot to be known exactly."""
    gx.label(track, ramp_angle_sd=0.0, pixels_per_metre_sd=0.0, origin_sd=0.0)


def _parser() -> argparse.ArgumentParser:
    parser = command.Parser(prog="benchmarks/marks.py", description=__doc__)
    parser.add_argument("--clips", type=command.whole_number(1), default=40)
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
