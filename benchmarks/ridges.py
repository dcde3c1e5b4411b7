"""The evidence and width of a posterior that bends much: `python benchmarks/ridges.py --num 8`.

Tracks with a drag hidden, linear in the speed, are fitted with a drag that grows with any power of
it (`drag_of_a_power`): the power, the drag and friction make up for each other. What draws round
the fit say (`inference/fits/weighed.py`), with and without its part along the ridge
(`fits/ridge.py`), is compared with a sum over powers that are held at one value each, at which the
posterior does not bend. Evidence in nats over Laplace's; the last line is JSON.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar
from unittest.mock import patch

import numpy as np
import tables
from scipy.interpolate import CubicSpline

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.diagnosis.mended_evidence import mended
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits import weighed as weighed_module
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.fits.weighed import Weighed, weighed
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.forms.drag_of_a_power import DragOfAPower
from galileo_jax.model.parameters import Parameter, Uniform
from galileo_jax.runtime import compilation_cache
from galileo_jax.runtime.precision import in_float64

ANGLES_DEG, NOISES_M, STRENGTHS = (8.0, 30.0), (0.1e-3, 0.4e-3), (0.3, 1.0)
LOW, HIGH = 0.25, 3.0  # the form's prior of the power
POWERS = np.arange(0.3, 3.0, 0.1)
NARROW = 0.01
GIVES_UP_NATS = 12.0  # below the best of the powers: beyond, nothing counts
COLUMNS = ("blind", "weighed", "sum", "sd blind", "sd weighed", "sd sum")


class OnePower(DragOfAPower):
    """The same drag with its power all but known."""

    value: ClassVar[float] = 1.0

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The drag at the usual speed, and the power."""
        size, power = super().parameters(scene)
        near = Uniform(self.value - NARROW, self.value + NARROW)
        return size, Parameter(power.name, "1", near, self.value, "effect", 0.1)


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    compilation_cache.enable()
    tables.row("track", COLUMNS)
    rows = []
    for seed in range(call.seed, call.seed + call.num):
        rows.append(examine(seed))
        tables.row(str(seed), rows[-1])
    found = np.array(rows)
    off, width = found[:, :2] - found[:, 2:3], found[:, 3:5] / found[:, 5:6]
    figures = {
        "num": call.num,
        "seed": call.seed,
        "rms_nats": np.sqrt(np.mean(off**2, axis=0)).tolist(),
        "worst_nats": np.abs(off).max(axis=0).tolist(),
        "median_width": np.median(width, axis=0).tolist(),
        "narrowest": width.min(axis=0).tolist(),
    }
    for name, value in figures.items():
        tables.row(name, value if isinstance(value, list) else [value])
    tables.finish("ridges", figures)
    return None


@in_float64
def examine(seed: int) -> list[float]:
    """A row of the table."""
    with tempfile.TemporaryDirectory() as folder:
        path = simulated(Path(folder) / f"track_{seed}.csv", seed)
        trials, fit = fitted(path, DragOfAPower())
        with patch.object(weighed_module, "bent_direction", lambda valley: None):
            blind = _weighed(trials, fit, seed)
        seen = _weighed(trials, fit, seed)
        total, sd = by_sum(path, seed)
    evidences = [blind.log_evidence, seen.log_evidence, total]
    over = [each - fit.log_evidence for each in evidences]
    return [*over, power_sd(trials, blind), power_sd(trials, seen), sd]


def simulated(path: Path, seed: int) -> Path:
    """The yaml of a track; the same seed, the same track."""
    rng = np.random.default_rng([seed, 67])
    simulate(
        path,
        track_only=True,
        solver="fine",
        faults=True,
        seed=int(rng.integers(2**31)),
        angle=float(rng.uniform(*ANGLES_DEG)),
        track_noise=float(rng.uniform(*NOISES_M)),
        effects={"viscous_drag": {}},
        strength=float(rng.uniform(*STRENGTHS)),
    )
    return path.with_suffix(".yaml")


def fitted(path: Path, form: DragOfAPower) -> tuple[JointProblem, GradientFit]:
    """The trials with this form, and their fit."""
    clip = load_clip(path)
    trials = make_joint_problem([clip], [measure(clip).observation], effects=(form,))
    return trials, GradientFitter(trials).fit(0, effects=(form.name,))


def by_sum(path: Path, seed: int) -> tuple[float, float]:
    """Evidence and the power's standard deviation, from fits at one power each."""
    log_evidence = np.full(len(POWERS), -np.inf)
    for i in np.argsort(np.abs(POWERS - 1.0)):
        if log_evidence[max(i - 1, 0) : i + 2].max() < log_evidence.max() - GIVES_UP_NATS:
            continue  # its neighbours, looked at before, count for nothing
        form = type("AtOne", (OnePower,), {"value": float(POWERS[i])})()
        log_evidence[i] = _weighed(*fitted(path, form), seed).log_evidence
    known = np.isfinite(log_evidence)
    fine = np.linspace(LOW, HIGH, 2001)
    log_density = CubicSpline(POWERS[known], log_evidence[known])(fine)
    is_between = (fine >= POWERS[known][0]) & (fine <= POWERS[known][-1])
    log_density = np.where(is_between, log_density, -np.inf)
    density = np.exp(log_density - log_density.max())
    total = log_density.max() + np.log(density.mean())
    density /= density.sum()
    return float(total), float(np.sqrt(density @ (fine - density @ fine) ** 2))


def power_sd(trials: JointProblem, found: Weighed) -> float:
    """Of the power, by weighed draws."""
    free = np.ones(found.z.shape[1], bool)
    power = trials.theta(found.z, free)[:, trials.names.index("drag_of_a_power_power")]
    weights = np.exp(found.log_weights - found.log_weights.max())
    weights /= weights.sum()
    return float(np.sqrt(weights @ (power - weights @ power) ** 2))


def _weighed(trials: JointProblem, fit: GradientFit, seed: int) -> Weighed:
    """As a diagnosis does it; where it would leave Laplace's, what it has all the same."""
    fitter = GradientFitter(trials)
    best, found = mended(fitter, (fit, *fit.beside), seed, None)
    return found or weighed((best,), fitter.residuals, seed)


def _parser() -> argparse.ArgumentParser:
    parser = command.Parser(prog="ridges.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=command.whole_number(1), default=8, help="tracks")
    parser.add_argument("--seed", type=command.whole_number(0), default=0, help="of the first")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
