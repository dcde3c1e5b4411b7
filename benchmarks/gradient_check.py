"""Is the Jacobian right at the posterior's scale? `python benchmarks/gradient_check.py`.

At random truths in which object 2 is hit (0.3 px of noise at 900 px/m, 30 fps):

    || J - J_fd || / || J_fd ||    over all frames and both objects,

J: d(centres)/d(parameter) as inference has it, from the custom_jvp of `problem.predict` at the
steps that a fit ends with. J_fd: central differences of plain rollouts at 1/4, 1/2, 1 and 2 sd
of the posterior (model error included); the bars are for 1/2 sd. J is a central difference
itself, so that the other columns say more: how much the answer depends on the scale.
`--mjx N`: for N sets also MJX's exact forward derivative through the contacts. The last line
is JSON.
"""

import argparse
import time
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
import synthetic_tracks
import tables

from galileo_jax import command, jax_cache
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.model_error import add_model_error
from galileo_jax.inference.problem import Problem
from galileo_jax.parameters import inverse

NOISE_M = 0.3 / 900
PARAMETERS = ("k1", "k2", "m1", "m2")
SCALES_SD = (0.25, 0.5, 1.0, 2.0)
NUM_DRAWS = 4000
NUM_ROUNDS = 3  # the fit polishes at least twice before its last Jacobian
BARS = {"median": 0.05, "worst": 0.20}


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    jax_cache.enable()
    used, exact = [], []
    tables.row("set", [f"{name} {scale:g}sd" for name in PARAMETERS for scale in SCALES_SD])
    for seed in range(call.seed, call.seed + call.num):
        case = synthetic_tracks.make_case(seed, "engine", NOISE_M, call.engine)
        z = _true_z(case)
        steps, sd = _scales(case.problem, z)
        differences = _differences(case.problem, z, sd)
        jacobian = _jacobian(case.problem, z, steps)
        used.append(_relative(jacobian, differences))
        tables.row(str(seed), list(used[-1].reshape(-1)))
        if len(exact) < call.mjx:
            began = time.perf_counter()
            exact.append(_relative(_mjx_jacobian(case.problem, z), differences))
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
    parameters = case.problem.model.parameters
    theta = np.array([case.values.get(p.name, p.absent) for p in parameters])
    return np.clip(np.asarray(inverse(parameters, jnp.asarray(theta))), -2.5, 2.5)


def _scales(problem: Problem, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The steps of the last Jacobian of a fit that ends at z, and the posterior's sd, in z."""
    fitter = GradientFitter(problem)
    steps, identity = problem.coarse_steps, np.eye(len(z))
    for _ in range(NUM_ROUNDS):
        push = jax.vmap(
            lambda t, h: jax.jvp(lambda x: problem.residuals(x, 1.0, h), (z,), (t,))[1], (0, None)
        )
        jacobian = np.asarray(push(identity, steps)).T
        before, covariance = steps, np.linalg.inv(jacobian.T @ jacobian + identity)
        steps = fitter._half_sd(covariance)
    normal = np.random.default_rng(0).standard_normal((NUM_DRAWS, len(z)))
    around = z + normal @ np.linalg.cholesky(covariance).T
    theta = problem.theta(np.pad(around, [(0, 0), (0, 1)]))
    draws = add_model_error(theta, problem.names, 0)[:, :-1]
    sd = np.asarray(inverse(problem.model.parameters, jnp.asarray(draws))).std(axis=0)
    return before, sd


def _where(problem: Problem) -> list[int]:
    return [problem.names.index(name) for name in PARAMETERS]


def _jacobian(problem: Problem, z: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """d(centres)/dz `[parameter, value]` by the custom_jvp that inference uses."""
    tangents = np.eye(len(z))[_where(problem)]
    push = jax.vmap(
        lambda t: jax.jvp(lambda x: problem.predict(x, jnp.asarray(steps)), (z,), (t,))[1]
    )
    return np.asarray(push(tangents)).reshape(len(PARAMETERS), -1)


def _differences(problem: Problem, z: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Central differences `[scale, parameter, value]` from plain rollouts."""
    where = _where(problem)
    table = []
    for scale in SCALES_SD:
        h = scale * sd[where]
        offsets = np.zeros((len(where), len(z)))
        offsets[np.arange(len(where)), where] = h
        seen = np.asarray(
            jax.vmap(lambda x: problem.predict(x, jnp.asarray(problem.coarse_steps)))(
                np.concatenate([z + offsets, z - offsets])
            )
        ).reshape(2, len(where), -1)
        table.append((seen[0] - seen[1]) / (2 * h)[:, None])
    return np.array(table)


def _mjx_jacobian(problem: Problem, z: np.ndarray) -> np.ndarray:
    """The exact derivative of the MJX program, contacts included, by forward mode."""
    from galileo_jax.parameters import forward
    from galileo_jax.rollout.engine_mjx import EngineMJX
    from galileo_jax.rollout.trajectory import Trajectory

    model = problem.model
    engine = EngineMJX(model)
    times = jnp.arange(model.num_records + 1) * model.record_dt_s

    def centres(x: jax.Array) -> jax.Array:
        position, velocity = engine.rollout(forward(model.parameters, x))
        return problem.measure(x, Trajectory(times, position, velocity, position[:, 0]))

    tangents = np.eye(len(z))[_where(problem)]
    push = jax.jit(jax.vmap(lambda t: jax.jvp(centres, (jnp.asarray(z),), (t,))[1]))
    return np.asarray(push(tangents)).reshape(len(PARAMETERS), -1)


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
    parser.add_argument("--engine", default="auto", help="c, mjx or auto")
    parser.add_argument("--mjx", type=int, default=0, help="sets for MJX's exact derivative: slow")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
