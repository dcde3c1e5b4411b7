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

import argparse
import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pybullet  # pyright: ignore

from benchmarks import bullet_scene, calibration, journal, tables, verdicts
from benchmarks.bullet_scene import Hidden
from galileo_jax.api.diagnose import diagnose
from galileo_jax.commands import command
from galileo_jax.model.effects.registry import effect_names
from galileo_jax.simulation.truth import Truth, draw_truth

ANGLES_DEG = (10.0, 20.0)
FRAME_RATES = (30.0, 60.0)
NOISE_M = 0.2e-3
LONGEST_S, AFTER_REST_S, AT_REST_M_S = 3.0, 0.3, 2e-3
OBJECT_1 = np.array([[1.0], [0.0]])


class World(NamedTuple):
    """What a hidden effect makes of an experiment.

    Attributes:
      hidden: what acts in it.
      steeper_rad: how much steeper its ramp is than declared.
      late_s: how late object 1 is let go.
      longer: how much longer all lengths are seen than declared, as a share.
      slower: how much longer a frame lasts than declared, as a share.
      values: what was drawn.
    """

    hidden: Hidden = bullet_scene.NOTHING
    steeper_rad: float = 0.0
    late_s: float = 0.0
    longer: float = 0.0
    slower: float = 0.0
    values: Mapping[str, float] = MappingProxyType({})


Make = Callable[[Truth, np.random.Generator], World]


def path_m(truth: Truth, place: np.ndarray) -> np.ndarray:
    """How far below the foot each object is along its way, negative on the ramp."""
    x, z = place[:, 0], place[:, 2]
    return np.where(x < 0, x * math.cos(truth.angle_rad) - z * math.sin(truth.angle_rad), x)


def none(truth: Truth, rng: np.random.Generator) -> World:
    """Nothing."""
    return World()


def air_drag(truth: Truth, rng: np.random.Generator) -> World:
    """A sail on each."""
    c = truth.mass_kg[0] * rng.uniform(0.5, 1.5)

    def force(place: np.ndarray, v: np.ndarray) -> np.ndarray:
        return -c * np.linalg.norm(v, axis=1, keepdims=True) * v

    return World(Hidden(force=force), values={"c": c})


def viscous_drag(truth: Truth, rng: np.random.Generator) -> World:
    """Oil under each."""
    b = truth.mass_kg[0] * rng.uniform(0.4, 1.2)
    return World(Hidden(force=lambda place, v: -b * v), values={"b": b})


def constant_force(truth: Truth, rng: np.random.Generator) -> World:
    """A wind in the lee of which object 2 stands."""
    f = truth.mass_kg[0] * rng.uniform(0.5, 1.2) * rng.choice([-1.0, 1.0])
    pull = f * OBJECT_1 * np.array([1.0, 0.0, 0.0])
    return World(Hidden(force=lambda place, v: pull), values={"f": f})


def magnetic_brake(truth: Truth, rng: np.random.Generator) -> World:
    """Magnets below the last of the ramp brake an object of copper."""
    b, begins = truth.mass_kg[0] * rng.uniform(2.0, 5.0), rng.uniform(-0.25, -0.15)

    def force(place: np.ndarray, v: np.ndarray) -> np.ndarray:
        q = path_m(truth, place)[:, None]
        return -b * OBJECT_1 * v * ((q > begins) & (q < begins + 0.12))

    return World(Hidden(force=force), values={"b": b, "begins": begins})


def spring_tether(truth: Truth, rng: np.random.Generator) -> World:
    """A rubber band from where object 1 starts."""
    k = truth.mass_kg[0] * rng.uniform(0.7, 2.0)
    x, z = truth.surroundings.start_m[0]
    tied = np.array([x, 0.0, z])
    return World(
        Hidden(force=lambda place, v: -k * OBJECT_1 * (place - tied)), values={"stiffness": k}
    )


def stribeck(truth: Truth, rng: np.random.Generator) -> World:
    """Grease."""
    a, slow, k = rng.uniform(0.8, 2.0), rng.uniform(0.25, 0.5), np.array(truth.friction)

    def friction(place: np.ndarray, v: np.ndarray) -> np.ndarray:
        return k * (1 + a * np.exp(-np.linalg.norm(v, axis=1) / slow))

    return World(Hidden(friction=friction), values={"a": a, "v_s": slow})


def friction_patch(truth: Truth, rng: np.random.Generator) -> World:
    """A strip of sandpaper somewhere on the ramp or on the table."""
    rough, begins, k = rng.uniform(0.15, 0.35), rng.uniform(-0.25, 0.3), np.array(truth.friction)

    def friction(place: np.ndarray, v: np.ndarray) -> np.ndarray:
        q = path_m(truth, place)
        return k + rough * ((q > begins) & (q < begins + 0.15))

    return World(Hidden(friction=friction), values={"rough": rough, "begins": begins})


def surface_friction(truth: Truth, rng: np.random.Generator) -> World:
    """A table on which object 1 rubs more than on the ramp."""
    more, k = rng.uniform(0.1, 0.25), np.array(truth.friction)

    def friction(place: np.ndarray, v: np.ndarray) -> np.ndarray:
        return k + more * OBJECT_1[:, 0] * (place[:, 0] > 0)

    return World(Hidden(friction=friction), values={"more": more})


