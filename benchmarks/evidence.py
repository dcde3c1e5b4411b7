"""Is the evidence that ranks hypotheses right? `python benchmarks/evidence.py --out FILE`.

    laplace     what a diagnosis ranks by: the fit's, by Laplace (`inference/fits/evidence.py`)
    weighed     what it ranks the leading ones by: mended by a few rollouts (`fits/weighed.py`)
    far         a third opinion: 4 to 16 times as many draws, from a t 1.4 times as wide
    wide        adaptive tempered sequential Monte Carlo (`tempering.py`) from a normal distribution
                twice as wide as the fit's, two seeds; of as many hypotheses as `--wide` says, first
                where `far` and Laplace differ, none that a diagnosis leaves out of the race
    smc         the same from the prior, of as many as `--smc` says: knows nothing of the fit, but
                where seeds differ by more than a nat its particles lost the way

Tracks are drawn with one of the library's effects or none, at strengths from hardly visible to
full, with the small faults of real clips. Of each track four hypotheses are looked at: the hidden
effect (for none: a positive effect, which is then at the edge of its prior), one whose place or
speed makes a curved valley, and two drawn from all others. Same data, same priors; nats, up to the
data's constant, which is the same for all four figures. `k`, of the tail of the weights of `far`:
above 0.7 it is not to be relied on. CPU seconds are of the whole process. What is finished stays in
FILE and is not done again; the last line is JSON.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tables
from tempering import temper

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.commands import command
from galileo_jax.diagnosis.candidates import Hypothesis, fit_candidates
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.density import likelihood_of
from galileo_jax.inference.fits.gradient import OUT_OF_THE_RACE, GradientFitter
from galileo_jax.inference.fits.normal_matrix import symmetric_root
from galileo_jax.inference.fits.weighed import Weighed, weighed
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.samplers.sampler import LogDensity
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime import compilation_cache

CURVED = ("friction_patch", "magnetic_brake", "stribeck", "spring_tether")
POSITIVE = ("air_drag", "viscous_drag", "initial_push", "release_delay", "static_friction")
OTHERS = (
    "restitution",
    "ramp_angle",
    "constant_force",
    "surface_friction",
    "frame_rate",
    "rolling",
)
EFFECTS = (*CURVED, *POSITIVE, *OTHERS)
ANGLES_DEG, NOISES_M, STRENGTHS = (10.0, 28.0), (0.1e-3, 0.5e-3), (0.05, 1.0)
NO_EFFECT = 0.2  # share of the tracks
PER_TRACK, NUM_FAR, FAR_WIDTH = 4, 4096, 1.4
BAR_NATS = 1.0
RELIABLE_K = 0.7  # of the weights' tail: above, their mean is not to be relied on
COLUMNS = ("lead", "weighed", "far", "smc0", "smc1", "wide0", "wide1", "ess", "far_k", "wide0_s")
OVER_LAPLACE = COLUMNS[1:7]
WIDE = 2.0  # standard deviations of the fit


@dataclass(frozen=True)
class Track:
    """A drawn track.

    Attributes:
      hidden: its effect, or none.
      strength: of it, 0 to 1.
      looked_at: names of effects, each a hypothesis.
    """

    hidden: str
    strength: float
    looked_at: tuple[str, ...]
    clip: Clip
    observation: Observation


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    rows = _results(call.out)
    tables.row("hypothesis, over laplace", COLUMNS)
    for seed in range(call.first, call.first + call.num):
        if seed not in {row["seed"] for row in rows.values()}:
            for row in examine(seed):
                _keep(row, rows, call.out)
    worst = sorted(_in_race(rows.values()), key=lambda row: -abs(row["far"] - row["laplace"]))
    for i, row in enumerate(worst):
        asked = [way for way, num in (("wide", call.wide), ("smc", call.smc)) if i < num]
        ways = [f"{way}{seed}" for way in asked for seed in range(2)]
        if missing := [way for way in ways if way not in row]:
            _keep(smc(row, missing, call.particles), rows, call.out)
    tables.finish("evidence", summary(list(rows.values())))
    return None


def draw_track(seed: int) -> Track:
    """The same seed, the same track."""
    rng = np.random.default_rng([seed, 61])
    hidden = "none" if rng.random() < NO_EFFECT else str(rng.choice(EFFECTS))
    first = hidden if hidden != "none" else str(rng.choice(POSITIVE))
    names = [first, str(rng.choice([name for name in CURVED if name != first]))]
    rest = [name for name in EFFECTS if name not in names]
    names += [str(name) for name in rng.choice(rest, PER_TRACK - 2, replace=False)]
    strength = float(np.exp(rng.uniform(*np.log(STRENGTHS))))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"track_{seed}.csv"
        simulate(
            path,
            track_only=True,
            solver="fine",
            faults=True,
            seed=int(rng.integers(2**31)),
            angle=float(rng.uniform(*ANGLES_DEG)),
            track_noise=float(np.exp(rng.uniform(*np.log(NOISES_M)))),
            effects={} if hidden == "none" else {hidden: {}},
            strength=None if hidden == "none" else strength,
        )
        clip, observation = load_clip(path.with_suffix(".yaml")), read_observation_csv(path)
    return Track(hidden, strength, tuple(names), clip, observation)


def examine(seed: int) -> Iterator[dict[str, Any]]:
    """A row for each hypothesis of a track, without smc."""
    track = draw_track(seed)
    trials = trials_of(track, track.looked_at)
    fitter = GradientFitter(trials)
    base = Hypothesis((), fitter.fit(0, effects=()))
    sets = [(name,) for name in track.looked_at]
    began = time.process_time()
    found = fit_candidates(fitter, [base] * len(sets), sets, 0, every_one, needs_mending=every_one)
    print(f"# {len(sets)} fits: {time.process_time() - began:.1f} CPU s")
    for one in found:
        row: dict[str, Any] = {"seed": seed, "hidden": track.hidden, "strength": track.strength}
        row |= {"effect": one.effects[0], "code": one.fit.code.name}
        row |= {"lead": one.fit.log_evidence - base.fit.log_evidence}
        row |= {"laplace": one.fit.log_evidence, "weighed": None, "ess": None}
        if one.weighed:
            row |= {"weighed": one.weighed.log_evidence, "ess": one.weighed.ess}
        began = time.process_time()
        weighed([one.fit], fitter.residuals, 0, base.fit)
        row["weighed_s"] = time.process_time() - began
        began = time.process_time()
        far = weighed([one.fit], fitter.residuals, 1, base.fit, NUM_FAR, width=FAR_WIDTH)
        row |= {"far": far.log_evidence, "far_ess": far.ess, "far_k": pareto_k(far)}
        row |= {"far_s": time.process_time() - began}
        yield row


class RoundFit(eqx.Module):
    """A posterior in u, z = mean + root u: its density over that of a standard normal u."""

    likelihood: LogDensity
    mean: jax.Array
    root: jax.Array

    def __call__(self, u: jax.Array) -> jax.Array:
        """The logarithm of that ratio."""
        z = self.mean + self.root @ u
        log_volume = jnp.linalg.slogdet(self.root)[1]
        return self.likelihood(z) + 0.5 * (jnp.sum(u**2) - jnp.sum(z**2)) + log_volume


def smc(row: dict[str, Any], ways: Sequence[str], num_particles: int) -> dict[str, Any]:
    """The row with the log evidence by smc, `ways`: wide0, wide1, smc0, smc1."""
    trials = trials_of(draw_track(row["seed"]), [row["effect"]])
    likelihood, found = likelihood_of(trials), row | {"particles": num_particles}
    fit = GradientFitter(trials).fit(0)
    root = WIDE * symmetric_root(fit.covariance)
    round_fit = RoundFit(likelihood, jnp.asarray(fit.z), jnp.asarray(root))
    for way in ways:
        began = time.process_time()
        key, dim = jax.random.key(int(way[-1])), len(trials.names)
        density = round_fit if way.startswith("wide") else likelihood
        population = temper(key, density, dim, num_particles=num_particles, is_moved=False)
        found[way] = population.log_evidence
        found[f"{way}_s"] = time.process_time() - began
    return found


def every_one(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """All of them."""
    return np.ones(len(hypotheses), bool)


def pareto_k(found: Weighed) -> float:
    """Of the weights' tail (Vehtari and others, 2024, J. Mach. Learn. Res. 25, 72)."""
    import arviz

    return float(arviz.psislw(found.log_weights)[1])


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """How far Laplace's evidence and the mended one are from the others, nats."""
    found: dict[str, Any] = {"hypotheses": len(rows)}
    found["weighed_too_few"] = sum(row["weighed"] is None for row in rows)
    rows = _in_race(rows)
    found["in_race"] = len(rows)
    sure = [row for row in rows if row["far_k"] < RELIABLE_K]
    found["far_reliable"] = len(sure)
    by_way = {way: [row for row in rows if f"{way}1" in row] for way in ("smc", "wide")}
    smc, wide = (
        [row for row in by_way[way] if _apart(row, way) <= BAR_NATS] for way in ("smc", "wide")
    )
    pairs = (
        ("far", sure, lambda row: row["far"]),
        ("smc", smc, lambda row: _mean(row, "smc")),
        ("wide", wide, lambda row: _mean(row, "wide")),
    )
    for name in ("laplace", "weighed"):
        for other, some, value in pairs:
            own = [row for row in some if row[name] is not None]
            off = np.abs([row[name] - value(row) for row in own] or [np.nan])
            found[f"{name}_from_{other}"] = {
                "hypotheses": len(own),
                "median": np.median(off),
                "worst": np.max(off),
                "beyond_1": int(np.sum(off > BAR_NATS)),
            }
    for way, some in by_way.items():
        found[f"{way}_apart"] = sorted(_apart(row, way) for row in some)
    for name in ("weighed_s", "far_s", "smc0_s", "wide0_s"):
        found[f"{name}_median"] = np.median([row[name] for row in rows if name in row] or [np.nan])
    return found


