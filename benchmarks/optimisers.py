"""Which optimiser finds the fit? `python benchmarks/optimisers.py [--quick]`.

The same scenes and the same starts for all: 64 scattered parameter vectors, of which the best
four are refined. Scenes: drawn ramp experiments (0.33 mm of noise), and clips in which a hidden
`stribeck` friction nearly holds object 1, so that its fit lies in a narrow, curved valley.

- batches of rollouts: the package (`inference/fits/descent.py`): optimistix's trust region
  and damped steps, slopes by differences.
- its own loop: optimistix's `LevenbergMarquardt` (and `Dogleg`), slopes by forward mode through
  the rigid engine, all starts in one vmapped program. First at the search's noise, then three times
  at the fitted noise.
- whole `fit`: `GradientFitter.fit`, with its choice of the best start and its variants.

Costs are -log(posterior density), at the noise scale that suits each end best. An end is *found*
within 0.5 nats of the least cost that any method reached in that scene (also from the truth); it
is in a *side valley* where a Gauss-Newton step promises less than 0.5 nats and it is not found.
Seconds are of the processor, without compilation. A slope by forward mode counts as a rollout.
`taskset -c 0` keeps all of it on one core. Prints a markdown table.
"""

import argparse
import functools
import json
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import synthetic_tracks
from scipy.optimize import minimize_scalar

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.commands import command
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.density import Part, Rolled, parts_of
from galileo_jax.inference.fits.fitted_clip import FittedClip
from galileo_jax.inference.fits.gradient import GradientFitter, Settings
from galileo_jax.inference.fits.programs import white_of
from galileo_jax.inference.fits.starts import absent_z, scattered_starts
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

NOISE_M = 0.3 / 900
NUM_SCATTERED, NUM_REFINED = 64, 4
FOUND_NATS = 0.5
NUM_NOISE_UPDATES, MAX_STEPS, TOLERANCE = 3, 100, 1e-4
VALLEY: dict[str, Any] = {
    "angle": 10.0,
    "effects": {"stribeck": {}},
    "solver": "fine",
    "faults": True,
    "track_only": True,
    "track_noise": 3.3e-4,
    "fps": 30.0,
}
STRENGTHS = (0.7, 0.65, 0.9)
FIRST_VALLEY_SEED = 157334244  # that of tests/diagnosis/test_narrow_valley.py


@dataclass(frozen=True)
class Scene:
    """One clip to be fitted.

    Attributes:
      name: unique.
      trials: the clip.
      starts: `[start, model parameter]`, z.
      truth: `[model parameter]`, z; what the truth does not say is where it is absent.
    """

    name: str
    trials: JointProblem
    starts: np.ndarray
    truth: np.ndarray

    @classmethod
    def of(cls, name: str, trials: JointProblem, values: dict[str, float]) -> "Scene":
        """Scatters starts and chooses the best."""
        count = len(trials.model_parameters)
        free = np.ones(count, bool)
        scattered = scattered_starts(trials, free, NUM_SCATTERED, seed=0)
        costs = GradientFitter(trials).search_costs(scattered, free)
        truth = absent_z(trials).copy()
        for i, parameter in enumerate(trials.model_parameters):
            if parameter.name in values:
                truth[i] = parameter.prior.inverse(jnp.asarray(values[parameter.name]))
        return cls(name, trials, scattered[np.argsort(costs)[:NUM_REFINED]], truth)


class Ends(NamedTuple):
    """Where a method stopped, `[start, model parameter]`, and rollouts it took."""

    z: np.ndarray
    num_rollouts: int


Method = Callable[[JointProblem, np.ndarray], Ends]


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    ramps, valleys = (3, 1) if call.quick else (call.ramps, call.valleys)
    print("| | starts found | in a side valley | scenes found | CPU, s per scene "
          "| rollouts per scene | compilation, s |\n|---|---|---|---|---|---|---|")  # fmt: skip
    for name, scenes in (("ramp", ramp_scenes(ramps)), ("valley", valley_scenes(valleys))):
        _compare(name, list(scenes), METHODS)
    return None


def ramp_scenes(num: int) -> Iterator[Scene]:
    """Random experiments in which object 2 is hit."""
    for seed in range(num):
        case = synthetic_tracks.make_case(seed, "exact", NOISE_M)
        yield Scene.of(f"ramp {seed}", case.trials, case.values)