def restitution(truth: Truth, rng: np.random.Generator) -> World:
    """Rubber between them."""
    e = rng.uniform(0.3, 0.8)
    return World(Hidden(restitution=e), values={"e": e})


def initial_push(truth: Truth, rng: np.random.Generator) -> World:
    """Pushed, not let go."""
    speed = rng.uniform(0.2, 0.5)
    return World(Hidden(start_m_s=speed), values={"v": speed})


def table_tilt(truth: Truth, rng: np.random.Generator) -> World:
    """A table that is not level."""
    tilt = math.radians(rng.uniform(1.0, 2.5)) * rng.choice([-1.0, 1.0])
    return World(Hidden(table_rad=tilt), values={"tilt": tilt})


def ramp_angle(truth: Truth, rng: np.random.Generator) -> World:
    """A ramp measured wrongly."""
    steeper = math.radians(rng.uniform(1.0, 2.5)) * rng.choice([-1.0, 1.0])
    return World(steeper_rad=steeper, values={"steeper": steeper})


def release_delay(truth: Truth, rng: np.random.Generator) -> World:
    """Let go after the film began."""
    late = rng.uniform(0.1, 0.3)
    return World(late_s=late, values={"late": late})


def scale_error(truth: Truth, rng: np.random.Generator) -> World:
    """Pixels per metre declared wrongly."""
    longer = rng.uniform(0.04, 0.1) * rng.choice([-1.0, 1.0])
    return World(longer=longer, values={"longer": longer})


def frame_rate(truth: Truth, rng: np.random.Generator) -> World:
    """Frames per second declared wrongly."""
    slower = rng.uniform(0.04, 0.1) * rng.choice([-1.0, 1.0])
    return World(slower=slower, values={"slower": slower})


WORLDS: dict[str, Make] = {
    make.__name__: make
    for make in (
        none,
        air_drag,
        viscous_drag,
        constant_force,
        magnetic_brake,
        spring_tether,
        stribeck,
        friction_patch,
        surface_friction,
        restitution,
        initial_push,
        table_tilt,
        ramp_angle,
        release_delay,
        scale_error,
        frame_rate,
    )
}


def main(call: argparse.Namespace) -> dict[str, Any]:
    call.out.mkdir(parents=True, exist_ok=True)
    log = call.out / "results.jsonl"
    done = journal.finished(log)
    library = effect_names()
    scores, worst = [], 0.0
    tables.row("case", ("chi2", "after", "k1: z", "says"))
    for seed in range(call.first, call.first + call.seeds):
        for name in call.only or WORLDS:
            case = f"{name}_{seed}"
            if case not in done:
                done[case] = {"case": case, **examine(name, seed)}
                journal.add(log, done[case])
            score = verdicts.judge(name, library, done[case]["diagnosis"])
            says = "" if score.is_named_right else "NO: " if not score.is_covered else "among "
            z = k1_z(done[case]) if score.is_named_right and name != "none" else None
            worst = max(worst, abs(z or 0.0))
            tables.row(case, (score.before**2, score.after**2, z, f" {says}{score.label}"))
            scores.append(score)
    figures = verdicts.summary(scores) | {"k1_worst_z_where_named": worst}
    for key, value in figures.items():
        tables.row(key, [value])
    return figures | {"seeds": [call.first, call.seeds]}


def k1_z(row: Mapping[str, Any]) -> float:
    """By how many standard deviations k1 of the best hypothesis is off."""
    mean, sd = row["found"]["k1"]
    return (mean - row["truth"]["k1"]) / sd


def examine(name: str, seed: int) -> dict[str, Any]:
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
        "truth": {"k1": truth.friction[0], "k2": truth.friction[1], **world.values},
        "found": {key: [each["mean"], each["sd"]] for key, each in after.items()},
        "diagnosis": {key: document[key] for key in ("verdict", "history", "p_value")}
        | {"candidates": [{k: c.get(k) for k in brief} for c in document["candidates"][:8]]},
    }


def film(truth: Truth, world: World, fps: float) -> np.ndarray:
    """The centres `[object, 2, frame]`, m, as they are seen, until all have come to rest."""
    there = replace(truth, ramp_angle_deg=truth.ramp_angle_deg + math.degrees(world.steeper_rad))
    step_s = bullet_scene.FINE_STEP_S
    client = pybullet.connect(pybullet.DIRECT)
    path = bullet_scene.roll_out(there, round(LONGEST_S / step_s), client, True, world.hidden)
    pybullet.disconnect(client)
    moves = np.abs(np.diff(path, axis=0)).max(axis=(1, 2)) > AT_REST_M_S * step_s
    end_s = min(step_s * np.flatnonzero(moves)[-1] + AFTER_REST_S, LONGEST_S) + world.late_s
    times = np.arange(1 + math.floor(end_s * fps / (1 + world.slower))) / fps
    since = np.maximum(times * (1 + world.slower) - world.late_s, 0.0)
    seen = calibration.between(np.moveaxis(path, 0, -1), step_s, since)
    return (1 + world.longer) * seen


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, help="results")
    parser.add_argument("--seeds", type=command.whole_number(1), default=2, help="of each effect")
    parser.add_argument("--first", type=command.whole_number(0), default=0, help="seed")
    parser.add_argument("--only", nargs="+", choices=tuple(WORLDS), help="effects")
