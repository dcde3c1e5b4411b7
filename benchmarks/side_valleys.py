"""How often does a fit end in a side valley?

    python -m benchmarks side_valleys --num 300

Scenes are drawn widely: ramps of 5 to 35 degrees, all shapes, friction from 0.01 to nearly what
holds an object, masses up to 16 times each other, objects close to the foot and far from it, both
ideal ones and with the small faults of real clips, tracks of 0.05 to 1 mm noise. Each is fitted as
`galileo fit --method grad` does, and from the truth. A fit is in a side valley where the fit from
the truth has more evidence by more than 3 nats: it was there to be found and was not.

With `--chains N`, the N worst fits are also sampled as `--method mh` does: what it says of k1 and
k2 beside what the fit says.

CPU seconds are of the whole process per fit, compilation apart.
"""

import argparse
import math
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, get_args

import jax.numpy as jnp
import numpy as np

from benchmarks import tables, tracks
from benchmarks.journal import Journal
from galileo_jax.clip.fields import Shape
from galileo_jax.clip.schema import ClipObject
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.metropolis import metropolis_posterior
from galileo_jax.model.effects.nuisances.foot_transition import FootTransition
from galileo_jax.model.effects.nuisances.impact_restitution import ImpactRestitution
from galileo_jax.model.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.model.parameters import inverse
from galileo_jax.runtime.precision import in_float64
from galileo_jax.simulation.motion import roll_out
from galileo_jax.simulation.truth import Truth, extents

SHAPES: tuple[Shape, ...] = get_args(Shape)
ANGLES_DEG, MASSES_KG, LEAST_FRICTION, MOST_FRICTION2 = (5.0, 35.0), (0.1, 1.6), 0.01, 0.5
SHARE_OF_HOLDING = 0.95  # k1 is below that share of tan(angle)
RELEASES_M, GAPS_M, NOISES_M = (0.15, 0.8), (0.005, 0.6), (5e-5, 1e-3)
FPS = 30.0
AFTER_REST_S, LONGEST_S = 0.3, 3.0
SIDE_VALLEY_NATS = 3.0
BAR = 0.003


@dataclass(frozen=True)
class Scene:
    """One drawn track.

    Attributes:
      seed: it was drawn with.
      truth: what is in it.
      trials: it, with the base model.
    """

    seed: int
    truth: Truth
    trials: JointProblem

    def __str__(self) -> str:
        """What is in it, in one line."""
        it = self.truth
        shapes = "-".join(each.shape for each in it.objects)
        (m1, m2), (k1, k2) = it.mass_kg, it.friction
        values = f"{it.ramp_angle_deg:.0f} deg, k1 {k1:.3f}, k2 {k2:.3f}, ratio {m1 / m2:.2f}"
        return f"{self.seed}: {shapes}, {values}, object 2 at {it.object2_x_m:.2f} m"


class Ended(NamedTuple):
    """How the fit of one scene ended.

    Attributes:
      scene: that was fitted.
      fit: of it.
      behind: nats of evidence behind the fit from the truth.
      cpu_s: of the fit.
    """

    scene: Scene
    fit: GradientFit
    behind: float
    cpu_s: float

    def __str__(self) -> str:
        """The scene, and what was found in it."""
        trials = self.scene.trials
        found = dict(zip(trials.names, trials.theta(self.fit.z), strict=True))
        ratio = found["m1"] / found["m2"]
        values = f"k1 {found['k1']:.3f}, k2 {found['k2']:.3f}, ratio {ratio:.2f}"
        chi2 = self.fit.chi2 / self.fit.num_values
        ended = f"chi2 {chi2:.2f}, {self.fit.code.name}, {self.behind:.1f} nats behind"
        return f"{self.scene}; found {values}, {ended}"


@in_float64
def main(call: argparse.Namespace) -> dict[str, Any]:
    seeds = call.seeds or range(call.first, call.first + call.num)
    journal, ends, rows = Journal(call.out), [], []
    for seed in seeds:

        def ended(seed: int = seed) -> dict[str, Any]:
            ends.append(end := fit_scene(draw_scene(seed), call.seed))
            return {"seed": seed, "behind": end.behind, "code": end.fit.code.name, "cpu_s": end.cpu_s,
                    "rollouts": end.fit.stats["num_rollouts"], "says": str(end)}  # fmt: skip

        rows.append(journal.row(f"scene {seed}", ended))
        if rows[-1]["behind"] > SIDE_VALLEY_NATS:
            print(rows[-1]["says"], flush=True)
    stuck = [row for row in rows if row["behind"] > SIDE_VALLEY_NATS]
    cpu = np.array([row["cpu_s"] for row in rows])
    for end in sorted(ends, key=lambda end: -end.behind)[: call.chains]:
        _print_chains(end, call.seed)
    figures = {
        "scenes": len(rows),
        "stuck": len(stuck),
        "share": len(stuck) / len(rows),
        "unsaid": sum(row["code"] == "CONVERGED" for row in stuck),
        "cpu_s_mean": float(cpu.mean()),
        "cpu_s_median": float(np.median(cpu)),
        "cpu_s_95": float(np.quantile(cpu, 0.95)),
        "rollouts_mean": float(np.mean([row["rollouts"] for row in rows])),
    }
    tables.summary(figures)
    figures["codes"] = dict(Counter(row["code"] for row in rows))
    figures["stuck_seeds"] = [row["seed"] for row in stuck]
    too_many = [f"{figures['share']:.2%} in a side valley > {BAR:.1%}"]
    return figures | {"bars_missed": tables.missed(too_many if figures["share"] > BAR else [])}


