"""What a synthetic clip is made with: drawn at random where it is not given."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from galileo_jax.clip.fields import Shape
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipObject
from galileo_jax.clip.sizes import extents, rolling
from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.scene.scene import laid_out, on_ramp
from galileo_jax.runtime.errors import InputError

NONE = "none"  # hidden
# What the clip's yaml says wrongly: the motion itself knows nothing of it.
DECLARED_WRONGLY = ("frame_rate", "ramp_angle", "scale_error")
GRAVITY_M_S2 = 9.81
NUM_TRIES = 300
SLOWEST_HIT_M_S = 0.5  # a weaker hit says little about object 2


@dataclass(frozen=True)
class Truth:
    """One experiment on a ramp."""

    mass_kg: tuple[float, ...]  # of the objects
    friction: tuple[float, ...]
    ramp_angle_deg: float  # of the ramp
    objects: tuple[ClipObject, ...]  # names, shapes and sizes
    release_m: float  # distance up the ramp from the foot to the point under object 1's centre
    stand_x_m: tuple[float, ...]  # where the centres of the objects on the table stand
    gravity: float = GRAVITY_M_S2  # m/s^2
    scenario: str = "ramp"  # ramp, multi or incline
    # What is hidden in the clip, in the motion or in what is declared of it
    effects: tuple[Effect, ...] = ()
    # Their parameters by name, all of them
    effect_values: Mapping[str, float] = field(default_factory=dict)

    @property
    def motion_effects(self) -> tuple[Effect, ...]:
        """Those that change the motion. The others only change what is said of it."""
        return tuple(effect for effect in self.effects if effect.name not in DECLARED_WRONGLY)

    @property
    def theta(self) -> dict[str, float]:
        """All parameters by name."""
        return {**self.known, **self.effect_values}

    @property
    def known(self) -> dict[str, float]:
        """Masses and frictions by name: m1, k1, m2, ..."""
        pairs = enumerate(zip(self.mass_kg, self.friction, strict=True), 1)
        return {name: value for i, (m, k) in pairs for name, value in ((f"m{i}", m), (f"k{i}", k))}

    @property
    def angle_rad(self) -> float:
        """The ramp's angle in radians."""
        return math.radians(self.ramp_angle_deg)

    @property
    def surroundings(self) -> Surroundings:
        """The geometry as the scene and the effects see it."""
        half = [extents(declared) for declared in self.objects]
        start = (
            on_ramp(-self.release_m, half[0][1], self.angle_rad),
            *((x, height) for x, (_, height) in zip(self.stand_x_m, half[1:], strict=True)),
        )
        has_table = SCENARIOS[self.scenario].has_table
        return Surroundings(
            names=tuple(declared.name for declared in self.objects),
            angle_rad=self.angle_rad,
            gravity=self.gravity,
            **laid_out(half, start, self.angle_rad, has_table),
            **rolling(self.objects),
        )

    @property
    def hit_speed_m_s(self) -> float:
        """Object 1's speed when it meets object 2, of a point; 0 = never."""
        if len(self.objects) < 2:
            return 0.0
        where = self.surroundings
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        k1, twice_g = self.friction[0], 2 * self.gravity
        down = self.release_m - where.corner_m[0]
        if beta := self.objects[0].roll_inertia:
            rubs = min(k1 * cos, sin * beta / (1 + beta))
            return math.sqrt(twice_g * (sin - rubs) * down) * (cos + beta) / (1 + beta)
        at_foot = twice_g * (sin - k1 * cos) * down
        beyond = max(0.0, at_foot) * max(0.0, cos - k1 * sin) ** 2
        run = self.stand_x_m[0] - sum(where.half_length_m[:2]) - where.corner_m[0]
        return math.sqrt(max(0.0, beyond - twice_g * k1 * run))


@dataclass(frozen=True)
class Declared:
    """What a user says of a clip: wrong where an effect of the measurement is hidden."""

    fps: float  # frames per second
    scale: float  # measured lengths are so many times the true ones
    true_fps: float  # at which the frames were taken
    release_s: float  # when object 1 is let go after the first frame, true seconds
    ramp_angle_deg: float  # of the ramp, where there is one

    @classmethod
    def of(
        cls,
        values: Mapping[str, float],
        fps: float,
        ramp_angle_deg: float = 0.0,
        release_s: float = 0.0,
    ) -> "Declared":
        """What is said where effects have these values by name; the angle and the release are true.

        `fps`: what the frame rate is said to be.
        """
        value = values.get
        return cls(
            fps=fps,
            scale=1.0 + value("scale_error", 0.0),
            true_fps=fps / (1.0 + value("frame_rate", 0.0)),
            release_s=release_s + value("release_delay", 0.0) + value("release_instant", 0.0),
            ramp_angle_deg=round(ramp_angle_deg - math.degrees(value("ramp_angle", 0.0)), 9),
        )

    def taken_s(self, num_frames: int) -> np.ndarray:
        """When each frame was taken, `[frame]`, true seconds since the release."""
        return np.arange(num_frames) / self.true_fps - self.release_s


