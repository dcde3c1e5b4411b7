"""Are effects found that PyBullet has, and not our own formulas? Optional: `.[bullet]`.

    python -m benchmarks bullet_effects --out DIR --seeds 2 --first 0

Boxes slide, cross the foot and collide in PyBullet, which has its own idea of all that. In each
case one effect is added to that world, by a force at the centres, a friction coefficient, a tilted
table or a wrong camera, written here as anybody would who had never read the library: a wind blows
level, a rubber band pulls straight to where it is tied, a rough strip rubs whatever slides over it.
The tracks, with white noise, go through the diagnosis. Right: the effect alone is named; covered:
it is named or among those listed. What is finished stays in DIR/results.jsonl and is not done
again.
"""

import itertools
import math
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import bullet_scene, calibration, tables, verdicts
from benchmarks.bullet_scene import STEP_S, World
from benchmarks.journal import Journal
from galileo_jax.api.diagnose import diagnose
from galileo_jax.model.effects.registry import effect_names
from galileo_jax.simulation.truth import Truth, draw_truth

ANGLES_DEG = (10.0, 20.0)
FRAME_RATES = (30.0, 60.0)
NOISE_M = 0.2e-3
LONGEST_S, AFTER_REST_S, AT_REST_M_S = 3.0, 0.3, 2e-3
OBJECT_1, SIGNS = np.array([[1.0], [0.0]]), (-1.0, 1.0)


Make = Callable[[Truth, np.random.Generator], World]
WORLDS: dict[str, Make] = {"none": lambda truth, rng: World()}


def world(make: Make) -> Make:
    """Adds a world with the effect that it is named after."""
    WORLDS[make.__name__] = make
    return make


def between(truth: Truth, place: np.ndarray, begins: float, length: float) -> np.ndarray:
    """Whether each object is in a stretch of its way, m below the foot, negative on the ramp."""
    x, z = place[:, 0], place[:, 2]
    q = np.where(x < 0, x * math.cos(truth.angle_rad) - z * math.sin(truth.angle_rad), x)
    return (q > begins) & (q < begins + length)


@world
def air_drag(truth: Truth, rng: np.random.Generator) -> World:
    """A sail on each."""
    c = truth.mass_kg[0] * rng.uniform(0.5, 1.5)
    return World(force=lambda place, v: -c * np.linalg.norm(v, axis=1, keepdims=True) * v)


@world
def viscous_drag(truth: Truth, rng: np.random.Generator) -> World:
    """Oil under each."""
    b = truth.mass_kg[0] * rng.uniform(0.4, 1.2)
    return World(force=lambda place, v: -b * v)


@world
def constant_force(truth: Truth, rng: np.random.Generator) -> World:
    """A wind in the lee of which object 2 stands."""
    f = truth.mass_kg[0] * rng.uniform(0.5, 1.2) * rng.choice(SIGNS)
    return World(force=lambda place, v: f * OBJECT_1 * np.array([1.0, 0.0, 0.0]))


@world
def magnetic_brake(truth: Truth, rng: np.random.Generator) -> World:
    """Magnets below the last of the ramp brake an object of copper."""
    b, begins = truth.mass_kg[0] * rng.uniform(2.0, 5.0), rng.uniform(-0.25, -0.15)
    return World(
        force=lambda place, v: -b * OBJECT_1 * v * between(truth, place, begins, 0.12)[:, None]
    )


@world
def spring_tether(truth: Truth, rng: np.random.Generator) -> World:
    """A rubber band from where object 1 starts."""
    k = truth.mass_kg[0] * rng.uniform(0.7, 2.0)
    x, z = truth.surroundings.start_m[0]
    return World(force=lambda place, v: -k * OBJECT_1 * (place - np.array([x, 0.0, z])))


@world
def stribeck(truth: Truth, rng: np.random.Generator) -> World:
    """Grease."""
    a, slow, k = rng.uniform(0.8, 2.0), rng.uniform(0.25, 0.5), np.array(truth.friction)
    return World(friction=lambda place, v: k * (1 + a * np.exp(-np.linalg.norm(v, axis=1) / slow)))


@world
def friction_patch(truth: Truth, rng: np.random.Generator) -> World:
    """A strip of sandpaper somewhere on the ramp or on the table."""
    rough, begins, k = rng.uniform(0.15, 0.35), rng.uniform(-0.25, 0.3), np.array(truth.friction)
    return World(friction=lambda place, v: k + rough * between(truth, place, begins, 0.15))