def valley_scenes(num: int) -> Iterator[Scene]:
    """Clips with a hidden `stribeck`, the first that of the test."""
    for i in range(num):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "clip.csv"
            seed, strength = FIRST_VALLEY_SEED + i, STRENGTHS[i % 3]
            simulate(path, seed=seed, strength=strength, **VALLEY)
            clip, observation = load_clip(path.with_suffix(".yaml")), read_observation_csv(path)
            truth = json.loads(path.with_suffix(".truth.json").read_text())
        trials = make_joint_problem([clip], [observation], effects=make_effects(["stribeck"]))
        yield Scene.of(f"stribeck {i}", trials, truth | truth["effect_parameters"])


def package(trials: JointProblem, starts: np.ndarray) -> Ends:
    """The package's descent, each start by itself."""
    fitter = GradientFitter(trials)
    free = np.ones(starts.shape, bool)
    fits = fitter.fit_from(starts, free, np.arange(len(starts)))
    z = np.stack([fit.z[: starts.shape[1]] for fit in fits])
    return Ends(z, int(fits[0].stats["num_rollouts"]))


def whole_fit(trials: JointProblem, starts: np.ndarray) -> Ends:
    """All of `GradientFitter.fit`: it scatters the same starts itself."""
    fit = GradientFitter(trials).fit(0)
    return Ends(fit.z[None, : starts.shape[1]], int(fit.stats["num_rollouts"]))


def with_optimistix(trials: JointProblem, starts: np.ndarray, solver: str) -> Ends:
    """optimistix, see the module."""
    rolled, data = _parts(trials)
    clips = [part.clip for part in data]
    noise = np.tile([FittedClip.of(trials, c).search_noise(Settings().search_sd_m)
                     for c in range(len(clips))], (len(starts), 1))  # fmt: skip
    z, total = jnp.asarray(starts), 0
    for _ in range(1 + NUM_NOISE_UPDATES):
        z, steps = _solve(solver, rolled, z, noise, data)
        total += int(np.max(steps)) * len(starts) * (1 + starts.shape[1])
        noise = _fitted_noise(trials, np.asarray(z))
    return Ends(np.asarray(z), total)


SOLVERS = {
    "LevenbergMarquardt": optx.LevenbergMarquardt(TOLERANCE, TOLERANCE),
    "Dogleg": optx.Dogleg(TOLERANCE, TOLERANCE),
}


def _parts(trials: JointProblem) -> tuple[tuple[Rolled, ...], tuple[Part, ...]]:
    found = parts_of(trials)
    assert found is not None  # the engine is the rigid one
    return found


def _residuals(rolled: tuple[Rolled, ...], z: jax.Array, noise: jax.Array, data: Any) -> jax.Array:
    """Whitened residuals of all clips, and z, the prior's."""
    rows = [z]
    for c, (part, own) in enumerate(zip(rolled, data, strict=True)):
        clip, kind = own.clip, part.kind
        theta = clip.priors.forward(z[clip.column])
        position, velocity = part.roll_out(
            kind.effects, kind.names, part.num_records, kind.record_dt_s, theta, clip.scene
        )
        is_over = jnp.arange(part.num_records) > own.last_record
        end = jnp.take(position, own.last_record, axis=-1)[..., None]
        position, velocity = jnp.where(is_over, end, position), jnp.where(is_over, 0.0, velocity)
        rows.append(white_of(kind, theta, position, velocity, noise[c], clip.data, clip.scene))
    return jnp.concatenate(rows)


@functools.partial(jax.jit, static_argnums=(0, 1))
def _solve(name: str, rolled: tuple[Rolled, ...], z: Any, noise: Any, data: Any):
    """Ends `[start, model parameter]` and numbers of steps `[start]`."""

    # The trust region transposes slopes; the rollout's loop has a forward mode alone.
    @jax.custom_jvp
    def residuals(z: jax.Array, noise: jax.Array) -> jax.Array:
        return _residuals(rolled, z, noise, data)

    @residuals.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        def twice(z: jax.Array) -> tuple[jax.Array, jax.Array]:
            value = _residuals(rolled, z, primals[1], data)
            return value, value

        jacobian, value = jax.jacfwd(twice, has_aux=True)(primals[0])
        return value, jacobian @ tangents[0]

    def one(z: jax.Array, noise: jax.Array) -> tuple[jax.Array, jax.Array]:
        found = optx.least_squares(
            residuals, SOLVERS[name], z, noise, max_steps=MAX_STEPS, throw=False
        )
        return found.value, found.stats["num_steps"]

    return jax.vmap(one)(z, noise)


