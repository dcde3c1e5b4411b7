"""The neural estimator on a clip: from an observation to draws of all parameters, in no search."""

import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.model.effects.effect import infers_gravity
from galileo_jax.model.effects.nuisances.declared import DeclaredAngle, DeclaredScale
from galileo_jax.model.model import MASS_PRIOR
from galileo_jax.model.parameters import inverse
from galileo_jax.neural.checkpoint import load_network
from galileo_jax.neural.galileo_task import Estimates, estimate
from galileo_jax.neural.posterior_network import PosteriorNetwork
from galileo_jax.neural.seen import Seen, see
from galileo_jax.neural.summary import DECLARED, Summary, summarise
from galileo_jax.runtime.batching import one_at_a_time
from galileo_jax.runtime.errors import InputError
from galileo_jax.similarity.discrepancy import SCALE_SD

TRAINED = Path(__file__).parent / "trained" / "galileo.npz"
NUM_DRAWS = 4000
LARGEST_MISFIT = 7.0  # of 5,744 clips of world.py 6 have more than 5.4, and none more than 6.6


@functools.cache
def trained_network(path: Path = TRAINED) -> PosteriorNetwork:
    """The network that ships with the package, or another of preset `galileo`.

    Raises:
      InputError: not such a network.
    """
    network, config = load_network(path)
    if config.preset != "galileo":
        raise InputError(f"{path}: a network of preset {config.preset}; one of galileo expected")
    return network


def cnn_posterior(trials: JointProblem, seed: int) -> tuple[Posterior, np.ndarray, dict[str, Any]]:
    """Draws of the posterior of k1, k2 and the mass ratio; of all else, of the prior.

    The network is marginal over the nuisances; their draws are prior draws, independent of
    the rest. It takes angle and scale as declared; how well these are known is added to what it
    says of the frictions.

    Returns:
      the posterior; `[parameter]`, its middle in z; notes for result.json (`status`, `cnn`,
      and `warnings` where the clip is unlike the training clips).

    Raises:
      InputError: several clips or effects, not the ramp scene, or no scale.
    """
    problem, *others = trials.problems
    if others:
        raise InputError("--method cnn: one clip expected; use --method grad for joint fits")
    scene = problem.model.scene.surroundings
    if not scene.is_scale_known:
        raise InputError("--method cnn: pixels_per_metre is needed; use --method grad")
    if problem.model.effects:
        raise InputError("--method cnn: its network knows no effects; use --method grad")
    if infers_gravity(problem.model.nuisances):
        raise InputError("--method cnn: its network takes gravity as declared; use --method grad")
    network = trained_network()
    seen = see(problem.observation, scene, is_filmed=problem.noise == "camera")
    summary = one_at_a_time(_summarise)(seen)
    found = _estimate(network, seen, summary, seed)
    theta = _complete(trials, found, seed)
    is_main = np.array([parameter.role == "main" for parameter in trials.parameters])
    middle = np.where(is_main, inverse(trials.parameters, theta.mean(0)), 0.0)
    notes: dict[str, Any] = {"status": "read off by the network"}
    if complaint := _complaint(network, summary):
        notes["status"] += "; see the warning"
        notes["warnings"] = [
            f"this clip is unlike those that the network was trained on ({complaint}): do not "
            "trust its intervals; use --method grad"
        ]
    posterior = Posterior(
        names=trials.names,
        draws=theta[None],
        log_density=np.zeros((1, len(theta))),
        status=Status.FIXED_LENGTH if complaint else Status.CONVERGED,
        stats={"rollouts": 0.0},
        provenance={"method": "cnn", "seed": seed},
    )
    return posterior, middle, notes


_summarise = jax.jit(summarise)