def draw_scene(seed: int) -> Scene:
    """A scene in which object 1 slides or rolls; the same seed gives the same scene."""
    rng = np.random.default_rng([seed, 16])
    angle_deg = rng.uniform(*ANGLES_DEG)
    holds = SHARE_OF_HOLDING * math.tan(math.radians(angle_deg))
    shapes = rng.choice(SHAPES, 2)
    objects = tuple(_object(i, shape, rng) for i, shape in enumerate(shapes))
    lengths = [extents(each)[0] for each in objects]
    truth = Truth(
        mass_kg=tuple(_log_uniform(rng, MASSES_KG) for _ in range(2)),
        friction=tuple(_friction(rng, most) for most in (holds, MOST_FRICTION2)),
        ramp_angle_deg=angle_deg,
        objects=objects,
        release_m=_log_uniform(rng, RELEASES_M),
        object2_x_m=sum(lengths) + _log_uniform(rng, GAPS_M),
    )
    if rng.random() < 0.5:
        truth = _with_faults(truth, rng)
    motion = roll_out(truth)
    num = int(FPS * min(motion.rest_s + AFTER_REST_S, LONGEST_S)) + 1
    times, noise = np.arange(num) / FPS, _log_uniform(rng, NOISES_M)
    taken = times - truth.effect_values.get("release_instant", 0.0)
    clean = motion.at(np.maximum(taken, 0.0)).position_m
    seen = tracks.observed(clean + noise * rng.standard_normal(clean.shape), FPS, noise)
    clip = tracks.declared(objects, angle_deg, FPS, num)
    return Scene(seed, truth, make_joint_problem([clip], [seen]))


def fit_scene(scene: Scene, seed: int) -> Ended:
    """Fits it as users do and from the truth."""
    fitter = GradientFitter(scene.trials)
    fitter.compile()
    began = time.process_time()
    fit = fitter.fit(seed)
    cpu_s = time.process_time() - began
    behind = from_truth(scene, fitter).log_evidence - fit.log_evidence
    return Ended(scene, fit, behind, cpu_s)


def from_truth(scene: Scene, fitter: GradientFitter) -> GradientFit:
    """The fit that is reached from the truth."""
    parameters = scene.trials.model_parameters
    known = scene.truth.theta
    theta = np.array([known.get(p.name, p.absent) for p in parameters])
    z = np.clip(np.asarray(inverse(parameters, jnp.asarray(theta))), -3.0, 3.0)
    (fit,) = fitter.fit_from(z[None], np.ones((1, len(z)), bool), np.zeros(1, int))
    return fit


def _object(index: int, shape: Shape, rng: np.random.Generator) -> ClipObject:
    length, depth, height = rng.uniform(0.04, 0.09, 3).round(3).tolist()
    sizes = {
        "box": (length, depth, height),
        "sphere": (length / 2,),
        "cylinder": (length / 2, depth),
        "torus": (0.375 * length, 0.125 * length),
    }
    rolls = bool(rng.random() < 0.75) if shape in ("cylinder", "torus") else None
    return ClipObject(name=f"object{index + 1}", shape=shape, size_m=sizes[shape], rolls=rolls)


def _friction(rng: np.random.Generator, most: float) -> float:
    """Half of them even between the least and the most, half by their order of magnitude."""
    is_even = rng.random() < 0.5
    span = (LEAST_FRICTION, most)
    return float(rng.uniform(*span)) if is_even else _log_uniform(rng, span)


def _with_faults(truth: Truth, rng: np.random.Generator) -> Truth:
    """What is never ideal, as in `galileo simulate --faults`."""
    values = {
        "foot_transition": rng.uniform(0.96, 1.0),
        "impact_restitution": rng.uniform(0.0, 0.04),
        "release_instant": rng.uniform(-0.3, 0.3) / FPS,
    }
    effects = (FootTransition(), ImpactRestitution(), ReleaseInstant())
    return replace(truth, effects=effects, effect_values=values)


def _log_uniform(rng: np.random.Generator, span: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(span))))


def _print_chains(end: Ended, seed: int) -> None:
    """Of one scene, what the fit and `mh` say: truth, mean and sd by each."""
    names, trials = end.scene.trials.names, end.scene.trials
    posterior = metropolis_posterior(trials, end.fit, seed)
    print(f"\n{end}\n  mh: {posterior.status.name}")
    z = np.random.default_rng(seed).multivariate_normal(end.fit.z, end.fit.covariance, 2000)
    theta = trials.theta(z)
    for name in ("k1", "k2"):
        drawn, i = posterior[name], names.index(name)
        print(f"  {name}: true {end.scene.truth.known[name]:.4f}; "
              f"grad {theta[:, i].mean():.4f} +- {theta[:, i].std():.4f}; "
              f"mh {drawn.mean():.4f} +- {drawn.std():.4f}")  # fmt: skip


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--num", type=int, default=300, help="scenes")
    parser.add_argument("--first", type=int, default=0, help="seed of the first scene")
    parser.add_argument("--seeds", type=int, nargs="*", help="of the scenes, in place of these")
    parser.add_argument("--seed", type=int, default=0, help="of the fits")
    parser.add_argument("--chains", type=int, default=0, help="so many of the worst are sampled")
    parser.add_argument("--out", type=Path, help="finished scenes, to go on from")