def truth_like(path: Path, ramp_angle_deg: float, scenario: str) -> Truth:
    """The truth of NAME.truth.json on a ramp declared to have another angle.

    Raises:
      InputError: it is no truth of a clip on a ramp that this program simulated.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if record["scenario"] != scenario:
            raise InputError(f"--like: {path}: scenario {record['scenario']}; {scenario} expected")
        count = int(record["objects"])
        names = [] if record["effect"] == NONE else str(record["effect"]).split("+")
        values = {name: float(value) for name, value in record["effect_parameters"].items()}
        numbers = range(1, count + 1)
        return Truth(
            mass_kg=tuple(float(record[f"m{i}"]) for i in numbers),
            friction=tuple(float(record[f"k{i}"]) for i in numbers),
            ramp_angle_deg=ramp_angle_deg + math.degrees(values.get("ramp_angle", 0.0)),
            objects=tuple(
                ClipObject(name=f"object{i}", shape=shape, size_m=record[f"size{i}_m"], rolls=rolls)
                for i, shape, rolls in zip(numbers, record["shapes"], record["rolls"], strict=True)
            ),
            release_m=float(record["release_m"]),
            stand_x_m=tuple(float(record[f"object{i}_y_m"]) for i in numbers if i > 1),
            gravity=float(record["gravity"]),
            scenario=scenario,
            effects=tuple(make_effects(names)),
            effect_values=values,
        )
    except OSError as error:
        raise InputError(f"--like: {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"--like: {path}: not the truth of a clip that this version simulated ({error})"
        ) from error


def draw_truth(
    rng: np.random.Generator,
    ramp_angle_deg: float,
    given: Mapping[str, float],
    scenario: str = "ramp",
    shapes: Sequence[Shape] = ("box", "box"),
) -> Truth:
    """Draws what `given` (m1, k1, m2, ...) leaves open.

    Where the given values allow it, object 1 hits object 2 at more than 0.5 m/s.

    Places across the travel (z2) are 0 where not given. `shapes`: of the objects, in the order of
    the travel; what is round rolls.
    """
    for _ in range(NUM_TRIES + 1):
        truth = _draw(rng, ramp_angle_deg, given, scenario, shapes)
        if len(shapes) < 2 or truth.hit_speed_m_s > SLOWEST_HIT_M_S:
            break
    return truth


def _draw(
    rng: np.random.Generator,
    ramp_angle_deg: float,
    given: Mapping[str, float],
    scenario: str,
    shapes: Sequence[Shape],
) -> Truth:
    mass1, mass2 = np.exp(rng.uniform(np.log(0.15), np.log(1.0), 2))
    k1, k2 = rng.uniform((0.03, 0.05), (0.26, 0.32))
    sizes = list(rng.uniform(0.045, 0.080, (2, 3)).round(3))
    release, stand = float(rng.uniform(0.40, 0.65)), [float(rng.uniform(0.20, 0.30))]
    mass, friction = [mass1, mass2], [k1, k2]
    for _ in shapes[2:]:
        mass.append(np.exp(rng.uniform(np.log(0.15), np.log(1.0))))
        friction.append(rng.uniform(0.05, 0.32))
        sizes.append(rng.uniform(0.045, 0.080, 3).round(3))
        stand.append(stand[-1] + float(rng.uniform(0.09, 0.13)))
    objects = tuple(
        ClipObject(
            name=f"object{i + 1}",
            shape=shape,
            size_m=_size(shape, sizes[i]),
            rolls=True if shape in ("cylinder", "torus") else None,
            z_m=float(given.get(f"z{i + 1}", 0.0)),
        )
        for i, shape in enumerate(shapes)
    )
    numbers = range(len(shapes))
    return Truth(
        mass_kg=tuple(float(given.get(f"m{i + 1}", mass[i])) for i in numbers),
        friction=tuple(float(given.get(f"k{i + 1}", friction[i])) for i in numbers),
        ramp_angle_deg=ramp_angle_deg,
        objects=objects,
        release_m=release,
        stand_x_m=tuple(stand[: len(shapes) - 1]),
        scenario=scenario,
    )


def _size(shape: Shape, sides_m: np.ndarray) -> tuple[float, ...]:
    """An object as long as a box of these sides."""
    length, depth, height = map(float, sides_m)
    radius = round(length / 2, 4)
    return {
        "box": (length, depth, height),
        "sphere": (radius,),
        "cylinder": (radius, depth),
        "torus": (round(0.75 * radius, 4), round(0.25 * radius, 4)),
    }[shape]