def trials_of(track: Track, names: Sequence[str]) -> JointProblem:
    """A track with effects in its model."""
    return make_joint_problem([track.clip], [track.observation], effects=make_effects(list(names)))


def _in_race(rows: Collection[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those that are not far behind the best of their track."""
    best: dict[int, float] = {}
    for row in rows:
        best[row["seed"]] = max(best.get(row["seed"], 0.0), row["lead"])
    return [row for row in rows if row["lead"] > best[row["seed"]] - OUT_OF_THE_RACE]


def _mean(row: dict[str, Any], way: str) -> float:
    """Of two estimates of an integral, whose logarithms these are."""
    return float(np.logaddexp(row[f"{way}0"], row[f"{way}1"]) - np.log(2))


def _apart(row: dict[str, Any], way: str) -> float:
    return abs(row[f"{way}0"] - row[f"{way}1"])


def _keep(row: dict[str, Any], rows: dict[tuple[int, str], dict[str, Any]], out: Path) -> None:
    rows[row["seed"], row["effect"]] = row
    with out.open("a") as file:
        file.write(json.dumps(row) + "\n")
    name = f"{row['seed']} {row['hidden'][:8]} {row['strength']:.2f}: {row['effect'][:12]}"
    over = [None if row.get(key) is None else row[key] - row["laplace"] for key in OVER_LAPLACE]
    tables.row(name, [row["lead"], *over, row["ess"], row["far_k"], row.get("wide0_s")])


def _results(path: Path) -> dict[tuple[int, str], dict[str, Any]]:
    """The last row of each hypothesis."""
    lines = path.read_text().splitlines() if path.is_file() else []
    return {(row["seed"], row["effect"]): row for row in map(json.loads, lines)}


def _parser() -> command.Parser:
    parser = command.Parser(prog="evidence.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=int, default=10, help="tracks, four hypotheses each")
    parser.add_argument("--first", type=int, default=81000, help="seed of the first track")
    parser.add_argument("--particles", type=int, default=256, help="of smc and wide")
    parser.add_argument("--wide", type=int, default=40, help="hypotheses")
    parser.add_argument("--smc", type=int, default=12, help="hypotheses")
    parser.add_argument("--out", type=Path, required=True, help="one line of JSON per hypothesis")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