def _complaint(network: PosteriorNetwork, summary: Summary) -> str:
    """In what a clip is unlike all training clips; empty where it is not.

    It sees clips beyond the trained range, motion on the ramp that constant forces do not
    explain, and whole pictures that do not occur. A hidden effect that merely looks like
    other friction is not seen: that is what `diagnose` is for.
    """
    if not bool(summary.moves):
        return ""  # the network is not asked
    features = summary.features.astype(jnp.float32)
    places = np.flatnonzero(np.asarray(network.outside(features)))
    if places.size:
        declared = [DECLARED[place] for place in places.tolist() if place in DECLARED]
        return f"{', '.join(declared) or 'its motion'} out of their range"
    if (misfit := float(summary.misfit)) > LARGEST_MISFIT:
        return (
            f"on the ramp object 1 is not evenly accelerated: {misfit:.0f} times what noise and "
            f"camera explain, and none of the training clips is above {LARGEST_MISFIT:.0f}"
        )
    distance, usual = float(network.distance(features)), float(network.usual_distance[...])
    if distance > usual:
        return f"distance {distance:.2f}, 999 in 1000 are below {usual:.2f}"
    return ""


def _estimate(network: PosteriorNetwork, seen: Seen, summary: Summary, seed: int) -> Estimates:
    """Draws `[draw]` of the three numbers that a clip can tell."""
    single = {
        "features": summary.features.astype(jnp.float32)[None],
        "profile": summary.profile.astype(jnp.float32)[None],
        "centre": summary.centre[None],
        "scale": summary.scale[None],
        "is_hit": np.asarray(summary.is_hit)[None],
        "is_ideal": np.asarray(seen.is_ideal)[None],
    }
    k1, ratio, k2 = (values[0] for values in estimate(network, single, seed, NUM_DRAWS))
    if not bool(summary.moves):
        # Friction holds it: anything from the ramp's slope upwards.
        steepest = min(math.tan(float(seen.angle_rad)), 1.0)
        k1 = np.random.default_rng([seed, 6]).uniform(steepest, 1.0, len(k1))
    return Estimates(k1, ratio, k2)


def _complete(trials: JointProblem, found: Estimates, seed: int) -> np.ndarray:
    """Draws of all parameters `[draw, parameter]`, in their units."""
    generator = np.random.default_rng([seed, 7])
    count = len(found.k1)
    z = generator.standard_normal((count, len(trials.names)))
    theta = trials.theta(z).copy()
    # The ratio shows, the product does not: of two log-normal masses they are independent.
    log_product = 2 * math.log(MASS_PRIOR.median) + math.sqrt(2) * MASS_PRIOR.sd * z[:, 0]
    k1, k2 = _with_declared_errors(trials, found, theta, generator)
    known: Mapping[str, np.ndarray] = {
        "k1": k1,
        "k2": k2,
        "m1": np.exp(0.5 * (log_product + np.log(found.mass_ratio))),
        "m2": np.exp(0.5 * (log_product - np.log(found.mass_ratio))),
    }
    is_single = "m2" not in trials.names
    for name, values in known.items():
        if name in trials.names and not (is_single and name == "m1"):
            theta[:, trials.names.index(name)] = values
    return theta


def _with_declared_errors(
    trials: JointProblem, found: Estimates, theta: np.ndarray, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draws of k1 and k2 with the errors of angle and scale, to first order.

    k1 = tan a - acceleration / (g cos a) and k2 = deceleration / g, of a ramp steeper by da and
    of lengths measured too long by a share s:

        dk1 = (1 + k1 tan a) da + (tan a - k1) s,    dk2 = -k2 s

    Stated errors are drawn in `theta`; of a scale of which nothing is said, here.
    """
    columns = {name: theta[:, i] for i, name in enumerate(trials.names)}
    zero = np.zeros(len(theta))
    steeper = columns.get(DeclaredAngle.name, zero)
    longer = columns.get(DeclaredScale.name, zero)
    (problem,) = trials.problems
    scene = problem.model.scene.surroundings
    if problem.noise == "camera" and not scene.is_scale_stated:
        longer = longer + SCALE_SD * generator.standard_normal(len(theta))
    slope = math.tan(scene.angle_rad)
    k1 = found.k1 + (1 + found.k1 * slope) * steeper + (slope - found.k1) * longer
    return np.maximum(k1, 0.0), found.k2 * (1 - longer)