@functools.partial(jax.jit, static_argnums=0)
def _promised(rolled: tuple[Rolled, ...], z: jax.Array, noise: jax.Array, data: Any) -> jax.Array:
    """What a Gauss-Newton step would lower the cost by, were all linear, `[point]`, nats."""

    def one(z: jax.Array, noise: jax.Array) -> jax.Array:
        jacobian = jax.jacfwd(lambda z: _residuals(rolled, z, noise, data))(z)
        slope = jacobian.T @ _residuals(rolled, z, noise, data)
        return 0.5 * slope @ jnp.linalg.solve(jacobian.T @ jacobian, slope)

    return jax.vmap(one)(z, noise)


def _fitted_noise(trials: JointProblem, z: np.ndarray) -> np.ndarray:
    """Noise scales `[point, clip]` of the greatest density."""
    return np.exp(NOISE_SD * _noise_and_costs(trials, z)[0])


def _noise_and_costs(trials: JointProblem, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The best noise scales in z `[point, clip]`, and -log(density) with them `[point]`."""
    theta = np.asarray(trials.theta(np.pad(z, [(0, 0), (0, len(trials.problems))])))
    noise, costs = np.zeros((len(z), len(trials.problems))), 0.5 * np.sum(z**2, axis=1)
    for c, problem in enumerate(trials.problems):
        difference = problem.data.observed_m - problem.simulate_batch(trials.of_clip(theta, c))
        for i, one in enumerate(difference):

            def cost(noise_z: float, one=one, data=problem.data) -> float:
                scale = np.exp(NOISE_SD * noise_z)
                white = np.asarray(GaussianLikelihood.whiten(one, scale, data))
                determinant = float(GaussianLikelihood.log_determinant(scale, data))
                return 0.5 * (float(np.sum(white**2)) + determinant + noise_z**2)

            best = minimize_scalar(cost, bounds=(-5.0, 25.0), method="bounded")
            noise[i, c] = best.x  # pyright: ignore[reportAttributeAccessIssue]
            costs[i] += best.fun  # pyright: ignore[reportAttributeAccessIssue]
    return noise, np.where(np.isfinite(costs), costs, np.inf)


METHODS: dict[str, Method] = {
    "batches of rollouts": package,
    "its own loop": functools.partial(with_optimistix, solver="LevenbergMarquardt"),
    "its Dogleg": functools.partial(with_optimistix, solver="Dogleg"),
    "whole `fit`": whole_fit,
}


@dataclass
class _Count:
    """Sums over the scenes of one method."""

    costs: list[np.ndarray]
    promised: list[np.ndarray]
    cpu_s: float = 0.0
    compile_s: float = 0.0
    rollouts: int = 0


def _compare(name: str, scenes: Sequence[Scene], methods: dict[str, Method]) -> None:
    counts = {method: _Count([], []) for method in methods}
    least = np.full(len(scenes), np.inf)
    for s, scene in enumerate(scenes):
        for method, run in methods.items():
            first = time.process_time()
            run(scene.trials, scene.starts)
            begin = time.process_time()
            ends = run(scene.trials, scene.starts)
            took, count = time.process_time() - begin, counts[method]
            count.cpu_s += took
            count.compile_s += begin - first - took
            count.rollouts += ends.num_rollouts
            noise, costs = _noise_and_costs(scene.trials, ends.z)
            rolled, data = _parts(scene.trials)
            promised = _promised(rolled, jnp.asarray(ends.z), np.exp(NOISE_SD * noise), data)
            count.costs.append(costs)
            count.promised.append(np.asarray(promised))
            least[s] = min(least[s], costs.min())
        from_truth = package(scene.trials, np.tile(scene.truth, (NUM_REFINED, 1)))
        least[s] = min(least[s], _noise_and_costs(scene.trials, from_truth.z)[1].min())
    for method, count in counts.items():
        behind = [own - best for own, best in zip(count.costs, least, strict=True)]
        flat = np.concatenate(behind)
        found = flat < FOUND_NATS
        side = ~found & (np.concatenate(count.promised) < FOUND_NATS)
        scenes_found = sum(own.min() < FOUND_NATS for own in behind)
        num = len(scenes)
        print(f"| {name}: {method} | {found.sum()} of {len(flat)} | {side.sum()} "
              f"| {scenes_found} of {num} | {count.cpu_s / num:.2f} | {count.rollouts / num:.0f} "
              f"| {count.compile_s:.0f} |", flush=True)  # fmt: skip


def _parser() -> command.Parser:
    parser = command.Parser(prog="optimisers.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--ramps", type=int, default=30, help="drawn ramp scenes")
    parser.add_argument("--valleys", type=int, default=9, help="clips with a hidden stribeck")
    parser.add_argument("--quick", action="store_true", help="three ramps and one valley")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
