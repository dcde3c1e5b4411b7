"""Is the Jacobian right at the posterior's scale? `python benchmarks/gradient_check.py`.

At random truths in which object 2 is hit (0.3 px of noise at 900 px/m, 30 fps):

    || J - J_fd || / || J_fd ||    over all frames and both objects,

J: d(centres)/d(parameter), JAX's forward derivative of the rigid engine. J_fd: central
differences of plain rollouts at 1/4, 1/2, 1 and 2 sd of the posterior (normal, by J itself);
the bars are for 1/2 sd. What is left at 2 sd is curvature, and frames between which an impact
moves: a difference sees both sides of it. `--mjx N`: for N sets also MJX's exact forward
derivative through its contacts, against the same differences; `--mended`: with the two lines of
its solver put right that make it NaN (`mjx_mended.py`). The last line is JSON.
"""

import argparse
import time
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import mjx_mended
import numpy as np
import synthetic_tracks
import tables

from galileo_jax.commands import command
from galileo_jax.inference.problem import Problem, seen
from galileo_jax.model.parameters import forward, inverse
from galileo_jax.rollout.engine_mjx import EngineMJX
from galileo_jax.rollout.trajectory import Trajectory
from galileo_jax.runtime import compilation_cache

NOISE_M = 0.3 / 900
PARAMETERS = ("k1", "k2", "m1", "m2")
SCALES_SD = (0.25, 0.5, 1.0, 2.0)
BARS = {"median": 0.05, "worst": 0.20}

Predict = Callable[[jax.Array], jax.Array]


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    if call.mended:
        mjx_mended.mend()
    compilation_cache.enable()
    used, exact = [], []
    tables.row("set", [f"{name} {scale:g}sd" for name in PARAMETERS for scale in SCALES_SD])
    for seed in range(call.seed, call.seed + call.num):
        case = synthetic_tracks.make_case(seed, "engine", NOISE_M, "rigid")
        z, problem = _true_z(case), case.problem
        predict = _prediction(problem)
        jacobian = _jacobian(predict, z)
        differences = _differences(problem, z, _posterior_sd(problem, jacobian))
        where = [problem.model.index(name) for name in PARAMETERS]
        used.append(_relative(jacobian[where], differences))
        tables.row(str(seed), list(used[-1].reshape(-1)))
        if len(exact) < call.mjx:
            began = time.perf_counter()
            through_contacts = _jacobian(jax.jit(_prediction_in_mjx(problem)), z)
            exact.append(_relative(through_contacts[where], differences))
            took = f"{time.perf_counter() - began:.0f} s"
            tables.row(f"{seed} MJX jacfwd, {took}", list(exact[-1].reshape(-1)))
    errors = np.array(used)
    figures, missed = {}, []
    for what, value in (("median", np.median(errors, 0)), ("worst", errors.max(0))):
        tables.row(what, list(value.reshape(-1)))
        figures[what] = _named(value)
        for name, got in zip(PARAMETERS, value[:, SCALES_SD.index(0.5)], strict=True):
            if not got <= BARS[what]:
                missed.append(f"{name} {what} {got:.3g} > {BARS[what]:g}")
    print("bars missed: " + ("; ".join(missed) or "none"))
    figures |= {"sets": call.num, "bars_missed": missed}
    if exact:
        figures["mjx_jacfwd_worst"] = _named(np.max(exact, axis=0))
        figures["mjx_jacfwd_median"] = _named(np.median(exact, axis=0))
    tables.finish("gradient_check", figures)
    return None


def _true_z(case: synthetic_tracks.Case) -> np.ndarray:
    """The truth in z; the nuisances where they are absent, but inside their priors."""
    parameters = case.problem.parameters
    theta = np.array([case.values.get(p.name, p.absent) for p in parameters])
    return np.clip(np.asarray(inverse(parameters, jnp.asarray(theta))), -2.5, 2.5)


def _prediction(problem: Problem) -> Predict:
    """What the camera would see, of z."""
    return lambda z: problem.predict(forward(problem.parameters, z))


def _prediction_in_mjx(problem: Problem) -> Predict:
    """The same through MJX."""
    model = problem.model
    engine = EngineMJX(model)
    times = jnp.arange(model.num_records + 1) * model.record_dt_s
    frames = jnp.asarray(problem.observation.times_s)
    effects = model.effects + model.nuisances

    def predict(z: jax.Array) -> jax.Array:
        theta = forward(model.parameters, z)
        position, velocity = engine.rollout(theta)
        motion = Trajectory(times, position, velocity)
        return seen(effects, model.names, theta, motion, frames, model.scene.surroundings)

    return predict


def _jacobian(predict: Predict, z: np.ndarray) -> np.ndarray:
    """d(centres)/dz `[parameter, value]`."""
    slopes = jax.jacfwd(predict)(jnp.asarray(z))
    return np.moveaxis(np.asarray(slopes), -1, 0).reshape(len(z), -1)


def _posterior_sd(problem: Problem, jacobian: np.ndarray) -> np.ndarray:
    """Of every parameter, in z, where the truth is the best fit and the noise is as declared."""
    seen = problem.data.observed_m
    slopes = problem.whiten(seen - jacobian.reshape(-1, *seen.shape), 1.0)
    covariance = np.linalg.inv(slopes @ slopes.T + np.eye(len(slopes)))
    return np.sqrt(np.diag(covariance))


def _differences(problem: Problem, z: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Central differences `[scale, parameter, value]` from plain rollouts."""
    where = [problem.model.index(name) for name in PARAMETERS]
    table = []
    for scale in SCALES_SD:
        h = scale * sd[where]
        offsets = np.zeros((len(where), len(z)))
        offsets[np.arange(len(where)), where] = h
        both = jnp.asarray(np.concatenate([z + offsets, z - offsets]))
        there = problem.simulate_batch(np.asarray(forward(problem.parameters, both)))
        there = there.reshape(2, len(where), -1)
        table.append((there[0] - there[1]) / (2 * h)[:, None])
    return np.array(table)


def _relative(jacobian: np.ndarray, differences: np.ndarray) -> np.ndarray:
    """Relative differences `[parameter, scale]`."""
    gap = np.linalg.norm(jacobian - differences, axis=-1)
    return (gap / np.linalg.norm(differences, axis=-1)).T


def _named(values: np.ndarray) -> dict[str, dict[str, float]]:
    return {
        name: {f"{scale:g}_sd": float(v) for scale, v in zip(SCALES_SD, row, strict=True)}
        for name, row in zip(PARAMETERS, values, strict=True)
    }


def _parser() -> command.Parser:
    parser = command.Parser(prog="gradient_check.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=int, default=32, help="parameter sets")
    parser.add_argument("--seed", type=int, default=0, help="the first set's seed")
    parser.add_argument("--mjx", type=int, default=0, help="sets for MJX's exact derivative: slow")
    parser.add_argument("--mended", action="store_true", help="MJX with finite derivatives")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
