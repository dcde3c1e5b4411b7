"""What chains save that start from the network: `python benchmarks/chain_starts.py CLIP...`.

Metropolis-Hastings on real tracks (give csv tracks with their yaml: nothing is tracked twice), from

    grad      the multi-start gradient fit; its covariance is the first proposal (--init grad)
    cnn       the network: one fit from its middle, chains at its draws (--init cnn)
    network   the network alone: chains at its draws, nuisances at prior draws; their covariance
              is the first proposal
    prior     prior draws, and the prior's covariance

Reported: rollouts before the chains, and evaluations by eight chains until R-hat of k1, k2 and the
mass ratio is below 1.01 (nothing is asked of the effective sample size). The last line is JSON.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import tables

from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.density import density_of
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.metropolis import NUM_CHAINS, metropolis_posterior
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.samplers import sample
from galileo_jax.inference.samplers.driver import Settings
from galileo_jax.inference.samplers.library.mixture import Mixture
from galileo_jax.measurement.measure import measure
from galileo_jax.model.parameters import inverse
from galileo_jax.neural.estimate import cnn_posterior
from galileo_jax.neural.start import start_from_network
from galileo_jax.runtime import compilation_cache

STARTS = ("grad", "cnn", "network", "prior")
TO_RHAT = Settings(max_steps=1500, min_ess=0.0)


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    tables.row("clip, start", ("before", "chains", "all", "converged", "acceptance"))
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in STARTS}
    for path in call.clips:
        clip = load_clip(path)
        trials = make_joint_problem([clip], [measure(clip).observation])
        for name in call.starts.split(","):
            before, posterior = _run(name, trials, call.seed)
            chains = posterior.stats["num_evaluations"]
            entry = {
                "before": before,
                "chains": chains,
                "all": before + chains,
                "converged": posterior.is_converged,
                "acceptance": posterior.stats["acceptance_rate"],
            }
            found[name].append(entry)
            tables.row(f"{clip.path.stem[:20]}, {name}", list(entry.values()))
    print()
    tables.row("median", ("before", "chains", "all", "converged"))
    figures = {}
    for name, entries in found.items():
        if entries:
            columns = {
                key: [entry[key] for entry in entries] for key in ("before", "chains", "all")
            }
            figures[name] = {key: float(np.median(values)) for key, values in columns.items()}
            figures[name]["converged"] = float(np.mean([entry["converged"] for entry in entries]))
            tables.row(name, list(figures[name].values()))
    tables.finish("chain_starts", {"clips": len(call.clips), **figures})
    return None


def _run(name: str, trials: JointProblem, seed: int) -> tuple[float, Posterior]:
    """Rollouts before the chains, and the chains."""
    if name == "grad":
        fit = GradientFitter(trials).fit(seed)
        return fit.stats["num_rollouts"], _from(trials, fit, None, seed)
    if name == "cnn":
        start = start_from_network(trials, seed, NUM_CHAINS)
        return start.fit.stats["num_rollouts"], _from(trials, start.fit, start.z, seed)
    generator = np.random.default_rng(seed)
    z = generator.standard_normal((4000, len(trials.names)))
    if name == "network":
        draws = cnn_posterior(trials, seed)[0].flat()
        z = np.asarray(inverse(trials.parameters, jnp.asarray(draws)))
    sampler = Mixture.from_gaussian(jnp.asarray(z.mean(0)), jnp.asarray(np.cov(z.T)))
    m1, k1, m2, k2 = (trials.names.index(column) for column in ("m1", "k1", "m2", "k2"))

    def monitor(draws: np.ndarray) -> dict[str, np.ndarray]:
        ratio = draws[..., m1] - draws[..., m2]
        return {"k1": draws[..., k1], "k2": draws[..., k2], "mass_ratio": ratio}

    posterior = sample(
        jax.random.key(seed),
        sampler,
        density_of(trials),
        jnp.asarray(z[generator.choice(len(z), NUM_CHAINS)]),
        trials.names,
        settings=TO_RHAT,
        monitor=monitor,
    )
    return 0, posterior


def _from(
    trials: JointProblem, fit: GradientFit, starts: np.ndarray | None, seed: int
) -> Posterior:
    return metropolis_posterior(trials, fit, seed, settings=TO_RHAT, starts=starts)


def _parser() -> command.Parser:
    parser = command.Parser(prog="chain_starts.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("clips", type=Path, nargs="+", metavar="CLIP")
    parser.add_argument("--starts", default=",".join(STARTS))
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