@world
def surface_friction(truth: Truth, rng: np.random.Generator) -> World:
    """A table on which object 1 rubs more than on the ramp."""
    more, k = rng.uniform(0.1, 0.25), np.array(truth.friction)
    return World(friction=lambda place, v: k + more * OBJECT_1[:, 0] * (place[:, 0] > 0))


@world
def restitution(truth: Truth, rng: np.random.Generator) -> World:
    """Rubber between them."""
    return World(restitution=rng.uniform(0.3, 0.8))


@world
def initial_push(truth: Truth, rng: np.random.Generator) -> World:
    """Pushed, not let go."""
    return World(start_m_s=rng.uniform(0.2, 0.5))


@world
def table_tilt(truth: Truth, rng: np.random.Generator) -> World:
    """A table that is not level."""
    return World(table_rad=math.radians(rng.uniform(1.0, 2.5)) * rng.choice(SIGNS))


@world
def ramp_angle(truth: Truth, rng: np.random.Generator) -> World:
    """A ramp measured wrongly."""
    return World(steeper_rad=math.radians(rng.uniform(1.0, 2.5)) * rng.choice(SIGNS))


@world
def release_delay(truth: Truth, rng: np.random.Generator) -> World:
    """Let go after the film began."""
    return World(late_s=rng.uniform(0.1, 0.3))


@world
def scale_error(truth: Truth, rng: np.random.Generator) -> World:
    """Pixels per metre declared wrongly."""
    return World(longer=rng.uniform(0.04, 0.1) * rng.choice(SIGNS))


@world
def frame_rate(truth: Truth, rng: np.random.Generator) -> World:
    """Frames per second declared wrongly."""
    return World(slower=rng.uniform(0.04, 0.1) * rng.choice(SIGNS))


def main(
    *, out: Path, seeds: int = 2, first: int = 0, only: tuple[str, ...] = tuple(WORLDS)
) -> dict[str, Any]:
    journal, library = Journal(out / "results.jsonl"), effect_names()
    scores, worst = [], 0.0
    tables.row("case", ("chi2", "after", "k1: z", "says"))
    for seed, name in itertools.product(range(first, first + seeds), only):
        row = journal.row(f"{name}_{seed}", lambda name=name, seed=seed: examined(name, seed))
        score = verdicts.judge(name, library, row["diagnosis"])
        says = "" if score.is_named_right else "NO: " if not score.is_covered else "among "
        mean, sd = row["found"]["k1"]
        z = (mean - row["truth"]["k1"]) / sd
        if score.is_named_right and name != "none":
            worst = max(worst, abs(z))
        tables.row(row["case"], (score.before**2, score.after**2, z, f" {says}{score.label}"))
        scores.append(score)
    figures = verdicts.summary(scores) | {"k1_worst_z_where_named": worst}
    tables.summary(figures)
    return figures | {"seeds": [first, seeds]}


def examined(name: str, seed: int) -> dict[str, Any]:
    """Makes one case and diagnoses it."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    truth = draw_truth(rng, float(rng.uniform(*ANGLES_DEG)), {})
    world = WORLDS[name](truth, rng)
    fps = float(rng.choice(FRAME_RATES))
    centres = film(truth, world, fps)
    noisy = centres + NOISE_M * rng.standard_normal(centres.shape)
    found = diagnose(calibration.seen(truth, noisy, fps, NOISE_M), seed=seed)
    document = found.document
    brief = ("effect", "probability", "log_evidence", "p_value")
    after = document["candidates"][0]["parameters"]
    return {
        "truth": {"k1": truth.friction[0], "k2": truth.friction[1]},
        "found": {key: [each["mean"], each["sd"]] for key, each in after.items()},
        "diagnosis": {key: document[key] for key in ("verdict", "history", "p_value")}
        | {"candidates": [{k: c.get(k) for k in brief} for c in document["candidates"][:8]]},
    }


def film(truth: Truth, world: World, fps: float) -> np.ndarray:
    """The centres `[object, 2, frame]`, m, as they are seen, until all have come to rest."""
    there = replace(truth, ramp_angle_deg=truth.ramp_angle_deg + math.degrees(world.steeper_rad))
    path = bullet_scene.roll_out(there, round(LONGEST_S / STEP_S), world)
    moves = np.abs(np.diff(path)).max(axis=(0, 1)) > AT_REST_M_S * STEP_S
    end_s = min(STEP_S * np.flatnonzero(moves)[-1] + AFTER_REST_S, LONGEST_S) + world.late_s
    times = np.arange(1 + math.floor(end_s * fps / (1 + world.slower))) / fps
    since = np.maximum(times * (1 + world.slower) - world.late_s, 0.0)
    seen = calibration.between(path, STEP_S, since)
    return (1 + world.longer) * seen
