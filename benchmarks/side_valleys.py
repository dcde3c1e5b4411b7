"""How often does a fit end in a side valley?

    python -m benchmarks side_valleys --num 300

Scenes are drawn widely: ramps of 5 to 35 degrees, all shapes, friction from 0.01 to nearly what
holds an object, masses up to 16 times each other, objects close to the foot and far from it, both
ideal ones and with the small faults of real clips, tracks of 0.05 to 1 mm noise. Each is fitted as
`galileo fit --method grad` does, and from the truth. A fit is in a side valley where the fit from
the truth has more evidence by more than 3 nats: it was there to be found and was not.

CPU seconds are of the whole process per fit, compilation apart. With `--out FILE` a run that was
cut off goes on.
"""

import math
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import jax.numpy as jnp
import numpy as np

from benchmarks import tables, tracks
from benchmarks.journal import Journal
from benchmarks.tracks import Case
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.fields import Shape
from galileo_jax.clip.schema import ClipObject
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.model.effects.nuisances.foot_transition import FootTransition
from galileo_jax.model.effects.nuisances.impact_restitution import ImpactRestitution
from galileo_jax.model.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.model.parameters import inverse
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.simulation.motion import roll_out
from galileo_jax.simulation.truth import Truth, extents

SHAPES: tuple[Shape, ...] = get_args(Shape)
ANGLES_DEG, MASSES_KG, LEAST_FRICTION, MOST_FRICTION2 = (5.0, 35.0), (0.1, 1.6), 0.01, 0.5
SHARE_OF_HOLDING = 0.95  # k1 is below that share of tan(angle)
RELEASES_M, GAPS_M, NOISES_M = (0.15, 0.8), (0.005, 0.6), (5e-5, 1e-3)
FPS = 30.0
AFTER_REST_S, LONGEST_S = 0.3, 3.0
SIDE_VALLEY_NATS = 3.0
BAR = 0.002


@in_float64
def main(
    *, num: int = 300, first: int = 0, seed: int = 0, out: Path | None = None
) -> dict[str, Any]:
    journal, rows = Journal(out), []
    for own in range(first, first + num):
        row = journal.row(f"scene {own}", lambda own=own: fitted(own, seed))
        if row["behind"] > SIDE_VALLEY_NATS:
            print(row["says"], flush=True)
        rows.append(row)
    stuck = [row for row in rows if row["behind"] > SIDE_VALLEY_NATS]
    cpu = np.array([row["cpu_s"] for row in rows])
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


def draw_scene(seed: int) -> Case:
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
        stand_x_m=(sum(lengths) + _log_uniform(rng, GAPS_M),),
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
    return Case(truth, make_joint_problem([clip], [seen]))


def fitted(scene_seed: int, seed: int) -> dict[str, Any]:
    """How the fit of a scene as users do it ends, and how far behind the fit from the truth."""
    scene = draw_scene(scene_seed)
    fitter = GradientFitter(scene.trials)
    fitter.compile()
    began = time.process_time()
    fit = best_fit(fitter, seed)
    cpu_s = time.process_time() - began
    behind = from_truth(scene, fitter).log_evidence - fit.log_evidence
    found = dict(zip(scene.trials.names, scene.trials.theta(fit.z), strict=True))
    shapes = "-".join(each.shape for each in scene.truth.objects)
    says = f"{scene_seed}: {shapes}, {scene.truth.ramp_angle_deg:.0f} deg; found (and true)"
    for name in scene.values:
        says += f" {name} {found[name]:.3f} ({scene.values[name]:.3f})"
    return {
        "seed": scene_seed,
        "behind": behind,
        "code": fit.code.name,
        "cpu_s": cpu_s,
        "rollouts": fit.stats["num_rollouts"],
        "says": f"{says}; chi2 {fit.chi2 / fit.num_values:.2f}, {fit.code.name}, {behind:.1f} nats",
    }


def from_truth(scene: Case, fitter: GradientFitter) -> GradientFit:
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
